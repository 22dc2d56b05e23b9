# SPDX-License-Identifier: GPL-3.0-or-later
"""
Draws the heatmap of a grid without a window, as Blender 5 can: the pictures are written to the file that is named.

A program of its own, since nobody knows what a graphics driver does to the process that it runs in.
"""

import bpy  # isort: skip
import math
import sys
from types import SimpleNamespace

import gpu
import numpy as np
from mathutils import Matrix
from scenes import add_grid

import qh_unwrap
from qh_unwrap.addon import heat_drawing
from qh_unwrap.addon.heatmap import heatmap

SIDE = 400  # pixels


def main():
    gpu.init()
    qh_unwrap.register()
    try:
        bpy.ops.wm.read_homefile(use_empty=True)
        obj = add_grid(6)
        for loop in obj.data.polygons[0].loop_indices:
            obj.data.uv_layers.active.uv[loop].vector *= 0.1
        bpy.context.scene.qh_heatmap.quantity = 'DENSITY'
        heatmap.turn_on([obj], heat_drawing.add)
        pictures = {
            "map": _drawn(heat_drawing._draw_map, _flat(1), 'IMAGE_EDITOR'),
            "model": _drawn(heat_drawing._draw_model, _seen(1.5), 'VIEW_3D'),
            "legend": _drawn(heat_drawing._draw_legend, _flat(SIDE), 'VIEW_3D'),
        }
    finally:
        qh_unwrap.unregister()
    np.savez(sys.argv[1], **pictures)


def _drawn(draw, projection, editor):
    """What is drawn over grey in a square, (h, w, 3), by a function that asks the context for its editor."""
    heat_drawing.bpy = SimpleNamespace(
        context=SimpleNamespace(
            scene=bpy.context.scene,
            space_data=SimpleNamespace(type=editor, mode='UV'),
            preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0, pixel_size=1.0)),
            region=SimpleNamespace(width=SIDE, height=SIDE, x=0),
            area=SimpleNamespace(regions=[]),
        )
    )
    heat_drawing._is_visible = lambda *_: True
    canvas = gpu.types.GPUOffScreen(SIDE, SIDE)
    with canvas.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(Matrix())
        gpu.matrix.load_projection_matrix(projection)
        frame = gpu.state.active_framebuffer_get()
        frame.clear(color=(0.25, 0.25, 0.25, 1), depth=1)
        before = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
        draw(heatmap)
        assert before == (gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get())
        pixels = frame.read_color(0, 0, SIDE, SIDE, 4, 0, 'UBYTE')
    pixels.dimensions = SIDE * SIDE * 4
    return np.array(pixels, dtype=np.uint8).reshape(SIDE, SIDE, 4)[..., :3]


def _flat(side):
    """The square from 0 to `side` fills the picture."""
    return Matrix(((2 / side, 0, 0, -1), (0, 2 / side, 0, -1), (0, 0, -1, 0), (0, 0, 0, 1)))


def _seen(half):
    """From above, a little turned, the square from `-half` to `half`."""
    return Matrix.Diagonal((1 / half, 1 / half, -0.1, 1)) @ Matrix.Rotation(math.radians(-30), 4, 'X')


main()
