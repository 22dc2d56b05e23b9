# SPDX-License-Identifier: GPL-3.0-or-later
"""What other methods make of the same faces: each works on copies, in a scene of their own, and is measured alike."""

import dataclasses
from dataclasses import dataclass
from time import perf_counter
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np

from ..core import UnwrapError
from ..core.curves import FIGURE_11, curves
from ..core.pieces import around_faces
from ..core.stepping import mapped
from ..core.triangles import areas_of
from . import mesh_arrays, packing, selection
from .comparison import MEASURES, Comparison, Row
from .figure import Look
from .inspecting import inspected
from .joined_meshes import JoinedMeshes
from .shown_shape import shown_vertices
from .unwrapping import unwrap_targets

_NAME = "QH Unwrap Comparison"
CURRENT, OURS = "Current UVs", "QH Unwrap"
_GREY, _BLUE = Look("#8a8a8a", 2.4, (2, 3)), Look("#2460a7", 3.2)
_RED, _GREEN, _GOLD = Look("#c0392b", 2.2, (4, 4)), Look("#3a8f4a", 2.4, (11, 4)), Look("#d08a00", 2.2, (11, 4, 3, 4))
_NATIVE = {  # by the names that Blender's own menu has
    "Angle Based": ("ANGLE_BASED", _GOLD),
    "Conformal": ("CONFORMAL", _RED),
    "Minimum Stretch": ("MINIMUM_STRETCH", _GREEN),  # from 4.3 on
}
_OF_FIGURE_11 = dict(zip(FIGURE_11, (_RED, _GREEN, _BLUE, _GREY), strict=True))


@dataclass(frozen=True)
class Method:
    """A way to unwrap, and how its curve looks; without a function, the UVs are measured as they are."""

    name: str
    look: Look
    unwrap: object = None  # called as (objects, context); may raise an `UnwrapError`


def compare(targets, methods, context, options):
    """Try the methods on the targets' faces.  A generator: yields the share that is done, returns the `Comparison`.

    Nothing of the originals changes: not the UVs, nor modes and selections, nor what the latest run said.
    """
    copies = _Copies(targets, context, options)
    rows = []
    try:
        for k, method in enumerate(methods):
            yield k / len(methods)
            steps = copies.row(method)
            rows.append((yield from mapped(lambda share, k=k: (k + share) / len(methods), steps)))
    finally:
        copies.remove()
    triangles = max((len(row.curves.angle) for row in rows if row.curves), default=0)
    names = [target.obj.name for target in targets]
    who = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    return Comparison(f"{who}, {triangles} triangles", tuple(rows))


def blenders(settings, options, *, current=True, ours=True):
    """Blender's own methods, as far as its version has them, the current UVs, and ours with these settings."""
    methods = [Method(CURRENT, _GREY)] if current else []
    offered = bpy.ops.uv.unwrap.get_rna_type().properties["method"].enum_items
    for name, (identifier, look) in _NATIVE.items():
        if identifier in offered:
            methods.append(Method(name, look, _natively(identifier, options)))
    return [*methods, Method(OURS, _BLUE, _by_us(settings, options) if ours else None)]


def of_figure_11(options):
    """The maps of figure 11 of the paper."""
    return [Method(name, _OF_FIGURE_11[name], _by_us(settings, options)) for name, settings in FIGURE_11.items()]


def _natively(identifier, options):
    """By Blender's own operator, which is timed alone: it works in Edit Mode, on what is selected."""

    def unwrap(objects, context):
        yield 0.0
        active = objects[0]
        with context.temp_override(
            scene=context.scene,
            view_layer=context.view_layer,
            active_object=active,
            object=active,
            edit_object=active,
            area=None,  # an editor would have the selection of UVs count
            region=None,
        ):
            packing.forget_escape()
            bpy.ops.object.mode_set(mode='EDIT')
            bpy.ops.mesh.reveal()
            bpy.ops.mesh.select_all(action='SELECT')
            begun = perf_counter()
            bpy.ops.uv.unwrap(
                method=identifier,
                fill_holes=True,
                correct_aspect=options.correct_aspect,
                use_subsurf_data=options.use_subsurf_data,
                margin_method=options.margin_method,
                margin=options.margin,
                **_stretched(options) if identifier == 'MINIMUM_STRETCH' else {},
            )
            seconds = perf_counter() - begun
            bpy.ops.object.mode_set(mode='OBJECT')
        return seconds

    return unwrap


def _stretched(options):
    """What Minimum Stretch has beside the others' options, as Blender has it at first; but the weights are ours."""
    names = ("use_weights", "weight_group", "weight_factor")
    return dict(no_flip=False, iterations=10) | {name: getattr(options, name) for name in names}


