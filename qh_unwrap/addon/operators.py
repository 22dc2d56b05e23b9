# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that unwrap, mark seams, relax and straighten."""

import dataclasses

import bpy

from ..core.errors import SettingsError
from . import jobs, properties, selection, telling, uv_selection
from .outcome import latest
from .running import InSteps

last_outcomes = latest


class OnMeshes(InSteps):
    """Mix-in for an operator on the meshes that are edited, or selected in Object Mode."""

    @classmethod
    def poll(cls, context):
        if selection.mesh_objects(context):
            return True
        cls.poll_message_set(
            "Needs a mesh in Edit Mode or selected meshes in Object Mode, not linked from another file"
        )
        return False

    def options_for(self, objects, owner):
        """The `MeshOptions` of an owner of properties, None after a report of why the objects cannot have them."""
        options = owner.mesh_options()
        problem = options.use_weights and selection.without_group(objects, options.weight_group)
        if problem:
            self.report({'ERROR'}, problem)
            return None
        return options


class OnSelectedFaces(OnMeshes):
    """Mix-in for an operator that unwraps the faces that are selected, or copies of them."""

    def asked_for(self, context, owner):
        """The targets, and the `Settings` and `MeshOptions` of an owner of properties, None after a report of why there
        are no such."""
        targets = selection.targets(context)
        if not targets:
            self.report({'ERROR'}, selection.nothing_selected(context))
            return None
        try:
            settings = owner.settings()
            settings.check_together()
        except SettingsError as error:
            self.report({'ERROR'}, str(error))
            return None
        options = self.options_for([target.obj for target in targets], owner)
        return options and (targets, settings, options)


class _WithPanel:
    """Mix-in for an operator whose properties stand in a panel as well: those of the scene with the name `panel`."""

    panel = ""

    def invoke(self, context, event):
        """From a menu: with the panel's settings.  Scripts come to `execute`, with the defaults."""
        self.take_unset_from(getattr(context.scene, self.panel))
        return super().invoke(context, event)


class QH_OT_unwrap(_WithPanel, OnSelectedFaces, properties.OperatorProperties, bpy.types.Operator):
    """Unwrap the selected faces, in Object Mode all faces, with little distortion and without flipping any"""

    bl_idname = "uv.qh_unwrap"
    bl_label = "Quasi-Harmonic Unwrap"
    bl_options = {'REGISTER', 'UNDO'}
    panel = "qh_unwrap"

    def draw(self, context):
        properties.draw(self.layout, self, context.object)

    def begin(self, context):
        asked = self.asked_for(context, self)
        seams = context.scene.qh_seams
        return asked and jobs.cut_and_unwrap(*asked, context, seams.seam_settings(), seams.seam_options())

    def finish(self, result):
        return telling.tell(self, *result)


class QH_OT_seams(_WithPanel, OnSelectedFaces, properties.SeamOperatorProperties, bpy.types.Operator):
    """Mark seams on the selected faces, in Object Mode on all faces, so that they unwrap with little distortion"""

    bl_idname = "uv.qh_seams"
    bl_label = "Quasi-Harmonic Seams"
    bl_options = {'REGISTER', 'UNDO'}
    panel = "qh_seams"

    def draw(self, context):
        properties.draw_seams(self.layout, self, context.object)

    def begin(self, context):
        asked = self.asked_for(context, context.scene.qh_unwrap)
        if asked is None:
            return None
        targets, settings, options = asked
        group = self.vertex_group
        if group and all(target.obj.vertex_groups.get(group) is None for target in targets):
            self.report({'ERROR'}, f"There is no vertex group {group} to spare: choose another one, or none")
            return None
        options = dataclasses.replace(options, cut=self.until)
        work = jobs.cut_and_unwrap if self.unwrap else jobs.cut
        return work(targets, settings, options, context, self.seam_settings(), self.seam_options())

    def finish(self, result):
        outcomes, cuts = result
        return telling.tell(self, outcomes, cuts) if outcomes else telling.tell_of_seams(self, cuts)


class _OnSelectedUVs(_WithPanel, OnMeshes):
    """Mix-in for an operator that changes the UVs that are selected; the classes say how, and what to select."""

    nothing = ""

    def draw(self, _context):
        properties.draw_relaxing(self.layout, self)

    def begin(self, context):
        objects = selection.mesh_objects(context)
        options = self.options_for(objects, context.scene.qh_unwrap)
        chosen = [(obj, uv_selection.read(obj, context)) for obj in objects]
        return options and self.work(chosen, self.settings(), options, context)

    def finish(self, result):
        outcomes, _ = result
        if not outcomes:
            self.report({'ERROR'}, self.nothing)
            return {'CANCELLED'}
        return telling.tell(self, *result)


class QH_OT_relax(_OnSelectedUVs, properties.RelaxOperatorProperties, bpy.types.Operator):
    """Even out the selected UVs where they lie; their border, pins and all that is not selected stay"""

    bl_idname = "uv.qh_relax"
    bl_label = "Quasi-Harmonic Relax"
    bl_options = {'REGISTER', 'UNDO'}
    panel = "qh_relax"

    nothing = "No UVs are selected: select some to relax, in the UV Editor or in the 3D View"
    work = staticmethod(jobs.relax)


class QH_OT_straighten(_OnSelectedUVs, properties.StraightenOperatorProperties, bpy.types.Operator):
    """Make selected edges straight in the UV map, or selected quads a rectangle, and relax the rest around them"""

    bl_idname = "uv.qh_straighten"
    bl_label = "Quasi-Harmonic Straighten"
    bl_options = {'REGISTER', 'UNDO'}
    panel = "qh_straighten"

    nothing = "Nothing is selected that could become straight: select edges, or quads for a rectangle"
    work = staticmethod(jobs.straighten)
