# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing the heatmap over the 3D View and the UV Editor."""

from contextlib import contextmanager

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from . import heat
from .heatmap import settings_of

_LINE = (0.02, 0.02, 0.02, 1.0)
_NEARER, _LINES_NEARER = 1e-6, 2e-6  # than the model, in the depth buffer's own measure
_IN_EDIT_MODE, _ON_IMAGE = 0.85, 0.85  # opacity: edges and selection, or the image, shine through


def add(heatmap):
    """Have the editors draw the heatmap; returns a function that ends it."""
    view, image = bpy.types.SpaceView3D, bpy.types.SpaceImageEditor
    handles = [
        (space, space.draw_handler_add(function, (heatmap,), 'WINDOW', when))
        for space, function, when in (
            (view, _draw_model, 'POST_VIEW'),
            (view, _draw_legend, 'POST_PIXEL'),
            (image, _draw_map, 'POST_VIEW'),
            (image, _draw_legend, 'POST_PIXEL'),
        )
    ]

    def remove():
        for space, handle in handles:
            space.draw_handler_remove(handle, 'WINDOW')

    return remove


def _draw_model(heatmap):
    context = bpy.context
    heatmap.colour(settings_of(context.scene))
    for entry, obj in _visible(heatmap, context):
        with _state(depth=True), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            projection = gpu.matrix.get_projection_matrix()
            gpu.matrix.multiply_matrix(obj.matrix_world)
            gpu.matrix.load_projection_matrix(_pulled(projection, _NEARER))
            opacity = _IN_EDIT_MODE if obj.mode == 'EDIT' else 1.0
            _draw(entry, f"model {opacity}", lambda entry=entry, opacity=opacity: _model(entry, opacity))
            gpu.matrix.load_projection_matrix(_pulled(projection, _LINES_NEARER))
            _draw_lines(entry, "model lines", lambda entry=entry: _ends(entry, entry.shown.points, vertices=True), 2.0)


def _draw_map(heatmap):
    context = bpy.context
    if context.space_data.mode != 'UV':
        return
    heatmap.colour(settings_of(context.scene))
    visible = [(entry, obj) for entry, obj in _visible(heatmap, context) if entry.heat is not None]
    edited = [entry for entry, obj in visible if obj.mode == 'EDIT']
    with _state(depth=False):
        for entry in edited or [entry for entry, _ in visible]:
            _draw(entry, "map", lambda entry=entry: _map(entry))
            _draw_lines(entry, "map lines", lambda entry=entry: _ends(entry, entry.shown.uv, vertices=False), 1.5)


def _visible(heatmap, context):
    """The entries that can be seen in the editor, and their objects."""
    for entry in heatmap.entries:
        obj = entry.find()
        if obj is not None and entry.shown is not None and _is_visible(obj, context.space_data):
            yield entry, obj


def _is_visible(obj, space):
    return obj.visible_get(viewport=space) if space.type == 'VIEW_3D' else obj.visible_get()


def _pulled(projection, by):
    """The projection matrix that brings everything nearer to the eye, so that it does not fight with the model."""
    nearer = projection.copy()
    nearer[2] = nearer[2] - by * nearer[3]
    return nearer


@contextmanager
def _state(depth):
    """The graphics state for the drawing, and that which was there afterwards."""
    before = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    gpu.state.blend_set('ALPHA')
    gpu.state.depth_test_set('LESS_EQUAL' if depth else 'NONE')
    gpu.state.depth_mask_set(depth)
    try:
        yield
    finally:
        blend, depth_test, depth_mask = before
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set(depth_test)
        gpu.state.depth_mask_set(depth_mask)


def _draw(entry, name, arrays):
    batch = entry.drawn.get(name)
    if batch is None:
        points, colours = arrays()
        batch = entry.drawn[name] = _batch('TRIS', "FLAT_COLOR", pos=points, color=colours)
    batch.draw(gpu.shader.from_builtin("FLAT_COLOR"))


def _draw_lines(entry, name, ends, width):
    batch = entry.drawn.get(name)
    if batch is None:
        points = ends()
        if not len(points):
            return
        batch = entry.drawn[name] = _batch('LINES', "POLYLINE_UNIFORM_COLOR", pos=points)
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width * bpy.context.preferences.system.pixel_size)
    shader.uniform_float("color", _LINE)
    batch.draw(shader)


def _batch(kind, shader, **arrays):
    """What the graphics card gets of arrays, which it takes as they are."""
    content = {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in arrays.items()}
    return batch_for_shader(gpu.shader.from_builtin(shader), kind, content)


