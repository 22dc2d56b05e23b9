# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects and faces are meant, in every editor and Blender version."""

from typing import NamedTuple

import bmesh
import bpy
import numpy as np


class Target(NamedTuple):
    obj: bpy.types.Object
    faces: np.ndarray  # (f,) bool, the faces to unwrap
    stays_attached: bool = False  # to the other faces of its islands


def mesh_objects(context):
    """The meshes being edited, or in Object Mode the selected ones; one object for each mesh, none that is linked."""
    if context.mode == 'EDIT_MESH':
        return list(context.objects_in_mode_unique_data)
    if context.mode == 'OBJECT':
        return distinct_meshes(context.selected_objects)
    return []


def shown_meshes(context):
    """The same to look at: every object of a mesh, linked ones too."""
    objects = context.objects_in_mode if context.mode == 'EDIT_MESH' else context.selected_objects
    return [obj for obj in objects if obj.type == 'MESH']


def distinct_meshes(objects):
    """The first object of each mesh that can be changed."""
    found = {}
    for obj in objects:
        if obj.type == 'MESH' and obj.data.is_editable:
            found.setdefault(obj.data, obj)
    return list(found.values())


def targets(context):
    """The faces that the person selected, of each object that has any."""
    attached = context.mode == 'EDIT_MESH' and in_uv_editor(context)
    found = [Target(obj, _selected(obj, context), attached) for obj in mesh_objects(context)]
    return [target for target in found if target.faces.any()]


def nothing_selected(context):
    """Why there is nothing to unwrap, and what to do."""
    if context.mode == 'OBJECT':
        return _nothing_visible(mesh_objects(context))
    by_uvs = not context.scene.tool_settings.use_uv_select_sync
    if in_uv_editor(context) and by_uvs:
        return "No faces are selected: press A in the UV Editor, or turn on UV Sync Selection"
    return "No faces are selected"


def _nothing_visible(objects):
    """The same of meshes without visible faces."""
    with_faces = [obj for obj in objects if obj.data.polygons]
    if not with_faces:
        return f"{_named(objects)} no faces: select a mesh that has some"
    return f"{_named(with_faces)} no visible faces: press Alt H in Edit Mode to show them"


def _named(objects):
    names = objects[0].name if len(objects) == 1 else f"{objects[0].name} and {len(objects) - 1} more"
    return f"{names} {'has' if len(objects) == 1 else 'have'}"


def visible_faces(mesh):
    hidden = np.zeros(len(mesh.polygons), dtype=bool)
    mesh.polygons.foreach_get("hide", hidden)
    return ~hidden


def without_group(objects, name):
    """Why none of the objects has the vertex group, and the cure; nothing if one has it."""
    if any(obj.vertex_groups.get(name) for obj in objects):
        return ""
    return f"There is no vertex group {name}: paint one, choose another, or turn the importance weights off"


def all_faces(mesh):
    return np.ones(len(mesh.polygons), dtype=bool)


def _selected(obj, context):
    if obj.mode != 'EDIT':
        return visible_faces(obj.data)
    bm = bmesh.from_edit_mesh(obj.data)
    rule = _uv_rule(bm, context)
    if rule is None:
        return np.array([face.select and not face.hide for face in bm.faces], dtype=bool)
    return np.array([rule(face) and not face.hide for face in bm.faces], dtype=bool)


def in_uv_editor(context):
    return isinstance(context.space_data, bpy.types.SpaceImageEditor)


def _uv_rule(bm, context):
    """Whether a face counts as selected, by its UVs; None where it is the mesh's own selection that counts."""
    uv_layer = bm.loops.layers.uv.active
    if uv_layer is None or not in_uv_editor(context):
        return None
    sync = context.scene.tool_settings.use_uv_select_sync
    if bpy.app.version < (5, 0, 0):
        return None if sync else lambda face: face.select and all(loop[uv_layer].select for loop in face.loops)
    if not sync:
        return lambda face: face.select and face.uv_select
    return (lambda face: face.uv_select) if bm.uv_select_sync_valid else None
