# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting faces of any objects, so that the 3D View and the UV Editor show them."""

import bmesh
import bpy


def select_faces(faces, context):
    """Select the faces (k,), by their objects, in Edit Mode, and nothing else; objects that are edited stay so."""
    _edit(list(faces), context)
    for obj, indices in faces.items():
        _select(obj, indices.tolist())


def _edit(objects, context):
    """Enter Edit Mode in face mode, with these objects if one is not among those that are edited."""
    present = context.view_layer.objects
    if any(obj.mode != 'EDIT' for obj in objects):
        if context.mode == 'EDIT_MESH':
            bpy.ops.object.mode_set(mode='OBJECT')
        for other in list(present.selected):
            other.select_set(False)
        for obj in objects:
            obj.select_set(True)
        present.active = objects[0]
        bpy.ops.object.mode_set(mode='EDIT')
    present.active = objects[0]
    context.tool_settings.mesh_select_mode = (False, False, True)
    bpy.ops.mesh.select_all(action='DESELECT')


def _select(obj, indices):
    """Select these faces, also for the UV Editor, where UVs have a selection of their own."""
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    uv_layer = bm.loops.layers.uv.active
    faces = [bm.faces[index] for index in indices]
    for face in faces:
        face.hide_set(False)
        face.select_set(True)
        if uv_layer is not None and bpy.app.version < (5, 0, 0):
            for loop in face.loops:
                loop[uv_layer].select = loop[uv_layer].select_edge = True
    bm.faces.active = faces[0]
    if bpy.app.version >= (5, 0, 0):
        bm.uv_select_sync_from_mesh()
    bmesh.update_edit_mesh(obj.data)
