# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that can go wrong: an island fails alone and is named, and what it belongs to stays as it was."""

import bpy  # isort: skip
import os
from pathlib import Path

import bmesh
import numpy as np
import pytest
from scenes import add_cube, add_grid, changes, edit_mode, mesh_object, snapshot, uvs

from qh_unwrap.addon import files, mesh_arrays, operators
from qh_unwrap.addon.outcome import summary
from qh_unwrap.core import memory

_MESHES = os.environ.get("QH_MESHES")


def set_uvs(obj, values):
    obj.data.uv_layers.active.uv.foreach_set("vector", np.asarray(values, dtype=np.float32).ravel())


def closed():
    return add_cube()


def torus():
    bpy.ops.mesh.primitive_torus_add(major_segments=8, minor_segments=6)
    bpy.context.object.data.polygons[0].hide = True  # a puncture
    return bpy.context.object


def not_a_number():
    obj = add_grid(3)
    obj.data.vertices[5].co.x = np.nan
    return obj


def flat_to_a_line():
    obj = add_grid(3)
    for vertex in obj.data.vertices:
        vertex.co = (vertex.co.x, 0, 0)
    return obj


def scaled_to_nothing():
    obj = add_grid(3)
    obj.scale = (0, 0, 0)
    bpy.context.view_layer.update()
    return obj


def without_uvs():
    return add_grid(3, uv=False)


def self_crossing():
    obj = add_grid(3)
    values = uvs(obj)
    values[(values > 0.99).all(axis=1)] = (0.5, -0.4)
    set_uvs(obj, values)
    return obj


def no_area():
    obj = add_grid(3)
    set_uvs(obj, uvs(obj) * (1, 0))
    return obj


def uv_that_is_no_number():
    obj = add_grid(3)
    values = uvs(obj)
    values[5] = np.nan
    set_uvs(obj, values)
    return obj


def uvs_in_one_point():
    obj = add_grid(3)
    set_uvs(obj, uvs(obj) * 0 + 0.5)
    return obj


def pinned():
    obj = add_grid(3)
    bpy.ops.object.mode_set(mode='EDIT')
    bm = bmesh.from_edit_mesh(obj.data)
    for loop in next(iter(bm.verts)).link_loops:
        loop[bm.loops.layers.uv.active].pin_uv = True
    bpy.ops.object.mode_set(mode='OBJECT')
    return obj


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (closed, {}, " is closed: mark a seam to cut it open"),
        (torus, {}, " has 1 handle, like a torus: mark seams to cut it open"),
        (not_a_number, {}, "1 vertex has coordinates that are no numbers"),
        (flat_to_a_line, {}, "all its faces have zero area"),
        (scaled_to_nothing, {}, "all its faces have zero area"),
        (without_uvs, {"boundary": 'KEEP'}, "a kept boundary needs UVs, and there are none"),
        (without_uvs, {"initial": 'CURRENT', "boundary": 'CIRCLE'}, "to start from the current UVs there must be some"),
        (uv_that_is_no_number, {"boundary": 'KEEP'}, "some of its UVs are no numbers: unwrap it with another boundary"),
        (uv_that_is_no_number, {"initial": 'CURRENT'}, "some of its UVs are no numbers: choose another start"),
        (uvs_in_one_point, {"boundary": 'KEEP'}, "all its UVs are in one place: unwrap it with another boundary"),
        (self_crossing, {"boundary": 'KEEP'}, "the UVs' outline crosses itself"),
        (no_area, {"boundary": 'KEEP'}, "outline encloses no area"),
        (pinned, {"boundary": 'CIRCLE'}, "pins need the boundary"),
        (pinned, {"boundary": 'RECTANGLE'}, "pin four, or none"),
        (pinned, {"boundary": 'OUTLINE'}, "pins need the boundary"),
    ],
)
@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_error_names_the_island_and_changes_nothing(make, options, message, mode):
    obj = make()
    faces = sum(not polygon.hide for polygon in obj.data.polygons)
    if mode == 'EDIT':
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
    before = snapshot(obj)
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.uv.qh_unwrap(**options)
    text = str(caught.value)
    assert message in text and f"{obj.name} ({faces} face" in text
    assert not changes(before, snapshot(obj))


def test_the_others_go_on():
    grid, cube, broken = add_grid(3, "Sheet"), add_cube(), not_a_number()
    before = snapshot(cube), snapshot(broken)
    for obj in (grid, cube, broken):
        obj.select_set(True)
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert (snapshot(cube), snapshot(broken)) == before
    line = summary(operators.last_outcomes)
    assert line.startswith("1 island, stretch ") and ", no flips; 2 skipped: " in line and "(and 1 more)" in line


