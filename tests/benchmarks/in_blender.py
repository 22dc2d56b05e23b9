# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrapping a mesh in Blender as an artist does, by our operator and by Blender's own; needs bpy.

The mesh is in Edit Mode with all of its faces selected and without UVs; those that it comes with say where its seams
are.  Timed is the call of the operator, with its reading, packing and writing, and ours includes its check for flips.
"""

import os
import sys
import time
from contextlib import contextmanager, nullcontext

import bpy
import numpy as np

import qh_unwrap

from .common import Polygons

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


def unwrapped(mesh, method=OURS, around=nullcontext(), again=False, **settings):  # noqa: B008 (it keeps no state)
    """Seconds that a method, ours with these settings, takes on the mesh, and the UVs as stored.

    A mesh of vertices (n, 3) and triangles (m, 3) has the UVs (n, 2) of its vertices, `Polygons` those of its corners.
    The UVs are None if the operator fails.  The context manager `around` is entered for the call alone.  If `again`,
    the mesh already has the UVs of an earlier call.
    """
    polygons = mesh if isinstance(mesh, Polygons) else Polygons.alike(*mesh)
    data = _in_edit_mode(polygons)
    if again:
        with _silence():
            _call(method, settings)
    begun = time.perf_counter()
    try:
        with _silence(), around:
            _call(method, settings)
    except RuntimeError as error:
        print(f"{method}: {error}")
        return time.perf_counter() - begun, None
    seconds = time.perf_counter() - begun
    bpy.ops.object.mode_set(mode='OBJECT')
    corners = np.empty(2 * len(data.loops), np.float32)
    data.uv_layers.active.uv.foreach_get("vector", corners)
    corners = corners.reshape(-1, 2).astype(float)
    if polygons is mesh:
        return seconds, corners
    uv = np.zeros((len(polygons.vertices), 2))
    uv[polygons.corners] = corners
    return seconds, uv


def _call(method, settings):
    if method == OURS:
        bpy.ops.uv.qh_unwrap(**settings)
    else:
        bpy.ops.uv.unwrap(**NATIVE[method], fill_holes=True, correct_aspect=False, margin=0)


def in_turns(mesh, methods, seconds, most=9, again=False):
    """For each method its runs, (seconds, UVs), in turns: as many as take about so long, three if one takes less.  If
    `again`, of meshes that have UVs already."""
    runs = {method: [] for method in methods}
    for _ in range(most):
        for method, done in runs.items():
            longest = max((each for each, _ in done), default=0)
            if not done or (longest < seconds and (len(done) < 3 or (len(done) + 1) * longest < seconds)):
                done.append(unwrapped(mesh, method, again=again))
    return runs


def loop_triangles(polygons):
    """The corners (t, 3) of the triangles that Blender makes of the polygons."""
    data = _as_data(polygons)
    data.calc_loop_triangles()
    triangles = np.empty(3 * len(data.loop_triangles), np.int32)
    data.loop_triangles.foreach_get("loops", triangles)
    bpy.data.meshes.remove(data)
    return triangles.reshape(-1, 3)


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


def _in_edit_mode(polygons):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = _as_data(polygons)
    obj = bpy.data.objects.new("mesh", data)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    if polygons.uv is not None:
        bpy.ops.uv.select_all(action='SELECT')
        bpy.ops.uv.seams_from_islands()
        bpy.ops.mesh.uv_texture_remove()
    return data


def _as_data(polygons):
    data = bpy.data.meshes.new("mesh")
    data.vertices.add(len(polygons.vertices))
    data.vertices.foreach_set("co", polygons.vertices.astype(np.float32).ravel())
    data.loops.add(len(polygons.corners))
    data.loops.foreach_set("vertex_index", polygons.corners.astype(np.int32))
    data.polygons.add(len(polygons.sizes))
    data.polygons.foreach_set("loop_start", (np.cumsum(polygons.sizes) - polygons.sizes).astype(np.int32))
    data.update(calc_edges=True)
    if polygons.uv is not None:
        data.uv_layers.new().uv.foreach_set("vector", polygons.uv.astype(np.float32).ravel())
    return data
