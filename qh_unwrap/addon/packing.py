# SPDX-License-Identifier: GPL-3.0-or-later
"""Laying islands out beside one another, by Blender's own packer, or one by itself where that would put it."""

import bpy
import numpy as np

from ..core import UnwrapError
from . import bulk

_NAME = "QH Unwrap"
_SCALED = 0.1  # times the root of a box's area: what Blender takes for a margin of 1 that is scaled with islands


def pack(islands, uv, aspects, options, nested, context):
    """Lay islands, `Pieces`, out in the 0 to 1 square; returns their new UVs (n, 2).

    uv       (n, 2), in the proportions of their images and at the same scale
    aspects  (k,), those of the islands' images, ascending

    If `nested`, they fit into one another, which may take Blender a minute, and are turned by right angles if the
    options say so; else their boxes lie side by side.  Blender packs what is selected in Edit Mode, so this happens in
    a scene of its own, where no one's selection is disturbed.  Raises `UnwrapError` if Blender does not.
    """
    if nested:
        aspect = np.array(aspects)
        return _packed(uv, islands.triangles, aspect[islands.triangle_piece], options, nested, context)
    # Of each island Blender gets a rectangle.
    low, high = islands.boxes(uv)
    high = np.maximum(high, low + 1e-6 * (high - low).max())
    if len(low) == 1 and 2 * options.margin < 1:  # from there on Blender says what it makes of no room at all
        scale, margin = _alone((high - low)[0] / (aspects[0], 1), options)
        return (uv - low) * scale + margin * np.array([aspects[0], 1])
    corners = np.stack([low, np.column_stack([high[:, 0], low[:, 1]]), high, np.column_stack([low[:, 0], high[:, 1]])])
    halves = 4 * np.arange(len(low))[:, None, None] + [[0, 1, 2], [0, 2, 3]]
    boxes = corners.swapaxes(0, 1).reshape(-1, 2), halves.reshape(-1, 3), np.repeat(aspects, 2)
    packed = _packed(*boxes, options, nested, context).reshape(-1, 4, 2)
    scale = np.ptp(packed, axis=1).max(axis=1) / (high - low).max(axis=1)
    low, scale, new = (each[islands.piece] for each in (low, scale[:, None], packed[:, 0]))
    return (uv - low) * scale + new


def _alone(size, options):
    """The scale of a single box of a `size` (2,), and its distance from the square's sides, as Blender has them."""
    if options.margin_method == 'FRACTION':
        return (1 - 2 * options.margin) / size.max(), options.margin
    margin = options.margin if options.margin_method == 'ADD' else _SCALED * options.margin * np.sqrt(size.prod())
    scale = 1 / (size.max() + 2 * margin)
    return scale, margin * scale


def _packed(uv, triangles, aspect, options, nested, context):
    """The UVs (n, 2) after the triangles (t, 3) are packed as they hang together, for images of their aspects (t,)."""
    scene = bpy.data.scenes.new(_NAME)
    made = [scene]
    try:
        parts = [(each, triangles[aspect == each]) for each in np.unique(aspect).tolist()]
        # Islands come in the order of their aspects: each part has its own vertices, in a row.
        rows = [slice(its.min(), its.max() + 1) for _, its in parts]
        meshes = [_mesh(each, uv[its], own - its.start, made) for its, (each, own) in zip(rows, parts, strict=True)]
        if not _done(scene, meshes, options, nested, context):
            raise UnwrapError("Blender could not pack the islands: choose the placement Unit Square")
        packed = uv.copy()
        for mesh, its, (each, _) in zip(meshes, rows, parts, strict=True):
            corners = bulk.values(mesh.uv_layers[0].uv, "vector", np.float32, 2)
            packed[its.start + bulk.corner_vertices(mesh)] = corners.astype(float) * (each, 1)
        return packed
    finally:
        bpy.data.batch_remove(made)


def _done(scene, meshes, options, nested, context):
    view_layer = scene.view_layers[0]
    for mesh in meshes:
        obj = bpy.data.objects.new(_NAME, mesh)
        scene.collection.objects.link(obj)
        obj.select_set(True, view_layer=view_layer)
        view_layer.objects.active = obj
    if not scene.tool_settings.use_uv_select_sync:  # set in Blender 5, where setting it changes selections
        scene.tool_settings.use_uv_select_sync = True
    with context.temp_override(
        scene=scene,
        view_layer=view_layer,
        active_object=obj,
        object=obj,
        edit_object=obj,
        area=None,  # an image editor would have the islands packed into the tile where they lie
        region=None,
    ):
        forget_escape()
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
        done = bpy.ops.uv.pack_islands(
            udim_source='CLOSEST_UDIM',
            rotate=nested and options.rotate,
            rotate_method='CARDINAL',
            scale=True,
            merge_overlap=False,
            margin_method=options.margin_method,
            margin=options.margin,
            pin=False,
            shape_method='CONCAVE' if nested else 'AABB',
        )
        bpy.ops.object.mode_set(mode='OBJECT')
    return done == {'FINISHED'}


def forget_escape():
    """Have Blender forget an ESC that was pressed before, at which its packer silently stops."""
    bpy.ops.ptcache.bake_all(bake=False)


def _mesh(aspect, uv, triangles, made):
    """A mesh of the triangles (t, 3), with an image of that aspect."""
    uv = uv / (aspect, 1)
    mesh = bpy.data.meshes.new(_NAME)
    made.append(mesh)
    mesh.vertices.add(len(uv))
    mesh.vertices.foreach_set("co", np.pad(uv, ((0, 0), (0, 1))).astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    layer = mesh.uv_layers.new(name="UVMap", do_init=False)
    layer.uv.foreach_set("vector", uv[triangles].astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    if aspect != 1:
        mesh.materials.append(_material(aspect, made))
    return mesh


def _material(aspect, made):
    image = bpy.data.images.new(_NAME, 1, 1)
    image.display_aspect = (aspect, 1) if aspect > 1 else (1, 1 / aspect)
    material = bpy.data.materials.new(_NAME)
    made += image, material
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = image
    return material
