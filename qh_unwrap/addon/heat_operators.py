# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that turns the heatmap on and off."""

import bpy

from . import heat_drawing, selection
from .heatmap import heatmap
from .outcome import listed


class QH_OT_heatmap(bpy.types.Operator):
    """Show the distortion of the UVs in colors on the selected meshes and in the UV Editor; once more to end it"""

    bl_idname = "uv.qh_heatmap"
    bl_label = "Distortion Heatmap"
    bl_options = {'REGISTER'}

    @classmethod
    def poll(cls, context):
        if bpy.app.background:
            cls.poll_message_set("Needs Blender's window: there is nothing to draw on")
            return False
        if heatmap.is_on or selection.shown_meshes(context):
            return True
        cls.poll_message_set("Needs a mesh in Edit Mode or selected meshes in Object Mode")
        return False

    def execute(self, context):
        if heatmap.is_on:
            heatmap.turn_off()
            return {'FINISHED'}
        objects = selection.shown_meshes(context)
        heatmap.turn_on(objects, heat_drawing.add)
        without = [entry.name for entry in heatmap.entries if entry.heat is None]
        if len(without) == len(objects):
            heatmap.turn_off()
            self.report({'ERROR'}, f"{listed(without)}: no UVs to show: unwrap first")
            return {'CANCELLED'}
        if without:
            self.report({'WARNING'}, f"{listed(without)}: no UVs to show")
        return {'FINISHED'}
