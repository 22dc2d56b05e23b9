# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender properties made from the fields of `Settings` and `Placement`, shared by operator, scene and panels."""

import dataclasses

import bpy

from ..core import Settings
from .options import Placement


def _property(field):
    meta = field.metadata
    common = dict(name=meta["label"], description=meta["description"], default=field.default)
    if meta["choices"]:
        items = [(choice.identifier, choice.label, choice.description) for choice in meta["choices"]]
        return bpy.props.EnumProperty(items=items, **common)
    if field.type is bool:
        return bpy.props.BoolProperty(**common)
    (low, high), (soft_low, soft_high) = meta["range"], meta["soft_range"]
    limits = dict(min=low, max=high, soft_min=soft_low, soft_max=soft_high)
    if field.type is int:
        return bpy.props.IntProperty(**limits, **common)
    return bpy.props.FloatProperty(precision=4 if soft_high < 1 else 3, **limits, **common)


FIELDS = (*dataclasses.fields(Settings), *dataclasses.fields(Placement))


class SettingsProperties:
    """Mix-in with one property per field of `Settings` and `Placement`."""

    __annotations__ = {field.name: _property(field) for field in FIELDS}

    def settings(self):
        return _made_from(self, Settings)

    def placement_settings(self):
        return _made_from(self, Placement)

    def as_keywords(self):
        """All of them by name, as a script would pass them to the operator."""
        return {field.name: _value(getattr(self, field.name)) for field in FIELDS}


def _made_from(owner, kind):
    return kind(**{field.name: _value(getattr(owner, field.name)) for field in dataclasses.fields(kind)})


def _value(value):
    """Blender keeps 32-bit floats: 0.01 comes back as 0.00999999978, which would be out of range."""
    return float(f"{value:.6g}") if isinstance(value, float) else value


def draw(layout, owner):
    """One row per property; what does not apply to the other choices is greyed out."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for field in FIELDS:
        row = layout.row()
        row.active = _applies(owner, field.name)
        row.prop(owner, field.name)


def _applies(owner, name):
    return {
        'aspect': owner.boundary == 'RECTANGLE',
        'repair': owner.weights == 'COTANGENT',
        'placement': owner.boundary != 'KEEP',
        'margin': owner.boundary != 'KEEP' and owner.placement != 'UNIT',
    }.get(name, True)


class QHUnwrapSceneSettings(SettingsProperties, bpy.types.PropertyGroup):
    """The settings that the panels show and their button uses."""
