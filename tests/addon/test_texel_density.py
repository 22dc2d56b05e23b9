# SPDX-License-Identifier: GPL-3.0-or-later
"""Islands that end at a texel density that is given, or keep the one that they have."""

import bpy
import numpy as np
import pytest
from scenes import add_grid, edit_mode, uvs
from test_check import image, put

import qh_unwrap


def densities(**options):
    assert bpy.ops.uv.qh_unwrap(**options) == {'FINISHED'}
    return [each["texel_density"] for each in qh_unwrap.last_report()]


def cut_grid(seams=(2,)):
    """A bent grid of 6 by 6 quads, cut into strips at these columns."""
    obj = add_grid(6)
    for edge in obj.data.edges:
        x = [obj.data.vertices[vertex].co.x for vertex in edge.vertices]
        edge.use_seam = any(
            abs(value - (column / 3 - 1)) < 1e-5 for column in seams for value in [max(x)] if x[0] == x[1]
        )
    return obj


def boxes_overlap():
    checked = bpy.ops.uv.qh_check() and qh_unwrap.last_report()
    return any(each["overlaps"] for each in checked)


@pytest.mark.parametrize("placement", ['ORIGINAL', 'PACK', 'UNIT'])
def test_a_given_density_is_reached(placement):
    obj = cut_grid()
    image(obj, 1024, 512)
    found = densities(placement=placement, texel_density='GIVEN', pixels_per_metre=200)
    assert len(found) == 2 and found == pytest.approx([200, 200], rel=1e-4)
    if placement == 'PACK':
        assert not boxes_overlap()


@pytest.mark.parametrize("placement", ['ORIGINAL', 'PACK'])
def test_new_islands_get_it_too_and_too_large_ones_are_told(placement):
    obj = cut_grid()
    image(obj)
    put(obj, np.zeros((144, 2)))
    found = densities(placement=placement, texel_density='GIVEN', pixels_per_metre=2000)
    assert found == pytest.approx([2000, 2000], rel=1e-4)
    assert all("need more room" in each["warnings"][0] for each in qh_unwrap.last_report())
    assert not boxes_overlap()


def test_islands_keep_the_density_that_they_have_where_they_are_packed():
    obj = cut_grid()
    image(obj)
    densities()
    uv = uvs(obj)
    left = np.repeat([face.center.x < -0.3334 for face in obj.data.polygons], 4)
    uv[left] *= 0.3
    put(obj, uv)
    before = {
        len(each["face_indices"]): each["texel_density"] for each in bpy.ops.uv.qh_check() and qh_unwrap.last_report()
    }
    assert len(before) == 2
    densities(placement='PACK', texel_density='KEEP')
    after = {len(each["face_indices"]): each["texel_density"] for each in qh_unwrap.last_report()}
    assert after == pytest.approx(before, rel=1e-3)
    assert not boxes_overlap()
    as_placed = densities(placement='PACK')
    assert as_placed[0] == pytest.approx(as_placed[1], rel=1e-3)


def test_the_image_of_each_island_counts():
    obj = cut_grid()
    image(obj, 256, 256)
    image(obj, 1024, 1024)
    for face in obj.data.polygons:
        face.material_index = int(face.center.x < -0.3334)
    for placement in ('ORIGINAL', 'PACK'):
        assert densities(placement=placement, texel_density='GIVEN', pixels_per_metre=100) == pytest.approx(
            [100, 100], rel=1e-4
        )


def test_without_an_image_one_of_the_given_size_is_meant():
    obj = cut_grid(())
    densities(texel_density='GIVEN', pixels_per_metre=300, image_size=2048)
    image(obj, 2048, 2048)
    bpy.ops.uv.qh_check()
    assert qh_unwrap.last_report()[0]["texel_density"] == pytest.approx(300, rel=1e-4)


def test_what_is_held_stays_and_says_so():
    obj = cut_grid(())
    image(obj)
    (before,) = densities()
    (after,) = densities(boundary='KEEP', texel_density='GIVEN', pixels_per_metre=before / 3)
    assert after == pytest.approx(before, rel=0.05)
    assert "its texel density stays, since pins or its outline hold it" in qh_unwrap.last_report()[0]["warnings"]


def test_as_placed_is_as_it_was():
    obj = cut_grid()
    edit_mode(lambda *_: True)
    bpy.ops.uv.qh_unwrap(placement='PACK')
    expected = uvs(obj)
    bpy.ops.uv.qh_unwrap(placement='PACK', pixels_per_metre=3, image_size=7)
    assert np.allclose(uvs(obj), expected, atol=1e-5)


def test_relaxed_islands_get_it_where_their_outlines_may_move():
    obj = add_grid(6)
    image(obj, 1024, 512)
    settings = bpy.context.scene.qh_unwrap
    settings.texel_density, settings.pixels_per_metre = 'GIVEN', 200
    before = uvs(obj)
    bpy.ops.uv.qh_relax()
    (island,) = qh_unwrap.last_report()
    assert any("its texel density stays" in text for text in island["warnings"]) and island["texel_density"] > 300
    bpy.ops.uv.qh_relax(move_outline=True)
    (island,) = qh_unwrap.last_report()
    assert island["texel_density"] == pytest.approx(200, rel=1e-4) and not island["warnings"]
    assert uvs(obj).mean(axis=0) == pytest.approx(before.mean(axis=0), abs=0.05)
