# SPDX-License-Identifier: GPL-3.0-or-later
"""The takes of an FBX file, each of which animates any number of objects: actions on reading, takes again on writing.

Blender's exporter would make a take of each action on each object that could have it, and name it after both.
"""

import re
from contextlib import contextmanager

import bpy

from . import curves

_LONGEST = 63  # bytes, of a name in Blender
_NUMBER = re.compile(r"\.\d{3}$")


def names(filepath):
    """The names of the takes in a file, which are not to be told from those of the actions that the importer makes."""
    from io_scene_fbx import parse_fbx  # comes with Blender

    root, _ = parse_fbx.parse(filepath)
    objects = [each for element in root.elems if element and element.id == b"Objects" for each in element.elems]
    texts = [each.props[1] for each in objects if each.id == b"AnimationStack"]
    return [text.partition(b"\x00\x01")[0].decode("utf-8", "replace") for text in texts]


def sorted_out(takes):
    """{take: {owner: action}} of all actions; empty if they are not to be told apart by their names."""
    owners = _animated()
    found = {take: _actions(take, owners) for take in takes}
    actions = [action for each in found.values() for action in each.values()]
    if len(actions) != len(set(actions)) or set(actions) != set(bpy.data.actions):
        return {}
    return {take: each for take, each in found.items() if each}


@contextmanager
def arranged(scenes):
    """While an exporter bakes a take for each strip of the NLA: one strip for each take of `sorted_out`.

    It stands for all actions of the take, which are given to what they animate as long as the strip is the one that is
    not muted.
    """
    owners = _animated()
    before = {owner: owner.animation_data.action for owner in owners}
    holder = next(iter(obj for obj in bpy.context.scene.objects if obj.animation_data), None)
    if holder is None:  # only shapes or cameras move
        holder = bpy.context.scene.objects[0]
        holder.animation_data_create()
    empty = bpy.data.actions.new("Take")
    tracks = {}
    for take, actions in scenes.items():
        first, last = _range(actions.values())
        track = holder.animation_data.nla_tracks.new()
        strip = track.strips.new(take, int(first), empty)
        strip.name = take
        strip.frame_start, strip.frame_end = first, last
        tracks[take] = track

    def play(*_):
        for take, track in tracks.items():
            if not track.strips[0].mute:
                for owner in owners:
                    _assign(owner, scenes[take].get(owner))
                return

    bpy.app.handlers.frame_change_pre.append(play)
    try:
        yield
    finally:
        bpy.app.handlers.frame_change_pre.remove(play)
        for track in tracks.values():
            holder.animation_data.nla_tracks.remove(track)
        bpy.data.actions.remove(empty)
        for owner, action in before.items():
            _assign(owner, action)


def _animated():
    """What in the scene has actions: objects, and their cameras and shape keys."""
    found = {}
    for obj in bpy.context.scene.objects:
        data = obj.data
        for owner in (obj, data, getattr(data, "shape_keys", None)):
            if owner and owner.animation_data and owner.animation_data.action:
                found[owner] = None
    return list(found)


def _actions(take, owners):
    """Of each owner its action in the take, by the name that the importer gave it."""
    found = {}
    for owner in owners:
        wanted = f"{owner.name}|{take}"
        for action in bpy.data.actions:
            if _is_called(action.name, wanted) and curves.fits(action, owner):
                found.setdefault(owner, action)
    return found


def _is_called(name, wanted):
    cut = wanted.encode()[:_LONGEST].decode("utf-8", "ignore")
    name = _NUMBER.sub("", name)  # which tells it from that of something else with the same name
    return name == cut or name.startswith(f"{cut}|")  # the name of a layer may follow


def _range(actions):
    frames = [frame for action in actions for frame in action.frame_range]
    return min(frames), max(max(frames), min(frames) + 1)


def _assign(owner, action):
    data = owner.animation_data
    if data.action == action:
        return
    data.action = action
    if action is not None and hasattr(data, "action_slot") and data.action_slot is None and data.action_suitable_slots:
        data.action_slot = data.action_suitable_slots[0]
