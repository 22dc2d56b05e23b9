# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender properties made from the fields of settings and options, shared by operators, scene and panels."""

import dataclasses

import bpy

from ..core import Settings
from ..core.relax_settings import RelaxSettings, StraightenSettings
from ..core.seam_settings import SeamSettings
from .options import HeatSettings, MeshOptions, SeamOptions


def _property(field, options=frozenset()):
    meta = field.metadata
    common = dict(name=meta["label"], description=meta["description"], default=field.default, options=set(options))
    if meta["choices"]:
        items = [(choice.identifier, choice.label, choice.description) for choice in meta["choices"]]
        return bpy.props.EnumProperty(items=items, **common)
    if type(field.default) is bool:
        return bpy.props.BoolProperty(**common)
    if type(field.default) is str:
        return bpy.props.StringProperty(**common)
    (low, high), (soft_low, soft_high) = meta["range"], meta["soft_range"]
    limits = dict(min=low, max=high, soft_min=soft_low, soft_max=soft_high)
    if type(field.default) is int:
        return bpy.props.IntProperty(**limits, **common)
    subtype = 'FACTOR' if (soft_low, soft_high) == (0, 1) else 'NONE'  # a slider
    return bpy.props.FloatProperty(precision=4 if soft_high < 1 else 3, subtype=subtype, **limits, **common)


def _fields(*kinds):
    return tuple(field for kind in kinds for field in dataclasses.fields(kind))


def _made_from(owner, kind):
    return kind(**{field.name: _value(getattr(owner, field.name)) for field in dataclasses.fields(kind)})


def _value(value):
    """Blender keeps 32-bit floats: 0.01 comes back as 0.00999999978, which would be out of range."""
    return float(f"{value:.6g}") if isinstance(value, float) else value


class _Properties:
    """Mix-in with one property per field of the `kinds` of dataclasses."""

    kinds, fields = (), ()

    def __init_subclass__(cls, *, kinds=(), options=frozenset(), **others):
        super().__init_subclass__(**others)
        if kinds:
            cls.kinds, cls.fields = kinds, _fields(*kinds)
            cls.__annotations__ = {field.name: _property(field, options) for field in cls.fields}

    def as_keywords(self):
        """All of them by name, as a script would pass them to the operator."""
        return {field.name: _value(getattr(self, field.name)) for field in self.fields}

    def take_unset_from(self, other):
        """What the caller did not set comes from `other`."""
        for field in self.fields:
            if not self.properties.is_property_set(field.name):
                setattr(self, field.name, getattr(other, field.name))


class _Unwrapping(_Properties):
    def settings(self):
        return _made_from(self, Settings)

    def mesh_options(self):
        return _made_from(self, MeshOptions)


class SettingsProperties(_Unwrapping, kinds=(Settings, MeshOptions)):
    """How to unwrap."""


class OperatorProperties(_Unwrapping, kinds=(Settings, MeshOptions), options={'SKIP_SAVE'}):
    """The same for an operator, which forgets them after each run."""


class _Cutting(_Properties):
    def seam_settings(self):
        return _made_from(self, SeamSettings)

    def seam_options(self):
        return _made_from(self, SeamOptions)


class SeamProperties(_Cutting, kinds=(SeamOptions, SeamSettings)):
    """How to mark seams."""


class SeamOperatorProperties(_Cutting, kinds=(SeamOptions, SeamSettings), options={'SKIP_SAVE'}):
    """The same for an operator, which forgets them after each run."""


class _OfOneKind(_Properties):
    def settings(self):
        (kind,) = self.kinds
        return _made_from(self, kind)


class RelaxProperties(_OfOneKind, kinds=(RelaxSettings,)):
    """How to relax."""


class RelaxOperatorProperties(_OfOneKind, kinds=(RelaxSettings,), options={'SKIP_SAVE'}):
    """The same for an operator, which forgets them after each run."""


class StraightenProperties(_OfOneKind, kinds=(StraightenSettings,)):
    """How to straighten."""


class StraightenOperatorProperties(_OfOneKind, kinds=(StraightenSettings,), options={'SKIP_SAVE'}):
    """The same for an operator, which forgets them after each run."""


