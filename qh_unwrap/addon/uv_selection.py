# SPDX-License-Identifier: GPL-3.0-or-later
"""Which UVs are selected, in every editor, selection mode and Blender version."""

from typing import NamedTuple

import bmesh
import bpy
import numpy as np

from .selection import in_uv_editor, visible_faces


class UVSelection(NamedTuple):
    """What is selected of a mesh in its UV map; nothing of hidden faces is."""

    faces: np.ndarray  # (f,) bool
    corners: np.ndarray  # (c,) bool, UVs
    sides: np.ndarray  # (c,) bool, edges: from each corner to the next around its face


def read(obj, context):
    """What is selected of an object's mesh; in Object Mode all that is visible."""
    if obj.mode != 'EDIT':
        return of_faces(obj, visible_faces(obj.data))
    bm = bmesh.from_edit_mesh(obj.data)
    face, corner, side = _rules(bm, context)
    faces = [not each.hide and face(each) for each in bm.faces]
    loops = [(loop, each.hide) for each in bm.faces for loop in each.loops]
    corners = [not hidden and corner(loop) for loop, hidden in loops]
    sides = [not hidden and side(loop) for loop, hidden in loops]
    return UVSelection(*(np.array(each, dtype=bool) for each in (faces, corners, sides)))


def of_faces(obj, faces):
    """The same as if these faces (f,) bool were selected; not in Edit Mode."""
    sizes = np.zeros(len(faces), dtype=np.int32)
    obj.data.polygons.foreach_get("loop_total", sizes)
    corners = np.repeat(faces, sizes)
    return UVSelection(faces, corners, corners.copy())


def _rules(bm, context):
    """Whether a face, the UV of a loop and the edge from it to the next count as selected, a function each."""
    uv_layer = bm.loops.layers.uv.active
    settings = context.scene.tool_settings
    if uv_layer is None or not in_uv_editor(context):
        return _in_mesh()
    if bpy.app.version < (5, 0, 0):
        if settings.use_uv_select_sync:
            return _in_mesh()

        def corner(loop):
            return loop.face.select and loop[uv_layer].select

        def edge(loop):
            return loop.face.select and loop[uv_layer].select_edge
    else:
        if settings.use_uv_select_sync and not bm.uv_select_sync_valid:
            return _in_mesh()

        def corner(loop):
            return loop.face.select and loop.uv_select_vert

        def edge(loop):
            return loop.face.select and loop.uv_select_edge

        if settings.use_uv_select_sync:
            return (lambda face: face.uv_select), (lambda loop: loop.uv_select_vert), (lambda loop: loop.uv_select_edge)
    if settings.uv_select_mode == 'VERTEX':  # where nothing says that edges follow

        def edge(loop):
            return corner(loop) and corner(loop.link_loop_next)

    return (lambda face: face.select and all(map(corner, face.loops))), corner, edge


def _in_mesh():
    """The rules where the mesh's own selection counts."""
    return (lambda face: face.select), (lambda loop: loop.vert.select), (lambda loop: loop.edge.select)
