# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar panels of the UV Editor and the 3D View, and the menu entry."""

import textwrap

import bpy

from . import properties
from .comparison import latest
from .heatmap import heatmap
from .last_run import last_run
from .outcome import change, faults


def draw_menu(menu, _context):
    menu.layout.separator()
    menu.layout.operator("uv.qh_unwrap", text="Quasi-Harmonic")


def draw_relax_menu(menu, _context):
    menu.layout.separator()
    menu.layout.operator("uv.qh_relax")
    menu.layout.operator("uv.qh_straighten", text="Quasi-Harmonic Straighten Edges").shape = 'LINES'
    menu.layout.operator("uv.qh_straighten", text="Quasi-Harmonic Quads to Rectangle").shape = 'RECTANGLE'


def draw_seam_menu(menu, _context):
    menu.layout.separator()
    menu.layout.operator("uv.qh_seams")


def draw_distortion_menu(menu, _context):
    menu.layout.operator("uv.qh_heatmap")
    menu.layout.operator("uv.qh_compare")
    menu.layout.operator("uv.qh_plot")


def draw_check_menu(menu, _context):
    menu.layout.operator("uv.qh_check")


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
        row = layout.row(align=True)
        row.operator("uv.qh_check", icon='VIEWZOOM')
        if context.mode == 'EDIT_MESH':
            row.operator("uv.qh_check", text="", icon='RESTRICT_SELECT_OFF').only_selected = True
        properties.draw(layout.column(), settings, context.object)


class _SeamPanel:
    bl_label = "Seams"
    bl_region_type = 'UI'
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = self.layout
        settings = context.scene.qh_seams
        button = layout.operator("uv.qh_seams", text="Mark Seams", icon='MOD_EDGESPLIT')
        for name, value in settings.as_keywords().items():
            setattr(button, name, value)
        properties.draw_seams(layout.column(), settings, context.object)


class _RelaxPanel:
    bl_label = "Relax"
    bl_region_type = 'UI'
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        for name, text, icon, settings in (
            ("uv.qh_relax", "Relax", 'MOD_SMOOTH', context.scene.qh_relax),
            ("uv.qh_straighten", "Straighten", 'MOD_LATTICE', context.scene.qh_straighten),
        ):
            column = self.layout.column()
            button = column.operator(name, text=text, icon=icon)
            for key, value in settings.as_keywords().items():
                setattr(button, key, value)
            properties.draw_relaxing(column.column(), settings)


class _DistortionPanel:
    bl_label = "Distortion"
    bl_region_type = 'UI'
    bl_options = {'DEFAULT_CLOSED'}

    def draw(self, context):
        layout = self.layout
        layout.operator("uv.qh_heatmap", text="Heatmap", icon='SHADING_RENDERED', depress=heatmap.is_on)
        column = layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        settings = context.scene.qh_heatmap
        for field in settings.fields:
            column.prop(settings, field.name)
        layout.separator()
        layout.operator("uv.qh_compare", icon='SPREADSHEET')
        layout.operator("uv.qh_plot", icon='GRAPH')
        if latest.comparison is not None:
            _draw_comparison(layout, latest.comparison)


def _draw_comparison(layout, comparison):
    """The latest one in few words, which fit into the sidebar."""
    column = layout.column(align=True)
    column.label(text=comparison.title, icon='UV')
    for row in comparison.rows:
        name, stretch, *_, flips, overlaps, _ = row.cells
        numbers = row.error or f"stretch {stretch}, {flips} flipped, {overlaps} overlap"
        _draw_text(column, f"{name}: {numbers}", 'BLANK1')
    row = layout.row(align=True)
    row.operator("uv.qh_compare_show", text="Table", icon='SPREADSHEET')
    row.operator("uv.qh_plot_save", icon='FILE_TICK')


