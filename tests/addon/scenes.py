# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes for the tests, and what to compare of them."""

import bpy  # isort: skip  (the wheel knows bmesh only after this)
import bmesh
import numpy as np

FIVE = bpy.app.version >= (5, 0, 0)


def add_grid(size=4, name="Grid", uv=True, location=(0, 0, 0)):
    """A bent grid of size x size quads with its default UVs; active and selected beside what is selected already."""
    others = list(bpy.context.selected_objects)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=size, y_subdivisions=size, location=location, calc_uvs=uv)
    obj = bpy.context.object
    obj.name = name
    for vertex in obj.data.vertices:
        vertex.co.z = 0.3 * np.sin(2 * vertex.co.x) * vertex.co.y
    for other in others:
        other.select_set(True)
    return obj


def add_cube(name="Cube"):
    """Closed: cannot be unwrapped."""
    others = list(bpy.context.selected_objects)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = name
    for other in others:
        other.select_set(True)
    return bpy.context.object


def mesh_object(name, points, faces):
    """A mesh of these points and faces as the only selected object."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    for other in bpy.context.selected_objects:
        other.select_set(False)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    return obj


def edit_mode(select=None):
    """Enter Edit Mode in face mode; `select` (obj, face index) -> bool chooses the faces."""
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.context.tool_settings.mesh_select_mode = (False, False, True)
    bpy.ops.mesh.select_all(action='DESELECT')
    for obj in bpy.context.objects_in_mode:
        bm = bmesh.from_edit_mesh(obj.data)
        for face in bm.faces:
            face.select_set(select is None or bool(select(obj, face.index)))
        bmesh.update_edit_mesh(obj.data)


def select_uvs(obj, chosen, sticky=False):
    """Select in the UV Editor the corners of these faces, and no others; `sticky` adds those at the same vertices."""
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    inside = {vertex for face in bm.faces if face.index in chosen for vertex in face.verts}
    for face in bm.faces:
        if FIVE:
            face.uv_select = face.index in chosen
        for loop in face.loops:
            edge = face.index in chosen or (sticky and {loop.vert, loop.link_loop_next.vert} <= inside)
            vert = face.index in chosen or (sticky and loop.vert in inside)
            if FIVE:
                loop.uv_select_vert, loop.uv_select_edge = vert, edge
            else:
                loop[layer].select, loop[layer].select_edge = vert, edge
    if FIVE:
        bm.uv_select_sync_valid = True
    bmesh.update_edit_mesh(obj.data)


def snapshot(obj):
    """Everything that the mesh holds, as bytes by name."""
    mesh = obj.data
    if obj.mode == 'EDIT':
        bm = bmesh.from_edit_mesh(mesh)
        copy = bpy.data.meshes.new("snapshot")
        bm.to_mesh(copy)
        found = _arrays(copy)
        bpy.data.meshes.remove(copy)
        found["active"] = bm.faces.active and bm.faces.active.index
        found["history"] = [(type(element).__name__, element.index) for element in bm.select_history]
        found["shape layers"] = [
            np.array([vertex[layer] for vertex in bm.verts]).tobytes() for layer in bm.verts.layers.shape.values()
        ]
    else:
        found = _arrays(mesh)
        keys = mesh.shape_keys.key_blocks if mesh.shape_keys else ()
        found["shape keys"] = [np.array([point.co for point in key.data]).tobytes() for key in keys]
    layer = mesh.uv_layers.active
    return found | {"mode": obj.mode, "selected": obj.select_get(), "active UV map": layer and layer.name}


_FIELDS = {
    'FLOAT': ("value", np.float32, 1),
    'INT': ("value", np.int32, 1),
    'BOOLEAN': ("value", bool, 1),
    'FLOAT2': ("vector", np.float32, 2),
    'FLOAT_VECTOR': ("vector", np.float32, 3),
    'INT32_2D': ("value", np.int32, 2),
    'INT16_2D': ("value", np.int16, 2),
    'INT8': ("value", np.int8, 1),
    'FLOAT_COLOR': ("color", np.float32, 4),
    'BYTE_COLOR': ("color", np.float32, 4),
}


def _arrays(mesh):
    found = {}
    for attribute in mesh.attributes:
        name, kind, width = _FIELDS[attribute.data_type]
        values = np.empty(len(attribute.data) * width, dtype=kind)
        attribute.data.foreach_get(name, values)
        found[attribute.name] = values.tobytes()
    return found


def changes(before, after):
    """The names of what differs."""
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


def uvs(obj, name=None):
    """UVs (c, 2) of the active or the named map, in any mode."""
    mesh = obj.data
    layer = name or mesh.uv_layers.active.name
    if obj.mode == 'EDIT':
        bm = bmesh.from_edit_mesh(mesh)
        uv_layer = bm.loops.layers.uv[layer]
        return np.array([loop[uv_layer].uv[:] for face in bm.faces for loop in face.loops], dtype=np.float32)
    values = np.empty(2 * len(mesh.loops), dtype=np.float32)
    mesh.uv_layers[layer].uv.foreach_get("vector", values)
    return values.reshape(-1, 2)
