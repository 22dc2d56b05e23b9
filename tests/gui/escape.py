# SPDX-License-Identifier: GPL-3.0-or-later
"""How soon Esc is heard in Blender's window while large meshes are unwrapped.

Not a pytest file: a harness that runs inside Blender calls `steps(gui)`, as it does with `driver.py`.  Each mesh is
unwrapped several times, and Esc pressed at another moment each time; the seconds until the operator has ended are
printed.
"""

import time

import bpy
from driver import is_running, put_alone, wavy_sheet

SIDES = {388: (0.3, 1, 2, 3, 4), 707: (1, 3, 6, 9, 12, 15)}  # quads of a wavy sheet: seconds until Esc is pressed


def steps(gui):
    gui.workspace("UV Editing")
    yield 1
    for side, moments in SIDES.items():
        put_alone(gui, wavy_sheet(side), lambda one, other: False)
        yield 10
        for moment in moments:
            with gui.override('VIEW_3D'):
                bpy.ops.uv.qh_unwrap('INVOKE_DEFAULT')
            begun = time.monotonic()
            while time.monotonic() < begun + moment:
                yield 0.05
            if not is_running(gui):
                gui.log(f"{2 * side**2:,} triangles: done before {moment} s")
                break
            pressed = time.monotonic()
            gui.key("Escape")
            while is_running(gui):
                yield 0.01
            heard = time.monotonic() - pressed
            gui.log(f"{2 * side**2:,} triangles: Esc pressed after {moment} s, heard {heard:.2f} s later")
            yield 2
    gui.shot("escape.png")
