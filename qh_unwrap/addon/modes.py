# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaving Edit Mode, or any mode, for a while, and coming back to it with everything as it was."""

from contextlib import contextmanager, suppress
from typing import NamedTuple

import bpy


class Left(NamedTuple):
    """What `come_back` needs to know."""

    view_layer: bpy.types.ViewLayer
    modes: dict  # of the objects that were not in Object Mode
    active: bpy.types.Object | None


@contextmanager
def in_object_mode(context):
    """Leave Edit Mode for a moment.

    The same objects return to it, hidden or not selectable as they may be, and the same are selected and active.
    """
    left = leave(context.view_layer, {'EDIT'})
    try:
        yield
    finally:
        come_back(left)


def leave(view_layer, modes=None):
    """Have all objects, or those in one of the modes, in Object Mode."""
    inside = {obj: obj.mode for obj in view_layer.objects if obj.mode != 'OBJECT' and (not modes or obj.mode in modes)}
    left = Left(view_layer, inside, view_layer.objects.active)
    for obj in sorted(inside, key=lambda obj: obj != left.active):
        if obj.mode != 'OBJECT':  # else it has left it together with another one
            view_layer.objects.active = obj
            bpy.ops.object.mode_set(mode='OBJECT')
    return left


def come_back(left):
    """Have them in their modes again."""
    view_layer, modes, active = left
    if not modes:
        return
    returning = set(modes)
    bystanders = [obj for obj in view_layer.objects.selected if obj not in returning]
    _select(bystanders, False, view_layer)  # they would enter the mode as well
    for obj, mode in modes.items():
        if obj.mode != mode:
            _enter(obj, mode, view_layer)
    _select(bystanders, True, view_layer)
    view_layer.objects.active = active


def _select(objects, selected, view_layer):
    for obj in objects:
        obj.select_set(selected, view_layer=view_layer)


def _enter(obj, mode, view_layer):
    view_layer.objects.active = obj
    hidden = obj.hide_viewport
    if hidden:  # Blender does not let it in, though it may stay there
        obj.hide_viewport = False
    refusals = () if mode == 'EDIT' else (RuntimeError,)  # not every object can be painted on, say
    with suppress(*refusals):
        bpy.ops.object.mode_set(mode=mode)
    if hidden:
        obj.hide_viewport = True
