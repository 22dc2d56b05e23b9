# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that the open file holds but UVs, by names, to find out what differs between two files."""

import bpy
import numpy as np

_SKIPPED_TYPES = ("Screen", "WindowManager", "Brush", "Palette", "PaintCurve", "Library", "CacheFile")
_SKIPPED = {  # what follows from something else, leads round in circles, or tells how the file was read
    *("rna_type", "session_uid", "is_evaluated", "original", "users", "preview", "asset_data", "override_library"),
    *("library", "library_weak_reference", "tag", "id_data", "name_full", "is_runtime_data", "is_embedded_data"),
    *("is_library_indirect", "is_missing", "is_updated", "is_updated_data", "is_valid", "is_dirty", "has_data"),
    *("users_collection", "active_layer_collection", "collection_objects", "all_objects", "children_recursive"),
    *("child", "children", "tool_settings", "bound_box", "pixels", "bindcode", "filepath", "filepath_raw"),
    *("bl_label", "bl_description", "bl_icon", "bl_idname", "type_info", "depsgraph"),
}
_VALUES = {"FLOAT_VECTOR": "vector", "FLOAT2": "vector", "FLOAT_COLOR": "color", "BYTE_COLOR": "color"}
_OF_NORMALS = ("position", "custom_normal", "sharp_edge", "sharp_face")  # of which the corners tell all


def everything():
    """{path: value} over all data-blocks in the open file."""
    found = {}
    for prop in bpy.data.bl_rna.properties:
        if prop.type == 'COLLECTION' and prop.identifier != "all_ids":
            for block in getattr(bpy.data, prop.identifier):
                if type(block).__name__ not in _SKIPPED_TYPES:
                    _block(block, f"{prop.identifier}[{block.name}]", found)
    return found


def differences(before, after, tolerance=1e-3):
    """The paths of what differs; of what is only in one of them the topmost path."""
    found = []
    for path in sorted(before.keys() | after.keys()):
        in_both = path in before and path in after
        if in_both and _equal(before[path], after[path], tolerance):
            continue
        if found and not in_both and path.startswith((f"{found[-1]}.", f"{found[-1]}[")):
            continue
        found.append(path)
    return found


def f_curves(action):
    """The F-curves of an action, with or without slots."""
    if not hasattr(action, "layers"):
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def _block(block, path, found):
    if isinstance(block, bpy.types.Mesh):
        _mesh(block, path, found)
    elif isinstance(block, bpy.types.Action):
        _action(block, path, found)
    else:
        _struct(block, path, found, 0)


def _struct(struct, path, found, depth):
    found[path] = type(struct).__name__
    if depth > 6:
        return
    for prop in struct.bl_rna.properties:
        name, where = prop.identifier, f"{path}.{prop.identifier}"
        if name in _SKIPPED or (name == "parent" and isinstance(struct, (bpy.types.PoseBone, bpy.types.Bone))):
            continue
        try:
            value = getattr(struct, name)
        except (AttributeError, RuntimeError, ValueError):
            continue
        if prop.type == 'POINTER':
            _pointer(value, where, found, depth)
        elif prop.type == 'COLLECTION':
            for number, each in enumerate(value):
                _pointer(each, f"{where}[{getattr(each, 'name', number)}]", found, depth)
        else:
            found[where] = _plain(value)
    _custom(struct, path, found)


def _pointer(value, where, found, depth):
    if value is None:
        found[where] = None
    elif isinstance(value, bpy.types.ID) and not value.is_embedded_data:
        found[where] = f"{type(value).__name__} {value.name}"
    else:
        _struct(value, where, found, depth + 1)


def _custom(struct, path, found):
    try:
        keys = list(struct.keys())
    except TypeError:  # the type has none
        return
    for key in keys:
        if key != "cycles":
            value = struct[key]
            found[f"{path}[{key!r}]"] = _plain(value.to_dict() if hasattr(value, "to_dict") else value)


def _plain(value):
    if isinstance(value, (str, bool, int, bytes, type(None))):
        return value
    if isinstance(value, float):
        return np.float32(value)
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, set):
        return sorted(value)
    try:
        return np.array([list(row) if hasattr(row, "__len__") else row for row in value], dtype=float)
    except (TypeError, ValueError):
        return str(value)


def _mesh(mesh, path, found):
    """What each corner of each face has: exporters split vertices where UVs are cut."""
    corner = np.array([loop.vertex_index for loop in mesh.loops], dtype=int)
    edge = [loop.edge_index for loop in mesh.loops]
    points = np.array([vertex.co for vertex in mesh.vertices]).reshape(-1, 3)
    loose = np.setdiff1d(np.arange(len(points)), corner)
    found |= {
        path: "Mesh",
        f"{path}.faces": [len(polygon.vertices) for polygon in mesh.polygons],
        f"{path}.corners": points[corner],
        f"{path}.loose vertices": points[loose],
        f"{path}.loose edges": sum(each.is_loose for each in mesh.edges),
        f"{path}.normals": np.array([each.vector for each in mesh.corner_normals]),
        f"{path}.materials": [material and material.name for material in mesh.materials],
        f"{path}.material of faces": [polygon.material_index for polygon in mesh.polygons],
        f"{path}.uv_layers": [layer.name for layer in mesh.uv_layers],
        f"{path}.active UV map": mesh.uv_layers.active and mesh.uv_layers.active.name,
        f"{path}.active color": mesh.color_attributes.active_color_name,
    }
    for attribute in mesh.attributes:
        name = attribute.name
        if name in mesh.uv_layers or name.startswith(".") or name in _OF_NORMALS:
            continue
        field = _VALUES.get(attribute.data_type, "value")
        values = np.array([np.ravel(getattr(each, field)) for each in attribute.data])
        rows = {'POINT': corner, 'EDGE': edge}.get(attribute.domain, slice(None))
        found[f"{path}.attributes[{name}]"] = values[rows]
    for key in mesh.shape_keys.key_blocks if mesh.shape_keys else ():
        found[f"{path}.shape_keys[{key.name}]"] = np.array([point.co for point in key.data])[corner]
    weights = {}
    for number, vertex in enumerate(corner):
        for group in mesh.vertices[vertex].groups:
            weights.setdefault(group.group, np.zeros(len(corner)))[number] = group.weight
    found |= {f"{path}.weights[{group}]": values for group, values in weights.items()}
    _custom(mesh, path, found)


def _action(action, path, found):
    found[path] = "Action"
    for curve in f_curves(action):
        where = f"{path}.{curve.data_path}[{curve.array_index}]"
        found |= {
            where: "F-curve",
            f"{where}.keys": np.array([point.co for point in curve.keyframe_points]),
            f"{where}.interpolation": sorted({point.interpolation for point in curve.keyframe_points}),
            f"{where}.values": np.array([curve.evaluate(frame) for frame in range(40)]),
        }
    _custom(action, path, found)


def _equal(one, other, tolerance):
    kinds = np.ndarray, np.floating
    if isinstance(one, kinds) and isinstance(other, kinds):
        return np.shape(one) == np.shape(other) and np.allclose(one, other, rtol=tolerance, atol=tolerance)
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_equal(one[key], other[key], tolerance) for key in one)
    return type(one) is type(other) and one == other
