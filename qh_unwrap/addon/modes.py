# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaving Edit Mode for a moment, and coming back to it with everything as it was."""

from contextlib import contextmanager

import bpy


@contextmanager
def in_object_mode(context):
    """Leave Edit Mode for a moment.

    The same objects return to it, hidden or not selectable as they may be, and the same are selected and active.
    """
    view_layer = context.view_layer
    editing = [obj for obj in view_layer.objects if obj.mode == 'EDIT']
    if not editing:
        yield
        return
    active = view_layer.objects.active
    if active not in editing:  # it decides about the mode
        view_layer.objects.active = editing[0]
    bpy.ops.object.mode_set(mode='OBJECT')
    try:
        yield
    finally:
        returning = set(editing)
        bystanders = [obj for obj in view_layer.objects.selected if obj.type == 'MESH' and obj not in returning]
        _select(bystanders, False, view_layer)  # they would enter Edit Mode as well
        for obj in editing:
            if obj.mode != 'EDIT':
                _enter_edit_mode(obj, view_layer)
        _select(bystanders, True, view_layer)
        view_layer.objects.active = active


def _select(objects, selected, view_layer):
    for obj in objects:
        obj.select_set(selected, view_layer=view_layer)


def _enter_edit_mode(obj, view_layer):
    view_layer.objects.active = obj
    hidden = obj.hide_viewport
    if hidden:  # Blender does not let it in, though it may stay there
        obj.hide_viewport = False
    bpy.ops.object.mode_set(mode='EDIT')
    if hidden:
        obj.hide_viewport = True
