# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that unwraps."""

import bpy

from ..core.errors import SettingsError
from . import properties, selection
from .outcome import sentences, summary
from .unwrapping import unwrap_targets

last_outcomes = []  # of the latest run, for the panels


class QH_OT_unwrap(properties.OperatorProperties, bpy.types.Operator):
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

    def invoke(self, context, _event):
        """From a menu: with the panel's settings.  Scripts come to `execute`, with the defaults."""
        self.take_unset_from(context.scene.qh_unwrap)
        return self.execute(context)

    def execute(self, context):
        targets = selection.targets(context)
        if not targets:
            self.report({'ERROR'}, selection.nothing_selected(context))
            return {'CANCELLED'}
        try:
            settings, options = self.settings(), self.mesh_options()
        except SettingsError as error:
            self.report({'ERROR'}, str(error))
            return {'CANCELLED'}
        outcomes = _with_progress(context.window_manager, unwrap_targets(targets, settings, options, context))
        last_outcomes[:] = outcomes
        for sentence in sentences(outcomes):
            self.report({'INFO'}, sentence)
        failed = sum(bool(outcome.error) for outcome in outcomes)
        if failed == len(outcomes):
            self.report({'ERROR'}, summary(outcomes))
            return {'CANCELLED'}
        clean = not failed and all(outcome.is_clean for outcome in outcomes)
        self.report({'INFO'} if clean else {'WARNING'}, summary(outcomes))
        return {'FINISHED'}


def _with_progress(window_manager, steps):
    """Run the steps to the end while the mouse pointer shows how far they are; returns what they return."""
    window_manager.progress_begin(0, 1)
    try:
        while True:
            done, total = next(steps)
            window_manager.progress_update(done / total)
    except StopIteration as stop:
        return stop.value
    finally:
        window_manager.progress_end()
