# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np
import pytest
from scenes import add_grid, uvs
from scipy.spatial import Delaunay

from qh_unwrap.addon import placing


def set_uvs(obj, values):
    obj.data.uv_layers.active.uv.foreach_set("vector", np.asarray(values, dtype=np.float32).ravel())


def turned(uv, angle, scale, shift):
    c, s = np.cos(angle), np.sin(angle)
    return scale * uv @ np.array([[c, s], [-s, c]]) + shift


def area_and_centre(obj, faces=slice(None)):
    quads = uvs(obj).astype(float).reshape(-1, 4, 2)[faces]
    x, y = quads.transpose(2, 0, 1)
    areas = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2
    return areas.sum(), areas @ quads.mean(axis=1) / areas.sum()


def overlap(one, other):
    """Whether two convex islands overlap."""
    return (Delaunay(one).find_simplex(other) >= 0).any() or (Delaunay(other).find_simplex(one) >= 0).any()


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_original_keeps_centre_area_and_turn(angle):
    obj = add_grid(6)
    set_uvs(obj, turned(uvs(obj), angle, 0.3, (2.2, -1.4)))
    old_area, old_centre = area_and_centre(obj)
    old = uvs(obj)
    bpy.ops.uv.qh_unwrap()
    area, centre = area_and_centre(obj)
    assert area == pytest.approx(old_area, rel=1e-4)
    assert np.allclose(centre, old_centre, atol=0.01)
    z, w = ((uv - uv.mean(axis=0)) @ (1, 1j) for uv in (uvs(obj), old))
    assert abs(np.angle(np.vdot(z, w))) < 0.02


def test_in_place_undoes_any_similarity():
    random = np.random.default_rng(1)
    uv, triangles = random.random((5, 2)), np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4)])
    moved = turned(uv, 2.0, 3.7, (5, -8))
    assert np.allclose(placing.in_place(moved, triangles, uv[triangles]), uv)


def test_new_islands_are_packed_in_the_unit_square():
    one, other = add_grid(4, "One", uv=False), add_grid(4, "Other", uv=False, location=(3, 0, 0))
    other.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    bpy.ops.uv.qh_unwrap()
    both = [uvs(one), uvs(other)]
    assert min(uv.min() for uv in both) >= 0 and max(uv.max() for uv in both) <= 1
    assert not overlap(*both)
    (small, _), (large, _) = area_and_centre(one), area_and_centre(other)
    assert large / small == pytest.approx(4, rel=0.02), "the same texel density"


def test_reset_uvs_say_nothing_about_the_place():
    """A map as Blender's + button makes it: every face fills the square."""
    obj = add_grid(8, uv=False)
    obj.data.uv_layers.new(name="UVMap")
    bpy.ops.uv.qh_unwrap()
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1


def test_pack_moves_islands_with_uvs_too():
    one, other = add_grid(4, "One"), add_grid(4, "Other", location=(3, 0, 0))
    bpy.ops.uv.qh_unwrap(placement='ORIGINAL')
    assert overlap(uvs(one), uvs(other)), "both were in the same place"
    bpy.ops.uv.qh_unwrap(placement='PACK')
    assert not overlap(uvs(one), uvs(other))


@pytest.mark.parametrize("boundary", ['CIRCLE', 'RECTANGLE', 'OUTLINE'])
def test_unit_fills_the_square(boundary):
    one, other = add_grid(4, "One"), add_grid(6, "Other", location=(3, 0, 0))
    bpy.ops.uv.qh_unwrap(boundary=boundary, placement='UNIT')
    for obj in (one, other):
        assert np.ptp(uvs(obj), axis=0).max() == pytest.approx(1)
        assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1


def test_packing_in_edit_mode_leaves_others_alone():
    obj = add_grid(4)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    assert bpy.ops.uv.qh_unwrap(placement='PACK') == {'FINISHED'}
    assert obj.mode == 'EDIT' and not bpy.context.scene.tool_settings.use_uv_select_sync
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1
