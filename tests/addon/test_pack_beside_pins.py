# SPDX-License-Identifier: GPL-3.0-or-later
"""Pack leaves the place to islands that are held, and no one is told to pack what has just been packed."""

import bmesh
import bpy
import numpy as np
import pytest
from scenes import add_grid, edit_mode, uvs

from qh_unwrap.addon import operators
from qh_unwrap.addon.outcome import sentences


def pin(obj, vertices=(0,)):
    """Pin all corners of these vertices."""
    bpy.ops.object.select_all(action='DESELECT')
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode='EDIT')
    bm = bmesh.from_edit_mesh(obj.data)
    for vertex in bm.verts:
        for loop in vertex.link_loops:
            loop[bm.loops.layers.uv.active].pin_uv = vertex.index in vertices
    bpy.ops.object.mode_set(mode='OBJECT')


def scene(shift=(0, 0)):
    """Three grids, the first of them with a pin, on the same image; its map is moved by `shift`."""
    objects = [add_grid(4, f"Grid {k}", location=(3 * k, 0, 0)) for k in range(3)]
    material = bpy.data.materials.new("Paint")
    for obj in objects:
        obj.data.materials.append(material)
    pinned = objects[0]
    pinned.data.uv_layers[0].uv.foreach_set("vector", (uvs(pinned) + shift).astype(np.float32).ravel())
    pin(pinned)
    for obj in objects:
        obj.select_set(True)
    return objects


def test_others_are_packed_beside_a_pinned_island():
    pinned, *others = scene()
    assert bpy.ops.uv.qh_unwrap(placement='PACK') == {'FINISHED'}
    assert uvs(pinned)[:, 0].max() < 1.1
    tile = int(np.ceil(uvs(pinned)[:, 0].max() - 1e-6))
    for obj in others:
        low, high = uvs(obj).min(axis=0), uvs(obj).max(axis=0)
        assert low[0] >= tile and high[0] <= tile + 1 and low[1] >= 0 and high[1] <= 1
    assert not any(outcome.overlaps for outcome in operators.last_outcomes)
    assert list(sentences(operators.last_outcomes)) == [
        "2 islands (first: Grid 1): it is packed beside the square, in which pinned islands lie"
    ]


@pytest.mark.parametrize("shift", [(0, 5), (3, 0), (-2, 0)])
def test_a_pinned_island_elsewhere_is_in_nobodys_way(shift):
    _, *others = scene(shift)
    bpy.ops.uv.qh_unwrap(placement='PACK')
    for obj in others:
        assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1
    assert not list(sentences(operators.last_outcomes))


def test_a_pinned_island_on_another_image_is_in_nobodys_way():
    pinned, *others = scene()
    pinned.data.materials[0] = bpy.data.materials.new("Other Paint")
    bpy.ops.uv.qh_unwrap(placement='PACK')
    for obj in others:
        assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1
    assert not list(sentences(operators.last_outcomes))


@pytest.mark.parametrize("placement", ['PACK', 'ORIGINAL'])
def test_packing_is_not_advised_where_it_does_not_help(placement):
    """A part of the map lies on the rest, which packing leaves alone."""
    add_grid(6)
    edit_mode(lambda _, face: face < 18)
    bpy.ops.uv.qh_unwrap(placement=placement, boundary='CIRCLE')
    assert list(sentences(operators.last_outcomes)) == [
        "Grid (18 faces) lies on other faces of Grid now: move it to a free place"
    ]
