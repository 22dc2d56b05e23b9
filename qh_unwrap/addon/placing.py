# SPDX-License-Identifier: GPL-3.0-or-later
"""Putting unwrapped islands where they belong: back in place, packed, or each into the unit square."""

import bpy
import numpy as np

from ..core import UnwrapError


def says_where(corners):
    """Whether these UVs, given as triangles (t, 3, 2), say where an island belongs.

    They do if they have some area and are no pile of faces, such as those of a new map, where each fills the square.
    """
    if not np.isfinite(corners).all():
        return False
    area = np.abs(_signed_areas(corners)).sum()
    return 1e-12 < area <= 1.01 * np.prod(np.ptp(corners.reshape(-1, 2), axis=0))


def in_place(uv, triangles, old):
    """Move, turn and scale `uv` (n, 2) onto `old`, the triangles' old UVs (t, 3, 2).

    Keeps centre and area, and turns it as fits best in the sense of least squares.
    """
    new = uv[triangles]
    area, old_area = (np.abs(_signed_areas(each)).sum() for each in (new, old))
    centre, old_centre = _centre(new), _centre(old)
    z, w = ((each.reshape(-1, 2) - middle) @ (1, 1j) for each, middle in ((new, centre), (old, old_centre)))
    turn = np.vdot(z, w)
    turn = turn / abs(turn) if abs(turn) > 1e-9 * np.linalg.norm(z) * np.linalg.norm(w) else 1.0
    moved = (uv - centre) @ (1, 1j) * turn * np.sqrt(old_area / area)
    return np.column_stack([moved.real, moved.imag]) + old_centre


def in_unit_square(uv):
    """Scale `uv` (n, 2) until its longer side is 1, in the middle of the 0 to 1 square."""
    low, size = uv.min(axis=0), np.ptp(uv, axis=0)
    scale = 1 / size.max() if size.max() > 0 else 1.0
    return (uv - low) * scale + (1 - size * scale) / 2


def pack(islands, margin, context):
    """Lay islands, given as (vertices, triangles, uv), out beside one another in the unit square by Blender's packer.

    They get the same texel density.  Blender packs what is selected in Edit Mode, so this happens on a mesh and in a
    scene of its own, where no one's selection is disturbed.  Raises `UnwrapError` if Blender does not.
    """
    mesh, corner_vertices = _soup(islands)
    scene = bpy.data.scenes.new("QH Unwrap")
    try:
        obj = bpy.data.objects.new(mesh.name, mesh)
        scene.collection.objects.link(obj)
        view_layer = scene.view_layers[0]
        view_layer.objects.active = obj
        scene.tool_settings.use_uv_select_sync = True
        with context.temp_override(scene=scene, view_layer=view_layer, active_object=obj, object=obj, edit_object=obj):
            bpy.ops.object.mode_set(mode='EDIT')
            bpy.ops.mesh.select_all(action='SELECT')
            bpy.ops.uv.average_islands_scale()
            done = bpy.ops.uv.pack_islands(
                udim_source='CLOSEST_UDIM',
                rotate=True,
                rotate_method='CARDINAL',
                scale=True,
                merge_overlap=False,
                margin_method='SCALED',
                margin=margin,
                pin=False,
                shape_method='CONVEX',
            )
            bpy.ops.object.mode_set(mode='OBJECT')
        if done != {'FINISHED'}:
            raise UnwrapError("Blender could not pack the islands: choose the placement Unit Square")
        corners = np.empty(2 * len(mesh.loops), dtype=np.float32)
        mesh.uv_layers[0].uv.foreach_get("vector", corners)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.meshes.remove(mesh)
    packed = np.empty((sum(len(uv) for _, _, uv in islands), 2))
    packed[corner_vertices] = corners.reshape(-1, 2)
    return np.split(packed, np.cumsum([len(uv) for _, _, uv in islands])[:-1])


def _soup(islands):
    """One mesh of all the islands' triangles, and the vertex of each of its corners."""
    first = np.cumsum([0] + [len(vertices) for vertices, _, _ in islands])
    vertices = np.concatenate([vertices for vertices, _, _ in islands])
    uv = np.concatenate([uv for _, _, uv in islands])
    triangles = np.concatenate([triangles + start for (_, triangles, _), start in zip(islands, first, strict=False)])
    mesh = bpy.data.meshes.new("QH Unwrap")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    layer = mesh.uv_layers.new(name="UVMap", do_init=False)
    layer.uv.foreach_set("vector", uv[triangles].astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    return mesh, triangles.ravel()


def _signed_areas(corners):
    a, b, c = corners.transpose(1, 0, 2)
    (x1, y1), (x2, y2) = (b - a).T, (c - a).T
    return (x1 * y2 - x2 * y1) / 2


def _centre(corners):
    weight = np.abs(_signed_areas(corners))
    return weight @ corners.mean(axis=1) / weight.sum()
