# SPDX-License-Identifier: GPL-3.0-or-later
"""How soon Esc is heard in Blender's window while large meshes are unwrapped.

Not a pytest file: a harness that runs inside Blender calls `steps(gui)`, as it does with `driver.py`.  Each mesh is
unwrapped several times, and Esc pressed at another moment each time; the seconds until the operator has ended are
printed.
"""

import time

import bpy
import numpy as np

SIDES = {388: (0.3, 1, 2, 3, 4), 707: (1, 3, 6, 9, 12, 15)}  # quads of a wavy sheet: seconds until Esc is pressed


def steps(gui):
    gui.workspace("UV Editing")
    yield 1
    for side, moments in SIDES.items():
        _add(gui, side)
        yield 10
        for moment in moments:
            with gui.override('VIEW_3D'):
                bpy.ops.uv.qh_unwrap('INVOKE_DEFAULT')
            begun = time.monotonic()
            while time.monotonic() < begun + moment:
                yield 0.05
            if not _is_running(gui):
                gui.log(f"{2 * side**2:,} triangles: done before {moment} s")
                break
            pressed = time.monotonic()
            gui.key("Escape")
            while _is_running(gui):
                yield 0.01
            heard = time.monotonic() - pressed
            gui.log(f"{2 * side**2:,} triangles: Esc pressed after {moment} s, heard {heard:.2f} s later")
            yield 2
    gui.shot("escape.png")


def _is_running(gui):
    return "UV_OT_qh_unwrap" in {operator.bl_idname for operator in gui.window.modal_operators}


def _add(gui, side):
    """A wavy sheet of side x side quads, alone, in Edit Mode with all of it selected."""
    with gui.override('VIEW_3D'):
        if bpy.context.mode != 'OBJECT':
            bpy.ops.object.mode_set(mode='OBJECT')
        for obj in list(bpy.data.objects):
            bpy.data.objects.remove(obj)
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side, calc_uvs=False)
        mesh = bpy.context.object.data
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", points.ravel())
        points[:, 2] = 0.4 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1])
        mesh.vertices.foreach_set("co", points.ravel())
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
