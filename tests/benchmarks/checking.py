# SPDX-License-Identifier: GPL-3.0-or-later
"""How long it takes in Blender to check 300 000 triangles, valid and tangled: `python -m tests.benchmarks.checking`."""

from time import perf_counter, process_time

import bpy
import numpy as np

import qh_unwrap

_SIZE = 388  # quads along a side


def layouts():
    """Yield names, and functions of UVs (c, 2), of the vertices' numbers (c,) and of random numbers, to other UVs."""
    yield "valid", lambda uv, vertex, random: uv
    yield "faces apart", lambda uv, vertex, random: _apart(uv)
    yield "jittered vertices", lambda uv, vertex, random: uv + 0.01 * random.standard_normal(uv.shape)[vertex]
    yield "random vertices", lambda uv, vertex, random: random.random(uv.shape)[vertex]
    yield "random corners", lambda uv, vertex, random: random.random(uv.shape)


def _apart(uv):
    """Every face, of four corners, shrunk around its middle."""
    faces = uv.reshape(-1, 4, 2)
    middle = faces.mean(axis=1, keepdims=True)
    return (middle + 0.9 * (faces - middle)).reshape(-1, 2)


def seconds(change):
    """The seconds on the clock and of computing that the check of a sheet with changed UVs takes, and its islands."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=_SIZE, y_subdivisions=_SIZE, calc_uvs=True)
    mesh = bpy.context.object.data
    vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", vertex)
    uv = np.empty((len(mesh.loops), 2), dtype=np.float32)
    layer = mesh.uv_layers.active.uv
    layer.foreach_get("vector", uv.ravel())
    layer.foreach_set("vector", change(uv, vertex, np.random.default_rng(0)).astype(np.float32).ravel())
    clock, computing = perf_counter(), process_time()
    bpy.ops.uv.qh_check()
    return perf_counter() - clock, process_time() - computing, len(qh_unwrap.addon.outcome.latest)


def main():
    """Print a line for each layout."""
    qh_unwrap.register()
    for name, change in layouts():
        clock, computing, islands = seconds(change)
        print(f"{name}: {2 * _SIZE**2} triangles, {islands} islands: {clock:.1f} s, {computing:.1f} s of computing")
    qh_unwrap.unregister()


if __name__ == "__main__":
    main()
