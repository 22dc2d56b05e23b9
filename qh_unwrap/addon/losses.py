# SPDX-License-Identifier: GPL-3.0-or-later
"""What the open file has that the format of the output cannot hold."""

from typing import NamedTuple

import bpy

from .outcome import listed

ONE_MAP = (".obj", ".ply")  # what holds a single UV map, which is the active one


class Loss(NamedTuple):
    """What is not written, by its kind."""

    kind: str
    names: list
    message: str


def of(path):
    """What a file at this path will not hold, in one `Loss` for each kind."""
    suffix = path.suffix.lower()
    meshes = _meshes()
    found = [_maps(path, meshes)] if suffix in ONE_MAP else []
    for kind, find in _KINDS.items():
        if kind in _LACKING.get(suffix, ()):
            names = sorted(set(find(meshes)))
            found.append(_without(path, kind, names))
    found.append(_without(path, "hidden objects", _hidden(suffix)))
    found += [_triangles(path, meshes)] if suffix in (".glb", ".gltf") else []
    return [loss for loss in found if loss.names]


def _without(path, kind, names):
    return Loss(kind, names, f"{path.name} holds no {kind}: {listed(names)} {_verb(names)} not written")


def _verb(names):
    return "is" if len(names) == 1 else "are"


def _objects():
    return bpy.context.scene.objects


def _meshes():
    return list({obj.data: None for obj in _objects() if obj.type == 'MESH'})


def _maps(path, meshes):
    active, others = {}, {}
    for mesh in meshes:
        for layer in mesh.uv_layers:
            (active if layer == mesh.uv_layers.active else others)[layer.name] = None
    written, lost = list(active), list(others)
    if set(written) & set(lost):
        what = "of each mesh the active one is written, others are not"
    else:
        what = f"{listed(written)} {_verb(written)} written, {listed(lost)} {_verb(lost)} not"
    return Loss("UV maps", lost, f"{path.name} holds one UV map: {what}")


_HIDDEN = {  # what exporters leave out
    ".obj": lambda obj: not obj.visible_get(),
    ".ply": lambda obj: not obj.visible_get(),
    ".fbx": lambda obj: obj.name not in bpy.context.view_layer.objects,
    **dict.fromkeys(
        (".usd", ".usda", ".usdc"), lambda obj: obj.hide_render or obj.name not in bpy.context.view_layer.objects
    ),
}


def _hidden(suffix):
    is_hidden = _HIDDEN.get(suffix, lambda _: False)
    return [obj.name for obj in _objects() if obj.type == 'MESH' and is_hidden(obj)]


def _triangles(path, meshes):
    names = [mesh.name for mesh in meshes if len(mesh.loops) > 3 * len(mesh.polygons)]
    return Loss("polygons", names, f"{path.name} holds triangles: faces with more corners are cut in {listed(names)}")


def _of_type(kind):
    return lambda _: [obj.name for obj in _objects() if obj.type == kind]


def _animation(_):
    return [each.name for each in (*bpy.data.actions, *bpy.data.cache_files)]


def _shape_keys(meshes):
    return [key.name for mesh in meshes if mesh.shape_keys for key in mesh.shape_keys.key_blocks[1:]]


def _materials(meshes):
    return [material.name for mesh in meshes for material in mesh.materials if material]


def _weights(meshes):
    return [group.name for obj in _objects() if obj.type == 'MESH' for group in obj.vertex_groups]


def _properties(meshes):
    owners = [*_objects(), *meshes, *(material for mesh in meshes for material in mesh.materials if material)]
    return [name for owner in owners for name in _named(owner) if name not in _OF_BLENDER]


def _named(owner):
    return list(owner.keys())


_OF_BLENDER = ("cycles",)


def _colors(meshes):
    return [attribute.name for mesh in meshes for attribute in mesh.color_attributes]


def _attributes(meshes):
    return [
        attribute.name
        for mesh in meshes
        for attribute in mesh.attributes
        if not (attribute.is_internal or attribute.is_required)
        and attribute.name not in _KNOWN
        and attribute.name not in mesh.uv_layers
        and attribute.name not in mesh.color_attributes
    ]


_KNOWN = ("material_index", "sharp_face", "sharp_edge", "custom_normal", "uv_seam", "crease_edge", "freestyle_edge")


def _modifiers(_):
    return [each.name for obj in _objects() for each in obj.modifiers if each.type != 'ARMATURE' and each.show_viewport]


_KINDS = {
    "materials": _materials,
    "animation": _animation,
    "armature": _of_type('ARMATURE'),
    "shape keys": _shape_keys,
    "vertex groups": _weights,
    "cameras": _of_type('CAMERA'),
    "lights": _of_type('LIGHT'),
    "custom properties": _properties,
    "colors": _colors,
    "attributes": _attributes,
    "modifiers": _modifiers,
}
_ONLY_MESHES = ("animation", "armature", "shape keys", "cameras", "lights", "custom properties")
_LACKING = {
    ".obj": (*_ONLY_MESHES, "attributes"),
    ".ply": (*_ONLY_MESHES, "materials", "vertex groups"),
    ".glb": ("modifiers",),
    ".gltf": ("modifiers",),
    ".fbx": ("attributes",),
}
