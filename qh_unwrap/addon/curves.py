# SPDX-License-Identifier: GPL-3.0-or-later
"""The animation in the open file, in Blender with and without slots."""

import bpy
import numpy as np


def of(action):
    """The F-curves of an action, of all its slots."""
    if not hasattr(action, "layers"):  # before Blender 4.4
        return list(action.fcurves)
    strips = [strip for layer in action.layers for strip in layer.strips]
    return [curve for strip in strips for bag in strip.channelbags for curve in bag.fcurves]


def frames():
    """(n,) the frames of all keyframes, as floats."""
    found = [np.empty(0)]
    for action in bpy.data.actions:
        for curve in of(action):
            points = np.empty(2 * len(curve.keyframe_points), dtype=np.float32)
            curve.keyframe_points.foreach_get("co", points)
            found.append(points[::2].astype(float))
    return np.unique(np.concatenate(found))


def is_animated():
    """Whether anything moves, by actions or by what comes out of another file as it goes."""
    return bool(bpy.data.actions or bpy.data.cache_files)


def fits(action, owner):
    """Whether all that the action animates is there."""
    try:
        for curve in of(action):
            owner.path_resolve(curve.data_path)
    except ValueError:
        return False
    return True