def _model(entry, opacity):
    """Corners (3 t, 3) of the triangles on the model and their colours (3 t, 4), in the light of a lamp."""
    shown, colours = entry.shown, entry.colours
    corners = shown.triangles if colours is None else entry.heat.corners
    if colours is None:
        colours = np.full((len(corners), 3), heat.NOTHING)
    corners = shown.points[shown.corner_vertex[corners]]
    colours = heat.lit(colours, corners @ shown.linear.T)
    return corners.reshape(-1, 3), _of_corners(colours, opacity)


def _map(entry):
    """The same in the UV Editor."""
    uv = entry.shown.uv[entry.heat.corners].reshape(-1, 2)
    return np.pad(uv, ((0, 0), (0, 1))), _of_corners(entry.colours, _ON_IMAGE)


def _of_corners(colours, opacity):
    return np.repeat(np.column_stack([colours, np.full(len(colours), opacity)]), 3, axis=0)


def _ends(entry, points, vertices):
    """The ends (2 k, 3) of the islands' outlines."""
    if entry.heat is None:
        return np.empty((0, 3))
    corners = entry.heat.outline.ravel()
    if vertices:
        return points[entry.shown.corner_vertex[corners]]
    return np.pad(points[corners], ((0, 0), (0, 1)))


def _draw_legend(heatmap):
    context = bpy.context
    if context.space_data.type == 'IMAGE_EDITOR' and context.space_data.mode != 'UV':
        return
    heatmap.colour(settings_of(context.scene))
    legend, scale = heatmap.legend, context.preferences.system.ui_scale
    if legend is None or not any(_visible(heatmap, context)):
        return
    font, line = 0, 17 * scale
    blf.size(font, 12 * scale)
    begin, end = _free_part(context)
    room = end - begin - 4 * line
    texts = [part for text in legend.lines for part in _wrapped(font, text, room)]
    width = max(blf.dimensions(font, text)[0] for text in (legend.title, *legend.ticks, *texts))
    width = min(max(width, _NARROWEST * scale), room)
    height = (len(texts) + 4.2) * line
    if width < _NARROWEST * scale / 2 or height > context.region.height - 2 * line:
        return
    left, bottom = end - width - 2 * line, line
    with _state(depth=False):
        _rectangle((left - line, bottom), (width + 2 * line, height), (0.09, 0.09, 0.09, 0.86))
        y = bottom + height - 1.35 * line
        _write(legend.title, left, y)
        y -= 1.25 * line
        _bar(legend.colours, left, y, width, 0.9 * line)
        y -= line
        for place, text in zip(np.linspace(0, 1, len(legend.ticks)), legend.ticks, strict=True):
            _write(text, left + place * (width - blf.dimensions(font, text)[0]), y)
        y -= 0.25 * line
        for text in texts:
            y -= line
            _write(text, left, y)


_NARROWEST = 300


def _wrapped(font, text, room):
    """The text in lines that are no wider than the room."""
    lines = []
    for word in text.split():
        if lines and blf.dimensions(font, f"{lines[-1]} {word}")[0] <= room:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _free_part(context):
    """From where to where no toolbar and no sidebar lies over the region, in its own pixels."""
    region, (begin, end) = context.region, (0, context.region.width)
    for other in context.area.regions:
        if other.width > 1 and other.type in {'TOOLS', 'UI'}:
            first, last = other.x - region.x, other.x + other.width - region.x
            if first >= 0 and last <= region.width:  # over it, and not beside it
                begin, end = (max(begin, last), end) if other.alignment == 'LEFT' else (begin, min(end, first))
    return begin, end


def _write(text, x, y):
    blf.color(0, 0.92, 0.92, 0.92, 1.0)
    blf.position(0, round(x), round(y), 0)
    blf.draw(0, text)


def _rectangle(corner, size, colour):
    shader = gpu.shader.from_builtin('UNIFORM_COLOR')
    (x, y), (w, h) = corner, size
    points = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
    batch = batch_for_shader(shader, 'TRIS', {"pos": points}, indices=[(0, 1, 2), (0, 2, 3)])
    shader.uniform_float("color", colour)
    batch.draw(shader)


def _bar(colours, x, y, width, height):
    shader = gpu.shader.from_builtin('SMOOTH_COLOR')
    across = x + width * np.linspace(0, 1, len(colours))
    points = [(each, end) for each in across for end in (y, y + height)]
    shades = [(*colour, 1.0) for colour in colours.tolist() for _ in range(2)]
    halves = [(k, k + 1, k + 2) for k in range(2 * len(colours) - 2)]
    batch_for_shader(shader, 'TRIS', {"pos": points, "color": shades}, indices=halves).draw(shader)
