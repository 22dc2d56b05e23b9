# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that compare methods, plot how they distort, and save the plot."""

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from . import comparing, plotting, writing
from .comparison import HEAD, latest
from .failures import FileError
from .operators import OnSelectedFaces

_METHODS = (
    (
        'BLENDER',
        "Blender's",
        "The methods that Blender offers, the UVs that there are, and Quasi-Harmonic with the settings of the panel",
    ),
    (
        'FIGURE_11',
        "Figure 11",
        "The maps of figure 11 of the paper: discrete conformal, stretch minimization, quasi-harmonic; and our balance",
    ),
)


class _Comparing(OnSelectedFaces):
    """Mix-in for an operator that lets methods try on copies."""

    methods: bpy.props.EnumProperty(
        name="Methods", description="Which methods are compared", items=_METHODS, options={'SKIP_SAVE'}
    )

    def begin(self, context):
        asked = self.asked_for(context, context.scene.qh_unwrap)
        if asked is None:
            return None
        targets, settings, options = asked
        blenders = self.methods == 'BLENDER'
        methods = comparing.blenders(settings, options) if blenders else comparing.of_figure_11(options)
        return comparing.compare(targets, methods, context, options)

    def finish(self, comparison):
        latest.comparison = comparison
        for line in (comparison.title, *comparison.lines, *comparison.remarks):
            print(line)
        return self.show(comparison, bpy.context)


class QH_OT_compare(_Comparing, bpy.types.Operator):
    """Unwrap copies of the selected faces by Blender's methods and by ours, and show in a table how each distorts"""

    bl_idname = "uv.qh_compare"
    bl_label = "Compare Methods"
    bl_options = {'REGISTER'}

    def show(self, comparison, context):
        self.report({'INFO'}, f"Compared on copies: {comparison.title}")
        if not bpy.app.background:
            bpy.ops.uv.qh_compare_show('INVOKE_DEFAULT')
        return {'FINISHED'}


class QH_OT_plot(_Comparing, bpy.types.Operator):
    """Plot how Blender's methods and ours distort each triangle of the selected faces, in angles and areas"""

    bl_idname = "uv.qh_plot"
    bl_label = "Plot Distortion"
    bl_options = {'REGISTER', 'UNDO'}

    def show(self, comparison, context):
        if comparison.figure is None:
            self.report({'ERROR'}, f"There is nothing to plot: {comparison.remarks[0]}")
            return {'CANCELLED'}
        image = plotting.as_image(comparison.figure)
        if not bpy.app.background:
            plotting.show(image, context)
        self.report({'INFO'}, f"The plot is the image {image.name}")
        return {'FINISHED'}


class _OfLatest:
    """Mix-in for what needs a comparison."""

    @classmethod
    def poll(cls, _context):
        if latest.comparison is not None:
            return True
        cls.poll_message_set("Nothing has been compared yet")
        return False


class QH_OT_compare_show(_OfLatest, bpy.types.Operator):
    """Show the table of the latest comparison"""

    bl_idname = "uv.qh_compare_show"
    bl_label = "Show Comparison"

    def invoke(self, context, _event):
        return context.window_manager.invoke_popup(self, width=_WIDTH)

    def execute(self, _context):
        return {'FINISHED'}

    def draw(self, _context):
        draw_table(self.layout, latest.comparison)


_WIDTH = 620  # pixels


def draw_table(layout, comparison):
    """The table as columns of labels."""
    layout.label(text=comparison.title, icon='UV')
    split = layout.split(factor=0.26)
    names, numbers = split.column(align=True), split.row()
    columns = [names, *(numbers.column(align=True) for _ in HEAD[1:])]
    for row in (HEAD, *(row.cells for row in comparison.rows)):
        for column, text in zip(columns, row, strict=True):
            column.label(text=text)
    for remark in comparison.remarks:
        layout.label(text=remark, icon='ERROR')


class QH_OT_plot_save(_OfLatest, ExportHelper, bpy.types.Operator):
    """Save the plot of the latest comparison as a picture (.png) or as a drawing that can be edited (.svg)"""

    bl_idname = "uv.qh_plot_save"
    bl_label = "Save Plot"

    filename_ext = ".svg"
    filter_glob: bpy.props.StringProperty(default="*.png;*.svg", options={'HIDDEN'})

    def check(self, _context):
        return False  # whichever of the two suffixes the name has, it stays

    def execute(self, _context):
        path, figure = Path(bpy.path.abspath(self.filepath)), latest.comparison.figure
        if path.suffix.lower() not in plotting.FORMATS:
            self.report({'ERROR'}, f"{path.name} has neither .png nor .svg as its ending: choose one of them")
            return {'CANCELLED'}
        if figure is None:
            self.report({'ERROR'}, "No method of the latest comparison has a curve: compare again")
            return {'CANCELLED'}
        try:
            save(figure, path)
        except (OSError, RuntimeError, FileError) as error:
            self.report({'ERROR'}, f"Cannot write {path}: {error}")
            return {'CANCELLED'}
        self.report({'INFO'}, f"Saved {path}")
        return {'FINISHED'}


def save(figure, path):
    """Write the figure in place of what was there, once it is whole."""
    with writing.Staging(overwrite=True) as staging:
        staging.write(path, lambda file: plotting.write(figure, file), plotting.check)
        staging.put_in_place()
