# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons beside the last result: select an island's faces, and copy the report."""

import bmesh
import bpy

from .last_run import last_run


class _OfLastResult:
    """Mix-in for what needs a last result."""

    @classmethod
    def poll(cls, _context):
        if last_run.outcomes:
            return True
        cls.poll_message_set("Nothing has been unwrapped yet")
        return False


class QH_OT_select(_OfLastResult, bpy.types.Operator):
    """Select the faces of this island in Edit Mode, and nothing else"""

    bl_idname = "uv.qh_unwrap_select"
    bl_label = "Select Island"
    bl_options = {'REGISTER', 'UNDO'}

    object: bpy.props.StringProperty(name="Object", description="The name of the island's object")
    island: bpy.props.IntProperty(name="Island", description="The number of the island in its mesh", min=1, default=1)

    @classmethod
    def poll(cls, context):
        if context.mode in {'OBJECT', 'EDIT_MESH'}:
            return super().poll(context)
        cls.poll_message_set("Needs Object Mode or the Edit Mode of a mesh")
        return False

    def execute(self, context):
        outcome = last_run.find(self.object, self.island)
        obj = context.view_layer.objects.get(self.object)
        problem = self._problem(outcome, obj)
        if problem:
            self.report({'ERROR'}, problem)
            return {'CANCELLED'}
        _edit(obj, context)
        _select_faces(obj, outcome.face_indices.tolist())
        return {'FINISHED'}

    def _problem(self, outcome, obj):
        """Why the island cannot be selected, and the cure; nothing if it can."""
        if outcome is None:
            return f"{self.object} has no island {self.island} in the last result: unwrap again"
        if obj is None or obj.type != 'MESH':
            return f"There is no mesh object {self.object} in this view layer any more: unwrap again"
        if not obj.visible_get():
            return f"{self.object} is hidden: show it first"
        faces = len(bmesh.from_edit_mesh(obj.data).faces) if obj.mode == 'EDIT' else len(obj.data.polygons)
        if faces <= outcome.face_indices.max():
            return f"{self.object} has fewer faces than when it was unwrapped: unwrap again"
        return ""


def _edit(obj, context):
    """Enter Edit Mode in face mode, with this object if it is not among those that are edited."""
    objects = context.view_layer.objects
    if obj.mode != 'EDIT':
        if context.mode == 'EDIT_MESH':
            bpy.ops.object.mode_set(mode='OBJECT')
        for other in list(objects.selected):
            other.select_set(False)
        obj.select_set(True)
        objects.active = obj
        bpy.ops.object.mode_set(mode='EDIT')
    objects.active = obj
    context.tool_settings.mesh_select_mode = (False, False, True)
    bpy.ops.mesh.select_all(action='DESELECT')


def _select_faces(obj, indices):
    """Select these faces, also for the UV Editor, where UVs have a selection of their own."""
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    uv_layer = bm.loops.layers.uv.active
    faces = [bm.faces[index] for index in indices]
    for face in faces:
        face.hide_set(False)
        face.select_set(True)
        if uv_layer is not None and bpy.app.version < (5, 0, 0):
            for loop in face.loops:
                loop[uv_layer].select = loop[uv_layer].select_edge = True
    bm.faces.active = faces[0]
    if bpy.app.version >= (5, 0, 0):
        bm.uv_select_sync_from_mesh()
    bmesh.update_edit_mesh(obj.data)


class QH_OT_copy_report(_OfLastResult, bpy.types.Operator):
    """Copy the last result with the settings and versions, to paste it where you report a fault"""

    bl_idname = "uv.qh_unwrap_copy_report"
    bl_label = "Copy Report"

    def execute(self, context):
        context.window_manager.clipboard = last_run.text(bpy.app.version_string)
        self.report({'INFO'}, "Copied the report to the clipboard")
        return {'FINISHED'}
