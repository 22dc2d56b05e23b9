# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that unwraps."""

import bpy

from ..core.errors import SettingsError
from . import properties, selection
from .outcome import error_sentences, latest, sentences, summary
from .running import InSteps
from .unwrapping import unwrap_targets

last_outcomes = latest


class QH_OT_unwrap(InSteps, properties.OperatorProperties, bpy.types.Operator):
    """Unwrap the selected faces, in Object Mode all faces, with little distortion and without flipping any"""

    bl_idname = "uv.qh_unwrap"
    bl_label = "Quasi-Harmonic Unwrap"
    bl_options = {'REGISTER', 'UNDO'}

    @classmethod
    def poll(cls, context):
        if selection.mesh_objects(context):
            return True
        cls.poll_message_set(
            "Needs a mesh in Edit Mode or selected meshes in Object Mode, not linked from another file"
        )
        return False

    def draw(self, _context):
        properties.draw(self.layout, self)

    def invoke(self, context, event):
        """From a menu: with the panel's settings.  Scripts come to `execute`, with the defaults."""
        self.take_unset_from(context.scene.qh_unwrap)
        return super().invoke(context, event)

    def begin(self, context):
        targets = selection.targets(context)
        if not targets:
            self.report({'ERROR'}, selection.nothing_selected(context))
            return None
        try:
            settings, options = self.settings(), self.mesh_options()
            settings.check_together()
        except SettingsError as error:
            self.report({'ERROR'}, str(error))
            return None
        return unwrap_targets(targets, settings, options, context)

    def finish(self, outcomes):
        errors = error_sentences(outcomes)
        for sentence in (*(errors if len(errors) > 1 else ()), *sentences(outcomes)):
            self.report({'INFO'}, sentence)
        failed = sum(bool(outcome.error) for outcome in outcomes)
        if failed == len(outcomes):
            self.report({'ERROR'}, summary(outcomes))
            return {'CANCELLED'}
        clean = not failed and all(outcome.is_clean for outcome in outcomes)
        self.report({'INFO'} if clean else {'WARNING'}, summary(outcomes))
        return {'FINISHED'}
