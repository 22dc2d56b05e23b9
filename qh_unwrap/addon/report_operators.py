# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons beside the last result: select an island's faces, cut what is closed, pack what overlaps, and copy the
report."""

import dataclasses
import itertools

import bmesh
import bpy
import numpy as np

from ..core import UnwrapError
from . import jobs, selecting, telling
from .last_run import last_run
from .running import InSteps
from .selection import Target
from .unwrapping import pack_apart


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
        if outcome is None:
            problem = f"{self.object} has no island {self.island} in the last result: unwrap again"
        else:
            problem = _problem(self.object, obj, [outcome])
            if not problem and not obj.visible_get():
                problem = f"{self.object} is hidden: show it first"
        if problem:
            self.report({'ERROR'}, problem)
            return {'CANCELLED'}
        selecting.select_faces({obj: outcome.face_indices}, context)
        return {'FINISHED'}


def _problem(name, obj, outcomes):
    """Why the object does not have the outcomes' faces any more, and the cure; nothing if it has."""
    if obj is None or obj.type != 'MESH':
        return f"There is no mesh object {name} in this view layer any more: unwrap again"
    if face_count(obj) <= max(outcome.face_indices.max() for outcome in outcomes):
        return f"{name} has fewer faces than when it was unwrapped: unwrap again"
    return ""


def targets_of(outcomes, context):
    """The faces of islands of the last result, and why they are not there any more, an empty text if they are."""
    targets = []
    for name, group in itertools.groupby(outcomes, key=lambda outcome: outcome.obj):
        group = list(group)
        obj = context.view_layer.objects.get(name)
        problem = _problem(name, obj, group)
        if problem:
            return [], problem
        faces = np.zeros(face_count(obj), dtype=bool)
        faces[np.concatenate([outcome.face_indices for outcome in group])] = True
        targets.append(Target(obj, faces))
    return targets, ""


def face_count(obj):
    """How many faces the object has, in any mode."""
    return len(bmesh.from_edit_mesh(obj.data).faces) if obj.mode == 'EDIT' else len(obj.data.polygons)


class QH_OT_pack_overlapping(bpy.types.Operator):
    """Pack the islands that lie on others since they were unwrapped, beside everything else; the others stay"""

    bl_idname = "uv.qh_unwrap_pack_overlapping"
    bl_label = "Pack Overlapping"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        if context.mode not in {'OBJECT', 'EDIT_MESH'}:
            cls.poll_message_set("Needs Object Mode or the Edit Mode of a mesh")
            return False
        if last_run.overlapping:
            return True
        cls.poll_message_set("No island of the last result lies on another")
        return False

    def execute(self, context):
        outcomes = last_run.overlapping
        targets, problem = targets_of(outcomes, context)
        if problem:
            self.report({'ERROR'}, problem)
            return {'CANCELLED'}
        try:
            pack_apart(targets, last_run.options, context)
        except UnwrapError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        for outcome in outcomes:
            outcome.overlaps, outcome.more_overlaps = (), 0
        last_run.work_out()
        return {'FINISHED'}


class QH_OT_cut_closed(InSteps, bpy.types.Operator):
    """Mark the seams that closed islands and those with handles need, and unwrap them with the same settings"""

    bl_idname = "uv.qh_unwrap_cut_closed"
    bl_label = "Cut Open and Unwrap"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        if context.mode not in {'OBJECT', 'EDIT_MESH'}:
            cls.poll_message_set("Needs Object Mode or the Edit Mode of a mesh")
            return False
        if last_run.closed:
            return True
        cls.poll_message_set("No island of the last result is closed or has a handle")
        return False

    def begin(self, context):
        targets, problem = targets_of(last_run.closed, context)
        if problem:
            self.report({'ERROR'}, problem)
            return None
        options = dataclasses.replace(last_run.options, cut='NEEDED')
        seams = context.scene.qh_seams
        settings = last_run.unwrap_settings, options, context, seams.seam_settings(), seams.seam_options()
        return jobs.cut_and_unwrap(targets, *settings)

    def finish(self, result):
        return telling.tell(self, *result)


class QH_OT_copy_report(_OfLastResult, bpy.types.Operator):
    """Copy the last result with the settings and versions, to paste it where you report a fault"""

    bl_idname = "uv.qh_unwrap_copy_report"
    bl_label = "Copy Report"

    def execute(self, context):
        context.window_manager.clipboard = last_run.text(bpy.app.version_string)
        self.report({'INFO'}, "Copied the report to the clipboard")
        return {'FINISHED'}