class HeatProperties(_OfOneKind, kinds=(HeatSettings,)):
    """What the heatmap shows."""


_FIRST = ('boundary', 'aspect', 'balance', 'iterations', 'weights')
_SECTIONS = {
    "Layout": (
        'placement',
        'rotate',
        'margin_method',
        'margin',
        'texel_density',
        'pixels_per_metre',
        'image_size',
    ),
    "Mesh": (
        'cut',
        'fill_holes',
        'correct_aspect',
        'correct_scale',
        'use_subsurf_data',
        'weld',
        'use_weights',
        'weight_group',
        'weight_factor',
    ),
    "Advanced": ('initial', 'refine', 'repair', 'tolerance', 'tensor_power'),
}


def draw(layout, owner, obj=None):
    """A row for each property, the rarer ones in sections that fold; what does not apply is grey or not shown."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    _draw_rows(layout, owner, _FIRST)
    for title, names in _SECTIONS.items():
        header, body = layout.panel(f"qh_unwrap_{title.lower()}", default_closed=title != "Layout")
        header.label(text=title)
        if body:
            _draw_rows(body, owner, names, obj)


def _draw_rows(layout, owner, names, obj=None):
    shown = {
        'aspect': owner.boundary == 'RECTANGLE',
        'pixels_per_metre': owner.texel_density == 'GIVEN',
        'image_size': owner.texel_density == 'GIVEN',
        'weight_group': owner.use_weights,
        'weight_factor': owner.use_weights,
    }
    for name in names:
        if not shown.get(name, True):
            continue
        row = layout.row()
        row.active = _applies(owner, name)
        if name == 'weight_group' and obj is not None and obj.type == 'MESH':
            row.prop_search(owner, name, obj, "vertex_groups")
        else:
            row.prop(owner, name)


def _applies(owner, name):
    placed = owner.boundary != 'KEEP'
    iterates = owner.iterations > 0
    refines = owner.weights == 'COTANGENT' and owner.refine > 0
    return {
        'refine': owner.weights == 'COTANGENT',
        'repair': owner.weights == 'COTANGENT' and iterates,
        'weights': iterates or owner.boundary != 'FREE',
        'tensor_power': iterates and owner.weights != 'STRETCH',
        'tolerance': iterates and not refines,
        'fill_holes': owner.boundary not in ('KEEP', 'FREE'),
        'placement': placed,
        'rotate': placed and owner.placement == 'PACK',
        'margin': placed and owner.placement != 'UNIT',
        'margin_method': placed and owner.placement != 'UNIT',
        'texel_density': placed,
        'pixels_per_metre': placed,
        'image_size': placed,
    }.get(name, True)


def draw_seams(layout, owner, obj):
    """A row for each property of the seams of an object; what does not apply is greyed out."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for field in owner.fields:
        name, row = field.name, layout.row()
        if name == 'vertex_group' and obj is not None and obj.type == 'MESH':
            row.prop_search(owner, name, obj, "vertex_groups")
            continue
        row.active = {
            'distortion': owner.until == 'DISTORTION',
            'split_angle': owner.charts > 1,
        }.get(name, True)
        row.prop(owner, name)


def draw_relaxing(layout, owner):
    """A row for each property of relaxing or straightening; what does not apply is greyed out."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for field in owner.fields:
        row = layout.row()
        row.active = field.name != 'along' or owner.shape == 'LINES'
        row.prop(owner, field.name)


class QHUnwrapSceneSettings(SettingsProperties, bpy.types.PropertyGroup):
    """The settings that the panels show and their button uses."""


class QHSeamsSceneSettings(SeamProperties, bpy.types.PropertyGroup):
    """The same for seams."""


class QHRelaxSceneSettings(RelaxProperties, bpy.types.PropertyGroup):
    """The same for relaxing."""


class QHStraightenSceneSettings(StraightenProperties, bpy.types.PropertyGroup):
    """The same for straightening."""


class QHHeatSceneSettings(HeatProperties, bpy.types.PropertyGroup):
    """The same for the heatmap."""
