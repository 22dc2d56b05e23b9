# SPDX-License-Identifier: GPL-3.0-or-later
"""
Install a zip into a clean Blender, unwrap with it, take it off again.

    BLENDER_USER_RESOURCES=FOLDER python install_and_unwrap.py ZIP

Runs in an environment with bpy and without SciPy, which only the zip brings.
"""

import importlib.util
import os
import sys
from pathlib import Path

import bpy  # isort: skip  (the wheel knows the others only after this)
import addon_utils
import bmesh
import numpy as np

MODULE = "bl_ext.user_default.qh_unwrap"
FOLDER = os.environ["BLENDER_USER_RESOURCES"]


def main(zip_path):
    assert importlib.util.find_spec("scipy") is None
    bpy.ops.extensions.package_install_files(filepath=zip_path, repo="user_default", enable_on_install=True)
    assert addon_utils.check(MODULE) == (True, True)

    import scipy

    assert Path(scipy.__file__).is_relative_to(FOLDER), scipy.__file__
    unwrap(add_cube())
    unwrap(add_suzanne())

    addon_utils.disable(MODULE, default_set=True)
    assert not traces()
    addon_utils.enable(MODULE, default_set=True)
    assert "UV_OT_qh_unwrap" in traces()
    addon_utils.disable(MODULE, default_set=True)
    assert not traces()
    if bpy.app.version >= (4, 5, 0):  # 4.2.0 leaves the wheel behind, and the bpy wheels of 4.2 then crash as they exit
        repository = [repo.module for repo in bpy.context.preferences.extensions.repos].index("user_default")
        bpy.ops.extensions.package_uninstall(repo_index=repository, pkg_id="qh_unwrap")
        assert not [*Path(FOLDER).rglob("qh_unwrap"), *Path(FOLDER).rglob("scipy")]


def add_cube():
    """Six faces that unfold to a cross."""
    bpy.ops.mesh.primitive_cube_add(calc_uvs=False)
    return mark_seams(lambda one, other: one.z != other.z or (one.z > 0 and one.y + other.y <= 0))


def add_suzanne():
    """Her head cut open at the back, and her eyes."""
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=False)
    return mark_seams(lambda one, other: abs(one.x) + abs(other.x) < 1e-4 and one.y + other.y > -0.5)


def mark_seams(is_seam):
    mesh = bpy.context.object.data
    bm = bmesh.new()
    bm.from_mesh(mesh)
    for edge in bm.edges:
        edge.seam = is_seam(*(vertex.co for vertex in edge.verts))
    bm.to_mesh(mesh)
    bm.free()
    return mesh


def unwrap(mesh):
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    uv = np.empty((len(mesh.loops), 2), dtype=np.float32)
    mesh.uv_layers.active.uv.foreach_get("vector", uv.ravel())
    assert np.isfinite(uv).all()
    areas = []
    for face in mesh.polygons:
        u, v = uv[face.loop_start : face.loop_start + face.loop_total].T
        areas.append((u @ np.roll(v, -1) - v @ np.roll(u, -1)) / 2)
    assert min(areas) > 0, min(areas)


def traces():
    """What Blender knows of the extension."""
    found = {name for name in dir(bpy.types) if "qh" in name.lower()}
    found |= {name for name in dir(bpy.types.Scene) if "qh" in name.lower()}
    drawn = bpy.types.IMAGE_MT_uvs_unwrap._dyn_ui_initialize()
    return found | {draw.__name__ for draw in drawn if MODULE in draw.__module__}


main(sys.argv[1])