class _ReportPanel:
    bl_label = "Last Result"
    bl_region_type = 'UI'

    @classmethod
    def poll(cls, _context):
        return bool(last_run.outcomes)

    def draw(self, _context):
        self.layout.operator("uv.qh_unwrap_copy_report", icon='COPYDOWN')
        for icon, lines in (('ERROR', last_run.errors), ('INFO', last_run.lines)):
            for line, outcome in lines:
                row = self.layout.row()
                _draw_text(row.column(align=True), line, icon)
                _draw_select(row, outcome)
        if last_run.check is not None:
            _draw_check(self.layout, last_run.check)
        if last_run.overlapping:
            self.layout.operator("uv.qh_unwrap_pack_overlapping", icon='UV_ISLANDSEL')
        if last_run.closed:
            self.layout.operator("uv.qh_unwrap_cut_closed", icon='MOD_EDGESPLIT')
        for outcome in last_run.ordered[:_SHOWN]:
            _draw_outcome(self.layout.column(align=True), outcome)
        if len(last_run.ordered) > _SHOWN:
            self.layout.label(text=f"and {len(last_run.ordered) - _SHOWN} more")


_SHOWN = 12  # islands
_WIDTH = 32  # characters


def _draw_text(column, text, icon):
    for line in textwrap.wrap(text, _WIDTH):
        column.label(text=line, icon=icon)
        icon = 'BLANK1'


def _draw_check(layout, check):
    """What is true of all islands together, and buttons that select what was found."""
    if check.texel_density:
        layout.label(text=f"{check.texel_density:.1f} pixels per metre", icon='TEXTURE')
    column = layout.column(align=True)
    for kind, text in _KINDS.items():
        row = column.row(align=True)
        row.enabled = bool(last_run.found(kind))
        row.operator("uv.qh_check_select", text=text, icon='RESTRICT_SELECT_OFF').kind = kind


_KINDS = {
    'FLIPPED': "Flipped Faces",
    'MIRRORED': "Mirrored Islands",
    'OVERLAPPING': "Overlapping Faces",
    'WORST': "Worst 1 %",
    'LOOK': "Islands to Look At",
}


def _draw_select(row, outcome):
    """A button that selects the island's faces."""
    button = row.operator("uv.qh_unwrap_select", text="", icon='RESTRICT_SELECT_OFF')
    button.object, button.island = outcome.obj, outcome.number


def _draw_outcome(column, outcome):
    """Its name, with a button that selects its faces if it needs a look, and its numbers if there are any."""
    row = column.row()
    row.label(text=outcome.label, icon='CHECKMARK' if outcome.is_clean else 'ERROR')
    if not outcome.is_clean:
        _draw_select(row, outcome)
    if outcome.error and len(last_run.errors) > 1:  # which of them
        _draw_text(column, outcome.error, 'BLANK1')
    if not outcome.error:
        stretch = change(outcome.before, outcome.after, "l2_stretch")
        faulty = faults(outcome.after.flips, outcome.after.collapsed)
        column.label(text=f"Stretch {stretch}, {faulty}", icon='BLANK1')
        if outcome.texel_density:
            column.label(text=f"{outcome.texel_density:.1f} pixels per metre", icon='BLANK1')


class QH_PT_uv_editor(_Panel, bpy.types.Panel):
    bl_space_type = 'IMAGE_EDITOR'

    @classmethod
    def poll(cls, context):
        return context.space_data.mode == 'UV'


class QH_PT_view_3d(_Panel, bpy.types.Panel):
    bl_space_type = 'VIEW_3D'


def _in_both(name, section):
    """The classes of a section below the panels of the UV Editor and of the 3D View."""
    for place, space in (("uv_editor", 'IMAGE_EDITOR'), ("view_3d", 'VIEW_3D')):
        its = dict(bl_space_type=space, bl_parent_id=f"QH_PT_{place}")
        yield type(f"QH_PT_{place}_{name}", (section, bpy.types.Panel), its)


QH_PT_uv_editor_seams, QH_PT_view_3d_seams = _in_both("seams", _SeamPanel)
QH_PT_uv_editor_relax, QH_PT_view_3d_relax = _in_both("relax", _RelaxPanel)
QH_PT_uv_editor_distortion, QH_PT_view_3d_distortion = _in_both("distortion", _DistortionPanel)
QH_PT_uv_editor_report, QH_PT_view_3d_report = _in_both("report", _ReportPanel)