def test_memory_beyond_what_is_free(monkeypatch):
    obj = add_grid(3)
    before = snapshot(obj)
    monkeypatch.setattr(memory, "free", lambda: 16 * memory._PER_VERTEX - 1)
    with pytest.raises(RuntimeError, match=r"Grid \(9 faces\) needs about .* GB of memory"):
        bpy.ops.uv.qh_unwrap()
    assert not changes(before, snapshot(obj))
    monkeypatch.setattr(memory, "free", lambda: None)
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}, "where the system does not say, it is tried"


def test_free_memory_is_plausible():
    free = memory.free()
    assert free is None or 1e7 < free < 1e15


def test_map_that_blender_does_not_add(monkeypatch):
    obj = add_grid(3, uv=False)
    monkeypatch.setattr(mesh_arrays, "_active_or_new_map", lambda mesh: None)
    with pytest.raises(RuntimeError, match="could not add a UV map: remove one"):
        bpy.ops.uv.qh_unwrap()
    assert not obj.data.uv_layers


def test_more_than_two_faces_at_an_edge_warns():
    points = [(0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 0), (-1, 0, 0), (-1, 1, 0), (0, 0, 1), (0, 1, 1)]
    mesh_object("Fin", points, [[0, 2, 3, 1], [1, 5, 4, 0], [0, 1, 7, 6]])
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    for outcome in operators.last_outcomes:
        assert outcome.warnings == ("it ends at 1 edge where more than two faces meet",)
    assert len(operators.last_outcomes) == 3


def test_loose_vertices_and_a_face_without_area():
    points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (2, 1, 0), (9, 9, 9), (8, 8, 8)]
    obj = mesh_object("Loose", points, [[0, 1, 2], [0, 2, 4, 3]])
    obj.data.edges.add(1)
    obj.data.edges[-1].vertices = (5, 6)
    obj.data.update()
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert outcome.warnings == ("1 face has zero area",) and outcome.after.flips == 0


# Files that are broken


@pytest.fixture
def broken():
    if not _MESHES:
        pytest.skip("QH_MESHES is not set")

    def load(name):
        (obj,) = files.load(Path(_MESHES, "broken", f"{name}.obj"))
        for other in bpy.context.scene.objects:
            other.select_set(other == obj)
        return obj

    return load


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("punctured_torus_g1", "like a torus: mark seams"),
        ("cat_closed_slivers", "is closed: mark a seam"),
    ],
)
def test_broken_file_is_left_alone(broken, name, message):
    obj = broken(name)
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.uv.qh_unwrap()
    assert not changes(before, snapshot(obj))


def test_zero_area_is_unwrapped_with_a_warning(broken):
    broken("bad_zero_area_48")
    assert bpy.ops.uv.qh_unwrap(iterations=1) == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert not outcome.error and outcome.injective
    assert "4 faces have zero area" in outcome.warnings, "two of them but for rounding"


def test_toy_is_unwrapped_with_a_warning_once_it_has_a_seam(broken):
    """It is closed, with one face more at one edge."""
    obj = broken("bad_nonmanifold_toy")
    obj.data.uv_layers.new()
    before = uvs(obj)
    assert bpy.ops.uv.qh_unwrap(iterations=1) == {'FINISHED'}
    large, fin = operators.last_outcomes
    assert fin.faces == 1 and fin.is_clean and "more than two faces meet" in fin.warnings[0]
    assert large.faces == len(obj.data.polygons) - 1
    cure = f"{obj.name}, island 1 ({large.faces} faces) is closed: mark a seam to cut it open"
    assert summary(operators.last_outcomes).endswith(f"; 1 skipped: {cure}")
    unchanged = (uvs(obj) == before).all(axis=1)
    assert unchanged.sum() >= len(unchanged) - 3, "only the fin has moved"
    seams = [edge for edge in obj.data.edges if 0 in edge.vertices][:2]
    for edge in seams:
        edge.use_seam = True
    bpy.ops.uv.qh_unwrap(iterations=1)
    large, fin = operators.last_outcomes
    assert not large.error and "it ends at 1 edge where more than two faces meet" in large.warnings


def test_inverted_triangles_are_turned(broken):
    broken("bad_inverted_triangles")
    assert bpy.ops.uv.qh_unwrap(iterations=1) == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert "10408 faces are inside out: turned for the unwrap" in outcome.warnings and outcome.is_clean


def test_vierbein_is_unwrapped_though_it_is_not_wound_alike(broken):
    broken("bad_nonmanifold_vierbein")
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert len(operators.last_outcomes) == 6 and all(outcome.is_clean for outcome in operators.last_outcomes)
    assert all("more than two faces meet" in outcome.warnings[-1] for outcome in operators.last_outcomes)
    turned = [outcome.warnings[0] for outcome in operators.last_outcomes if "inside out" in outcome.warnings[0]]
    assert turned == [f"{number} faces are inside out: turned for the unwrap" for number in (2, 8)]


def test_nothing_is_selected():
    obj = add_grid(3)
    edit_mode(lambda *_: False)
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="No faces are selected"):
        bpy.ops.uv.qh_unwrap()
    assert not changes(before, snapshot(obj))
