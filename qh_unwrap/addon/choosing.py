# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects and faces of a file are unwrapped, in which UV map, and why others are not."""

from fnmatch import fnmatchcase

import bpy
import numpy as np

from . import selection
from .failures import FileError, UsageError
from .outcome import count, listed, told_of


class Choice:
    """The objects that are unwrapped, and by reason the names of those that are not."""

    def __init__(self, objects, skipped):
        self.objects = objects
        self.skipped = skipped

    def narrowed(self, targets, materials):
        """The targets with those of their faces alone that have one of these materials, if any; without empty ones."""
        if materials:
            present = {_name(slot) for target in targets for slot in target.obj.material_slots} - {None}
            _require(materials, present, "material")
        kept = []
        for target in targets:
            if not target.faces.any():
                self._skip("without visible faces", target.obj)
                continue
            if materials:
                slots = [_fits(_name(slot), materials) for slot in target.obj.material_slots] or [False]
                target = target._replace(faces=target.faces & np.array(slots)[_material_indices(target.obj)])
            if target.faces.any():
                kept.append(target)
            else:
                self._skip("without visible faces of that material", target.obj)
        self.objects = [target.obj for target in kept]
        return kept

    def required(self):
        """The objects; raises `FileError` if there are none."""
        if not self.objects:
            reasons = [told_of(reason, names) for reason, names in self.skipped.items()]
            raise FileError(f"there is nothing to unwrap: {'; '.join(reasons) or 'there is no mesh in the file'}")
        return self.objects

    def _skip(self, reason, obj):
        self.skipped.setdefault(reason, []).append(obj.name)


def choose(objects=None, collections=None):
    """The `Choice` among the meshes of the open file, of each mesh one object, by names or patterns like "Wall*"."""
    scene = bpy.context.scene
    everything = dict.fromkeys([*scene.objects, *bpy.data.objects])  # those of the scene come first, in its order
    candidates = [obj for obj in everything if obj.type == 'MESH']
    if collections:
        present = {each.name: each for each in [scene.collection, *scene.collection.children_recursive]}
        _require(collections, present, "collection")
        inside = {obj for name, each in present.items() if _fits(name, collections) for obj in each.all_objects}
        candidates = [obj for obj in candidates if obj in inside]
    if objects:
        _require(objects, [obj.name for obj in candidates], "mesh object")
        candidates = [obj for obj in candidates if _fits(obj.name, objects)]

    chosen, reasons, shapes = [], {}, _custom_shapes()
    for obj in candidates:
        named = objects and obj.name in objects
        reason = _reason_against(obj, named) or (_SHAPE if obj in shapes and not named else None)
        if reason:
            reasons[obj] = reason
        else:
            chosen.append(obj)
    chosen = selection.distinct_meshes(chosen)
    done = {obj.data for obj in chosen}
    choice = Choice(chosen, {})
    for obj, reason in reasons.items():
        if obj.data not in done:
            choice._skip(reason, obj)
    return choice


def _reason_against(obj, named):
    """Why an object is not unwrapped, None if it is.  One that is hidden can be asked for by its name."""
    scene = bpy.context.scene
    if obj.library or not obj.data.is_editable:
        return "linked from another file"
    if not obj.users_scene:
        return "only instanced" if _is_instanced(obj) else "in no scene"
    if scene not in obj.users_scene:
        return "in another scene"
    if not obj.data.polygons:
        return "without faces"
    return None if named or obj.visible_get() else "hidden (--object with the whole name takes it all the same)"


_SHAPE = "custom shape of a bone (--object with the whole name takes it all the same)"


def _custom_shapes():
    """The objects that some bone is drawn as: parts of a rig, not of a model."""
    armatures = [obj for obj in bpy.data.objects if obj.pose]
    return {bone.custom_shape for armature in armatures for bone in armature.pose.bones} - {None}


