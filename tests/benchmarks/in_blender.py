# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrapping a mesh in Blender as an artist does, by our operator and by Blender's own; needs bpy.

The mesh is in Edit Mode with all of its faces selected and without UVs.  Timed is the call of the operator, with its
reading, packing and writing, and ours includes its check for flips.
"""

import os
import sys
import time
from contextlib import contextmanager, nullcontext

import bpy
import numpy as np

import qh_unwrap

OURS = "QH Unwrap"
ANGLE_BASED, CONFORMAL = "Angle Based", "Conformal"
STRETCH_10, STRETCH_50 = "Minimum Stretch 10", "Minimum Stretch 50"
NATIVE = {
    ANGLE_BASED: {"method": "ANGLE_BASED"},
    CONFORMAL: {"method": "CONFORMAL"},
    STRETCH_10: {"method": "MINIMUM_STRETCH", "iterations": 10},
    STRETCH_50: {"method": "MINIMUM_STRETCH", "iterations": 50},
}


@contextmanager
def extension():
    """Our operator is there."""
    qh_unwrap.register()
    try:
        yield
    finally:
        qh_unwrap.unregister()


def unwrapped(mesh, method=OURS, around=nullcontext(), **settings):  # noqa: B008 (it keeps no state)
    """Seconds that a method, ours with these settings, takes on the mesh, and the UVs (n, 2) of its vertices as stored.

    The UVs are None if the operator fails.  The context manager `around` is entered for the call alone.
    """
    data = _in_edit_mode(*mesh)
    begun = time.perf_counter()
    try:
        with _silence(), around:
            if method == OURS:
                bpy.ops.uv.qh_unwrap(**settings)
            else:
                bpy.ops.uv.unwrap(**NATIVE[method], fill_holes=True, correct_aspect=False, margin=0)
    except RuntimeError as error:
        print(f"{method}: {error}")
        return time.perf_counter() - begun, None
    seconds = time.perf_counter() - begun
    bpy.ops.object.mode_set(mode='OBJECT')
    corners = np.empty(2 * len(data.loops), np.float32)
    data.uv_layers.active.uv.foreach_get("vector", corners)
    uv = np.zeros((len(mesh[0]), 2))
    uv[mesh[1].ravel()] = corners.reshape(-1, 2)
    return seconds, uv


@contextmanager
def _silence():
    """What Blender prints of its operators' reports goes nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _in_edit_mode(vertices, triangles):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.meshes.new("mesh")
    data.vertices.add(len(vertices))
    data.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    data.loops.add(triangles.size)
    data.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    data.polygons.add(len(triangles))
    data.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    data.update(calc_edges=True)
    obj = bpy.data.objects.new("mesh", data)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    return data