def _by_us(settings, options):
    options = dataclasses.replace(options, cut='NEVER', placement='ORIGINAL')  # all methods have the same seams
    uses_uvs = settings.boundary == 'KEEP' or settings.initial == 'CURRENT'

    def unwrap(objects, context):
        if not uses_uvs and not any(mesh_arrays.read(obj).has_pins for obj in objects):
            _forget_uvs(objects)  # new islands are packed, as those of Blender's methods are
        targets = [selection.Target(obj, selection.visible_faces(obj.data)) for obj in objects]
        seconds, outcomes = yield from _timed(unwrap_targets(targets, settings, options, context))
        errors = [outcome.error for outcome in outcomes if outcome.error]
        if errors:
            raise UnwrapError(errors[0] if len(outcomes) == 1 else f"{len(errors)} of {len(outcomes)} islands failed")
        return seconds

    return unwrap


def _forget_uvs(objects):
    for obj in objects:
        for layer in reversed(obj.data.uv_layers):
            obj.data.uv_layers.remove(layer)


def _timed(steps):
    """The same steps; returns the seconds that they took, without what was done between them, and their result."""
    seconds = 0.0
    while True:
        begun = perf_counter()
        try:
            share = next(steps)
        except StopIteration as stop:
            return seconds + perf_counter() - begun, stop.value
        seconds += perf_counter() - begun
        yield share


class _Copies:
    """The faces of targets, as meshes of their own, and what methods make of them."""

    def __init__(self, targets, context, options):
        self._context, self._options = context, options
        self._originals = [target.obj for target in targets]
        self._meshes = [_extracted(*target[:2]) for target in targets]

    def remove(self):
        bpy.data.batch_remove(self._meshes)

    def row(self, method):
        """What the method makes of them.  A generator: yields the share that is done, returns the `Row`."""
        scene = bpy.data.scenes.new(_NAME)
        made = [scene]
        try:
            objects = [self._placed(k, scene, made) for k in range(len(self._meshes))]
            scene.view_layers[0].update()
            its = SimpleNamespace(
                scene=scene, view_layer=scene.view_layers[0], temp_override=self._context.temp_override
            )
            seconds = None
            if method.unwrap is not None:
                try:
                    seconds = yield from mapped(lambda share: 0.8 * share, method.unwrap(objects, its))
                except (UnwrapError, RuntimeError) as error:
                    return Row(method.name, method.look, None, str(error).strip().removeprefix("Error: "))
            return (yield from mapped(lambda share: 0.8 + 0.2 * share, self._measured(method, seconds, objects)))
        finally:
            bpy.data.batch_remove(made)

    def _placed(self, k, scene, made):
        """A copy of an object with a copy of its faces, selected in the scene."""
        mesh = self._meshes[k].copy()
        obj = self._originals[k].copy()
        made += mesh, obj
        place = self._originals[k].matrix_world.copy()
        obj.animation_data_clear()
        obj.constraints.clear()
        obj.parent, obj.data = None, mesh
        obj.matrix_world = place
        for group in self._originals[k].vertex_groups:  # whose names are the mesh's
            if group.name not in obj.vertex_groups:
                obj.vertex_groups.new(name=group.name)
        obj.hide_viewport = obj.hide_select = False
        scene.collection.objects.link(obj)
        view_layer = scene.view_layers[0]
        obj.select_set(True, view_layer=view_layer)
        view_layer.objects.active = obj
        return obj

    def _measured(self, method, seconds, objects):
        targets = [selection.Target(obj, selection.visible_faces(obj.data)) for obj in objects]
        joined = JoinedMeshes(targets, [mesh_arrays.read(obj, self._options) for obj in objects])
        unset = sum(len(faces) for _, _, faces in joined.left_out())
        if not joined.selected.any():
            return Row(method.name, method.look, seconds, "there are no UVs")
        islands, found = yield from inspected(joined)
        area = np.bincount(islands.island, areas_of(joined.points[islands.corners]), islands.count)
        share = area / (area.sum() or 1.0)
        its = found.measured.islands
        means = [np.array([getattr(each, name) for each in its]) @ share for name in MEASURES]
        face = around_faces(joined.face_start, len(joined.corner_vertex))[0][islands.corners[:, 0]]
        return Row(
            method.name,
            method.look,
            seconds,
            "",
            *map(float, means),
            flips=unset + sum(each.flips + each.collapsed for each in its),
            overlaps=len(np.unique(face[found.covered])),
            curves=curves(its),
        )


def _extracted(obj, faces):
    """The chosen faces of an object, (f,) bool, as a mesh of their own, in the shape that the object shows."""
    mesh = bpy.data.meshes.new(_NAME)
    bm = bmesh.from_edit_mesh(obj.data) if obj.mode == 'EDIT' else bmesh.new()
    if obj.mode != 'EDIT':
        bm.from_mesh(obj.data)
    bm.to_mesh(mesh)
    for slot in obj.material_slots:
        mesh.materials.append(slot.material)
    mesh.vertices.foreach_set("co", shown_vertices(obj, mesh, False).ravel())
    if obj.mode != 'EDIT':
        bm.free()
    if not faces.all():
        rest = bmesh.new()
        rest.from_mesh(mesh)
        rest.faces.ensure_lookup_table()
        bmesh.ops.delete(rest, geom=[rest.faces[k] for k in np.flatnonzero(~faces).tolist()], context='FACES')
        rest.to_mesh(mesh)
        rest.free()
    return mesh
