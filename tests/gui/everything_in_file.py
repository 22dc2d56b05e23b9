# SPDX-License-Identifier: GPL-3.0-or-later
"""All that is in the open file, property by property, to see whether something left it as it was."""

import bpy

_VOLATILE = {  # what is not in the file
    "bl_rna",
    "depsgraph",
    "is_dirty",
    "is_evaluated",
    "is_updated",
    "original",
    "rna_type",
    "session_uid",
    "storage_type",
}
_UNREADABLE = {  # without a window, Blender 4 crashes
    "SpaceNodeEditor.cursor_location",
    "SpaceProperties.search_filter",
    "SpaceProperties.tab_search_results",
    "ToolSettings.uv_sculpt",
}
_DEEPEST = 12


def everything():
    """{path: value} of every property of every datablock, screens, windows and their editors included."""
    found = {}
    for name, collection in sorted(bpy.data.bl_rna.properties.items()):
        if collection.type == 'COLLECTION' and name != "all_ids":  # which has them all a second time
            for block in getattr(bpy.data, name):
                _walk(block, f"{name}[{block.name_full!r}]", found, set(), 0)
    return found


def differences(before, after):
    """The paths whose values differ, or that only one of the two has."""
    return sorted(path for path in before.keys() | after.keys() if before.get(path) != after.get(path))


def _walk(owner, path, found, above, depth):
    pointer = owner.as_pointer()
    if pointer in above or depth > _DEEPEST:
        return
    above = above | {pointer}
    for key, value in _own(owner).items():
        found[f"{path}[{key!r}]"] = repr(value)
    for prop in owner.bl_rna.properties:
        name = prop.identifier
        if name in _VOLATILE or f"{owner.bl_rna.identifier}.{name}" in _UNREADABLE:
            continue
        try:
            value = getattr(owner, name)
        except (AttributeError, RuntimeError, UnicodeDecodeError):  # not there in this state
            continue
        its = f"{path}.{name}"
        if prop.type == 'COLLECTION':
            found[its] = len(value)
            for k, each in enumerate(value):
                _follow(each, f"{its}[{k}]", found, above, depth)
        elif prop.type == 'POINTER':
            _follow(value, its, found, above, depth)
        elif getattr(prop, "is_array", False):
            found[its] = repr([*value]) if not isinstance(value, str | set) else repr(value)
        else:
            found[its] = repr(value)


def _follow(value, path, found, above, depth):
    """A datablock that is mentioned is told by its name: it is looked at in its own place."""
    if value is None or not hasattr(value, "bl_rna"):
        found[path] = repr(value)
    elif isinstance(value, bpy.types.ID) and not value.is_embedded_data:
        found[path] = f"{value.bl_rna.identifier} {value.name_full}"
    else:
        _walk(value, path, found, above, depth + 1)


def _own(owner):
    """Custom properties, those of extensions included."""
    try:
        own = {key: owner[key] for key in owner.keys()}  # noqa: SIM118 (Blender's collections differ)
        return {key: value.to_dict() if hasattr(value, "to_dict") else value for key, value in own.items()}
    except (TypeError, AttributeError):
        return {}
