# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar panels of the UV Editor and the 3D View, and the menu entry."""

import textwrap

import bpy

from . import operators, properties
from .outcome import change, count


def draw_menu(menu, _context):
    menu.layout.separator()
    menu.layout.operator("uv.qh_unwrap", text="Quasi-Harmonic")


class _Panel:
    bl_label = "QH Unwrap"
    bl_category = "QH Unwrap"
    bl_region_type = 'UI'

    def draw(self, context):
        layout = self.layout
        settings = context.scene.qh_unwrap
        button = layout.operator("uv.qh_unwrap", text="Unwrap", icon='UV')
        for name, value in settings.as_keywords().items():
            setattr(button, name, value)
        properties.draw(layout.column(), settings)


class _ReportPanel:
    bl_label = "Last Result"
    bl_region_type = 'UI'

    @classmethod
    def poll(cls, _context):
        return bool(operators.last_outcomes)

    def draw(self, _context):
        outcomes = operators.last_outcomes
        for outcome in outcomes[:_SHOWN]:
            column = self.layout.column(align=True)
            if outcome.error:
                column.label(text=outcome.label, icon='ERROR')
                for text in textwrap.wrap(outcome.error, _WIDTH):
                    column.label(text=text, icon='BLANK1')
                continue
            column.label(text=outcome.label, icon='CHECKMARK' if outcome.is_clean else 'ERROR')
            for text in _lines(outcome):
                column.label(text=text, icon='BLANK1')
        if len(outcomes) > _SHOWN:
            self.layout.label(text=f"and {len(outcomes) - _SHOWN} more")


_SHOWN = 12  # islands
_WIDTH = 32  # characters


def _lines(outcome):
    yield f"Stretch {change(outcome.before, outcome.after, 'l2_stretch')}, {count(outcome.after.flips, 'flip')}"
    for warning in outcome.messages():
        yield from textwrap.wrap(warning, _WIDTH)


class QH_PT_uv_editor(_Panel, bpy.types.Panel):
    bl_space_type = 'IMAGE_EDITOR'

    @classmethod
    def poll(cls, context):
        return context.space_data.mode == 'UV'


class QH_PT_view_3d(_Panel, bpy.types.Panel):
    bl_space_type = 'VIEW_3D'


class QH_PT_uv_editor_report(_ReportPanel, bpy.types.Panel):
    bl_space_type = 'IMAGE_EDITOR'
    bl_parent_id = "QH_PT_uv_editor"


class QH_PT_view_3d_report(_ReportPanel, bpy.types.Panel):
    bl_space_type = 'VIEW_3D'
    bl_parent_id = "QH_PT_view_3d"
