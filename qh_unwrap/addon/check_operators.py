# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that check UVs, and that select the faces that a check found."""

import bpy
import numpy as np

from . import inspecting, selecting, selection, telling
from .last_run import last_run
from .operators import OnMeshes
from .report_operators import face_count


class QH_OT_check(OnMeshes, bpy.types.Operator):
    """Say how these UVs distort, and what is flipped, overlaps, has no area or lies outside of its tile"""

    bl_idname = "uv.qh_check"
    bl_label = "Check These UVs"
    bl_options = {'REGISTER'}

    only_selected: bpy.props.BoolProperty(
        name="Only Selected",
        description="In Edit Mode, check the selected faces alone; otherwise all faces count",
        default=False,
        options={'SKIP_SAVE'},
    )

    def begin(self, context):
        if self.only_selected and context.mode == 'EDIT_MESH':
            targets = selection.targets(context)
            problem = selection.nothing_selected(context)
        else:
            objects = selection.mesh_objects(context)
            whole = [selection.Target(obj, np.ones(face_count(obj), dtype=bool)) for obj in objects]
            targets = [target for target in whole if len(target.faces)]
            problem = "There are no faces to check: select a mesh that has some"
        if not targets:
            self.report({'ERROR'}, problem)
            return None
        return inspecting.check_targets(targets, context)

    def finish(self, outcomes):
        return telling.tell_of_check(self, outcomes)


class QH_OT_check_select(bpy.types.Operator):
    """Select in Edit Mode the faces that the last check found, and nothing else"""

    bl_idname = "uv.qh_check_select"
    bl_label = "Select Checked Faces"
    bl_options = {'REGISTER', 'UNDO'}

    kind: bpy.props.EnumProperty(
        name="Faces",
        description="Which of the faces to select",
        items=[
            ('FLIPPED', "Flipped", "Faces that lie against most of their island"),
            ('MIRRORED', "Mirrored", "All faces of the islands that are mirrored as a whole, which is no fault"),
            ('OVERLAPPING', "Overlapping", "Faces that share some area with others, of their own island or another"),
            ('WORST', "Worst 1 %", "The hundredth of all faces that is distorted most, in angles and areas together"),
            ('LOOK', "Islands to Look At", "All faces of the islands that have a fault"),
        ],
    )

    @classmethod
    def description(cls, _context, properties):
        items = cls.bl_rna.properties["kind"].enum_items
        return f"Select in Edit Mode, and nothing else: {items[properties.kind].description}"

    @classmethod
    def poll(cls, context):
        if context.mode not in {'OBJECT', 'EDIT_MESH'}:
            cls.poll_message_set("Needs Object Mode or the Edit Mode of a mesh")
            return False
        if last_run.check is None:
            cls.poll_message_set("Nothing has been checked yet: use Check These UVs")
            return False
        return True

    def execute(self, context):
        found = last_run.found(self.kind)
        if not found:
            self.report({'INFO'}, "There are no such faces")
            return {'CANCELLED'}
        faces = {}
        for name, indices in found.items():
            obj = context.view_layer.objects.get(name)
            problem = _problem(name, obj)
            if problem:
                self.report({'ERROR'}, problem)
                return {'CANCELLED'}
            faces[obj] = indices
        selecting.select_faces(faces, context)
        total = sum(map(len, found.values()))
        self.report({'INFO'}, f"Selected {total} face{'' if total == 1 else 's'}")
        return {'FINISHED'}


def _problem(name, obj):
    """Why the object's faces cannot be selected, and the cure; nothing if they can."""
    if obj is None or obj.type != 'MESH':
        return f"There is no mesh object {name} in this view layer any more: check again"
    if face_count(obj) != last_run.check.face_counts[name]:
        return f"{name} has other faces than when it was checked: check again"
    return "" if obj.visible_get() else f"{name} is hidden: show it first"