def _is_instanced(obj):
    instanced = {each.instance_collection for each in bpy.data.objects if each.instance_type == 'COLLECTION'} - {None}
    return any(obj.name in collection.all_objects for collection in instanced)


def _fits(name, patterns):
    """Whether it is one of the patterns, to the letter or as one."""
    return name is not None and any(name == pattern or fnmatchcase(name, pattern) for pattern in patterns)


def _require(patterns, names, kind):
    unknown = [pattern for pattern in patterns if not any(_fits(name, [pattern]) for name in names)]
    if unknown:
        raise UsageError(f"there is no {kind} {', '.join(unknown)}: the file has {listed(sorted(names)) or 'none'}")


def _name(slot):
    return slot.material.name if slot.material else None


def _material_indices(obj):
    """(f,) the number of the material slot of each face, 0 where there are no slots."""
    indices = np.zeros(len(obj.data.polygons), dtype=np.int32)
    obj.data.polygons.foreach_get("material_index", indices)
    return np.minimum(indices, max(len(obj.material_slots) - 1, 0))


class Maps:
    """The UV maps that are worked on: the active ones, or on every object the one with a name or number.

    A missing one is made; the map that was active before is so again after `restore`.
    """

    def __init__(self, objects, name=None, number=None):
        self._objects = objects if name is not None or number is not None else []
        self._name, self._number = name, number
        self._active = {}  # of each mesh the names of the map that was active, and of the one that is rendered
        self._made = {}
        if name == "":
            raise UsageError("the UV map has no name")
        for obj in self._objects:
            layers = obj.data.uv_layers
            if number is not None and number > len(layers):
                raise UsageError(
                    f"{obj.name} has {count(len(layers), 'UV map')}: --texcoord can be {len(layers)} at most"
                )
            if layers:
                rendered = next((layer.name for layer in layers if layer.active_render), layers[0].name)
                self._active[obj] = (layers.active or layers[0]).name, rendered
                if self._found(layers):
                    layers.active = self._found(layers)

    def _found(self, layers):
        if self._number is None:
            return layers.get(self._name)
        return layers[self._number] if self._number < len(layers) else None

    def make_missing(self, objects):
        """Add the map to those of the objects that have none; it is new, and no copy of another one."""
        for obj in objects if self._objects else ():
            layers = obj.data.uv_layers
            if self._found(layers):
                continue
            wanted = self._name or ("UVMap" if not layers else f"UVMap.{len(layers):03}")
            layer = layers.new(name=wanted, do_init=False)
            if layer is None:
                raise FileError(f"{obj.name} has no room for another UV map: remove one")
            self._made[obj] = layer.name
            if self._name and layer.name != self._name:
                raise UsageError(
                    f"{obj.name} cannot have a UV map {self._name}: the name is too long, or of another attribute"
                )
            layers.active = layers[layer.name]

    def are_made(self, obj):
        """Whether the object's map is one that was missing."""
        return obj in self._made

    def restore(self, done):
        """Make active again what was so, and remove maps that were made for an object of which nothing is done."""
        for obj, name in self._made.items():
            if obj not in done:
                obj.data.uv_layers.remove(obj.data.uv_layers[name])
        for obj, (active, rendered) in self._active.items():
            layers = obj.data.uv_layers
            layers.active = layers[active]
            layers[rendered].active_render = True


def places(outcomes, objects):
    """Of every outcome the names of its mesh, of the map that is worked on, and of the materials of its faces."""
    known = {obj.name: (obj, obj.data.uv_layers.active, _material_indices(obj)) for obj in objects}
    found = []
    for outcome in outcomes:
        obj, layer, indices = known[outcome.obj]
        slots = [_name(slot) for slot in obj.material_slots] or [None]
        names = [slots[number] for number in np.unique(indices[outcome.face_indices])]
        materials = [name for name in dict.fromkeys(names) if name is not None]
        found.append(dict(mesh=obj.data.name, map=layer.name if layer else None, materials=materials))
    return found
