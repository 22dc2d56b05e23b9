# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and distortion beside Blender's own methods, on the same meshes, in one process.

Each mesh is in Edit Mode with all of its faces selected and without UVs; timed is the call of the operator, with its
reading, packing and writing, and ours includes its check for flips.  Distortion is measured on the UVs that Blender
stores.  Needs bpy; meshes of QH_MESHES are added to the generated ones.

    python -m tests.benchmarks.against_blender [--sizes 2000,10000] [--minutes 30]
"""

import argparse
import resource
import time
from pathlib import Path

import bpy
import numpy as np
from scipy.spatial import Delaunay

import qh_unwrap
from qh_unwrap.core import distortion

from .common import find_mesh, load_mesh, table

NATIVE = {
    "Angle Based": {"method": "ANGLE_BASED"},
    "Conformal": {"method": "CONFORMAL"},
    "Minimum Stretch 10": {"method": "MINIMUM_STRETCH", "iterations": 10},
    "Minimum Stretch 50": {"method": "MINIMUM_STRETCH", "iterations": 50},
}
OURS = "QH Unwrap"
SCANS = ("venus.obj", "camel_b.obj", "camelhead.off", "mannequin-devil.off", "cowhead.obj", "face_bff.obj")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="2000,10000,30000,100000", help="triangles of the generated meshes")
    parser.add_argument("--minutes", type=float, default=20, help="start no slower method once so much time has gone")
    arguments = parser.parse_args()
    meshes = {f"hills {int(size):,}": hills(int(size)) for size in arguments.sizes.split(",")}
    for name in SCANS:
        if path := find_mesh(name):
            meshes[Path(name).stem] = load_mesh(path)
    qh_unwrap.register()
    try:
        begun = time.time()
        for name, mesh in meshes.items():
            rows = []
            for method in (OURS, *NATIVE):
                if method == "Minimum Stretch 50" and time.time() - begun > 60 * arguments.minutes:
                    continue
                seconds, uv = timed(mesh, method)
                rows.append((method, seconds, distortion(*mesh, uv)))
            ours = rows[0][1]
            print(f"{name}: {len(mesh[1]):,} triangles")
            table(
                ("method", "seconds", "times ours", "L2 stretch", "sym. Dirichlet", "flips"),
                [(method, t, t / ours, d.l2_stretch, d.symmetric_dirichlet, d.flips) for method, t, d in rows],
            )
    finally:
        qh_unwrap.unregister()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"Blender {bpy.app.version_string}, NumPy {np.__version__}; peak memory {peak:.2f} GiB")


def timed(mesh, method):
    """Seconds that the method takes on the mesh, and the UVs of the vertices (n, 2)."""
    vertices, triangles = mesh
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.meshes.new("mesh")
    data.from_pydata(vertices.tolist(), [], triangles.tolist())
    obj = bpy.data.objects.new("mesh", data)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    begun = time.perf_counter()
    if method == OURS:
        bpy.ops.uv.qh_unwrap()
    else:
        bpy.ops.uv.unwrap(**NATIVE[method], fill_holes=True, correct_aspect=False, margin=0)
    seconds = time.perf_counter() - begun
    bpy.ops.object.mode_set(mode='OBJECT')
    corners = np.empty(2 * len(data.loops), np.float32)
    data.uv_layers.active.uv.foreach_get("vector", corners)
    owner = np.empty(len(data.loops), np.int32)
    data.loops.foreach_get("vertex_index", owner)
    uv = np.zeros((len(vertices), 2))
    uv[owner] = corners.reshape(-1, 2)
    return seconds, uv


def hills(triangles, seed=1):
    """A round patch of gentle and steep hills with about so many irregular triangles."""
    rng = np.random.default_rng(seed)
    rim = max(12, int(1.3 * np.sqrt(triangles)))
    inner = (triangles - rim) // 2
    step = np.sqrt(np.pi / inner)
    x, y = np.meshgrid(np.arange(-1, 1, step), np.arange(-1, 1, step))
    plane = np.column_stack([x.ravel(), y.ravel()]) + 0.35 * step * rng.uniform(-1, 1, (x.size, 2))
    plane = plane[np.linalg.norm(plane, axis=1) < 1 - 0.6 * step]
    angle = 2 * np.pi * np.arange(rim) / rim
    plane = np.vstack([plane, np.column_stack([np.cos(angle), np.sin(angle)])])
    plane = plane[rng.permutation(len(plane))]
    faces = Delaunay(plane).simplices
    a, b, c = plane[faces].transpose(1, 0, 2)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    faces[clockwise] = faces[clockwise][:, ::-1]
    x, y = plane.T
    height = np.zeros(len(plane))
    for u, v, tall, width in (
        (0.35, 0.2, 0.9, 0.3),
        (-0.4, 0.3, 0.7, 0.2),
        (-0.1, -0.45, -0.6, 0.25),
        (0.5, -0.5, 0.3, 0.1),
    ):
        height += tall * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * width**2))
    return np.column_stack([x, y, height]), faces


if __name__ == "__main__":
    main()
