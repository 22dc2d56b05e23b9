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

import qh_unwrap
from qh_unwrap.core import distortion

from .common import find_mesh, load_mesh, table
from .generated import hills

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


if __name__ == "__main__":
    main()
