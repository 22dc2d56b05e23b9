# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's new UV map gives every face the whole square: such faces count as having no UVs."""

import bpy
import numpy as np
import pytest
from scenes import add_grid, edit_mode, mesh_object, uvs

from qh_unwrap.addon import mesh_arrays, operators
from qh_unwrap.core.overlaps import overlapping


def boxes(*sizes):
    """Cubes of these sizes in one mesh, every edge a seam."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    points = np.concatenate([size * corners + (3 * k, 0, 0) for k, size in enumerate(sizes)])
    obj = mesh_object("Boxes", points.tolist(), np.concatenate([sides + 8 * k for k in range(len(sizes))]).tolist())
    for edge in obj.data.edges:
        edge.use_seam = True
    return obj


def quads(obj):
    """The faces' UVs as islands of two triangles."""
    corners = uvs(obj).astype(float).reshape(-1, 4, 2)
    return list(corners[:, [[0, 1, 2], [0, 2, 3]]])


@pytest.mark.parametrize("size", [3, 4, 5, 8])
def test_fresh_faces_are_known_whatever_their_size(size):
    angle = 2 * np.pi * np.arange(size) / size
    points = [(3 * k + np.cos(a), np.sin(a), 0) for k in range(2) for a in angle]
    obj = mesh_object("Two", points, [list(range(size)), list(range(size, 2 * size))])
    assert not mesh_arrays.read(obj).fresh.any(), "there is no map"
    obj.data.uv_layers.new()
    assert mesh_arrays.read(obj).fresh.all()
    bpy.ops.object.mode_set(mode='EDIT')
    assert mesh_arrays.read(obj).fresh.all()
    bpy.ops.object.mode_set(mode='OBJECT')
    values = uvs(obj)
    values[0] += 0.001
    obj.data.uv_layers[0].uv.foreach_set("vector", values.ravel())
    assert not mesh_arrays.read(obj).fresh.any(), "one alone may lie so on purpose"


@pytest.mark.parametrize("mode", ['EDIT', 'OBJECT'])
def test_faces_of_a_new_map_are_packed(mode):
    obj = boxes(1, 0.1)
    obj.data.uv_layers.new()
    if mode == 'EDIT':
        edit_mode()
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert not overlapping(quads(obj)), "nothing is stacked"
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1
    areas = [np.prod(np.ptp(quad.reshape(-1, 2), axis=0)) for quad in quads(obj)]
    assert np.mean(areas[:6]) / np.mean(areas[6:]) == pytest.approx(100, rel=0.05), "and texels are equally dense"
    assert all(outcome.before is None and outcome.is_clean for outcome in operators.last_outcomes)


def test_the_same_as_without_a_map():
    found = []
    for new in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True)
        obj = boxes(1, 0.5)
        if new:
            obj.data.uv_layers.new()
        bpy.ops.uv.qh_unwrap()
        found.append(uvs(obj))
    assert np.allclose(*found, atol=1e-6)


def test_a_face_that_fills_the_square_on_purpose_stays():
    obj = add_grid(1, "Sign")
    for other in (add_grid(4, "Panel", location=(5, 0, 0)), obj):
        other.select_set(True)
    before = uvs(obj)
    bpy.ops.uv.qh_unwrap()
    assert np.allclose(np.sort(uvs(obj), axis=0), np.sort(before, axis=0), atol=0.05)


def test_keep_and_pins_take_what_there_is():
    obj = boxes(1)
    obj.data.uv_layers.new()
    before = uvs(obj)
    assert bpy.ops.uv.qh_unwrap(boundary='KEEP') == {'FINISHED'}
    assert np.array_equal(uvs(obj), before)


def test_fresh_faces_that_are_not_unwrapped_take_no_place():
    """The square is free, although what is left of the new map fills it."""
    obj = boxes(1)
    obj.data.uv_layers.new()
    edit_mode(lambda _, face: face < 3)
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert uvs(obj)[:12].min() >= 0 and uvs(obj)[:12].max() <= 1
    assert not any(outcome.overlaps for outcome in operators.last_outcomes)
