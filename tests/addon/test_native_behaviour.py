# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's own unwrap does, row by row, beside what ours does: where ours differs, it does so on purpose."""

import bpy  # isort: skip
import contextlib

import bmesh
import numpy as np
import pytest
from scenes import FIVE, add_cube, add_grid, edit_mode, select_uvs, uvs

from qh_unwrap.addon import operators

_PART = {0, 1, 2, 4, 5, 6, 8, 9, 10}  # nine of the sixteen faces of a grid


def native(**options):
    return bpy.ops.uv.unwrap(
        **dict(method='ANGLE_BASED', fill_holes=True, correct_aspect=True, use_subsurf_data=False, margin=0.0) | options
    )


def ours(**options):
    options.pop("method", None)
    return bpy.ops.uv.qh_unwrap(**options)


def corners(obj, faces):
    starts = np.repeat(np.arange(len(obj.data.polygons)), [polygon.loop_total for polygon in obj.data.polygons])
    return np.isin(starts, list(faces))


def is_attached(obj, part):
    """Whether the corners of the part and of the rest have the same UVs where they have the same vertex."""
    inside = corners(obj, part)
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    uv = uvs(obj)
    shared = np.intersect1d(vertex[inside], vertex[~inside])
    return all(np.ptp(uv[vertex == v], axis=0).max() < 1e-6 for v in shared)


@pytest.mark.parametrize(("run", "fills_the_square"), [(native, True), (ours, False)])
def test_part_in_the_3d_view_is_detached(run, fills_the_square):
    """Native packs the part into the whole square, ours puts it where it was."""
    obj = add_grid(4)
    edit_mode(lambda _, face: face in _PART)
    old, inside = uvs(obj), corners(obj, _PART)
    assert run() == {'FINISHED'}
    new = uvs(obj)
    assert np.array_equal(new[~inside], old[~inside])
    assert not is_attached(obj, _PART)
    assert (np.ptp(new[inside], axis=0).max() > 0.99) == fills_the_square
    if run is ours:
        assert np.allclose(new[inside].mean(axis=0), old[inside].mean(axis=0), atol=0.02)


@pytest.mark.parametrize("sync", [False, True])
@pytest.mark.parametrize("run", [native, ours])
def test_part_in_the_uv_editor(run, sync, uv_editor):
    """Native rips the part off in Blender 4 with sync on; ours stays attached.

    Where the part stays attached, native moves the vertices that it shares with the rest, ours does not.
    """
    obj = add_grid(4)
    edit_mode(lambda _, face: not sync or face in _PART)
    bpy.context.scene.tool_settings.use_uv_select_sync = sync
    select_uvs(obj, _PART, sticky=True)
    old, inside = uvs(obj), corners(obj, _PART)
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    shared = np.isin(vertex, vertex[inside]) & ~inside
    with bpy.context.temp_override(**uv_editor):
        assert run() == {'FINISHED'}
    new = uvs(obj)
    assert np.array_equal(new[~inside & ~shared], old[~inside & ~shared])
    assert not np.array_equal(new[inside], old[inside])
    ripped = run is native and sync and not FIVE
    assert is_attached(obj, _PART) == (not ripped)
    if run is ours:
        assert np.array_equal(new[~inside], old[~inside])


@pytest.mark.parametrize("boundary", ['CIRCLE', 'RECTANGLE', 'OUTLINE', 'KEEP', 'FREE'])
def test_part_stays_attached_with_every_boundary(boundary, uv_editor):
    obj = add_grid(4)
    edit_mode()
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    select_uvs(obj, _PART)
    with bpy.context.temp_override(**uv_editor):
        assert ours(boundary=boundary) == {'FINISHED'}
    assert is_attached(obj, _PART)
    (outcome,) = operators.last_outcomes
    assert outcome.after.flips == 0 and outcome.error == ""
    assert any("outline is kept" in text for text in outcome.warnings) == (boundary not in ('KEEP', 'FREE'))


@pytest.mark.parametrize("run", [native, ours])
def test_no_map_creates_one(run):
    obj = add_grid(4, uv=False)
    edit_mode()
    assert run() == {'FINISHED'}
    assert obj.data.uv_layers.keys() == ["UVMap"]
    assert np.ptp(uvs(obj), axis=0).max() > 0.9


@pytest.mark.parametrize("run", [native, ours])
def test_closed_without_seams(run, capfd):
    """Native finishes with a warning and packs the old UVs; ours is an error that changes nothing."""
    obj = add_cube()
    edit_mode()
    old = uvs(obj)
    if run is native:
        assert run() == {'FINISHED'}
        assert "failed to solve 1 of 1 island(s), edge seams may need to be added" in "".join(capfd.readouterr())
    else:
        with pytest.raises(RuntimeError, match="is closed: mark a seam to cut it open"):
            run()
    assert np.array_equal(uvs(obj), old) == (run is ours)


@pytest.mark.parametrize("run", [native, ours])
def test_cut_without_a_seam_is_rejoined(run):
    obj = add_grid(2)
    moved = uvs(obj)
    moved[:4] += 3
    obj.data.uv_layers.active.uv.foreach_set("vector", moved.ravel())
    assert not is_attached(obj, {0})
    edit_mode()
    assert run() == {'FINISHED'}
    assert is_attached(obj, {0})


@pytest.mark.parametrize(("run", "ratio"), [(native, 1), (ours, 4)])
def test_scale_that_is_not_uniform(run, ratio, capfd):
    """Native says that it ignores the scale; ours follows it."""
    obj = add_grid(8)
    for vertex in obj.data.vertices:
        vertex.co.z = 0
    obj.scale = (4, 1, 1)
    edit_mode()
    assert run() == {'FINISHED'}
    extent = np.ptp(uvs(obj), axis=0)
    assert extent.max() / extent.min() == pytest.approx(ratio, rel=0.05)
    if run is native:
        assert "scale" in capfd.readouterr().out
    else:
        ours(correct_scale=False)
        extent = np.ptp(uvs(obj), axis=0)
        assert extent.max() / extent.min() == pytest.approx(1, rel=0.03)


def pin(obj, places):
    """Pin vertices of a grid and move them; `places` {vertex: (u, v)}."""
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    bm.verts.ensure_lookup_table()
    for vertex, place in places.items():
        for loop in bm.verts[vertex].link_loops:
            loop[layer].pin_uv = True
            loop[layer].uv = place
    bmesh.update_edit_mesh(obj.data)


def place_of(obj, vertex):
    vertices = np.array([loop.vertex_index for loop in obj.data.loops])
    (place,) = np.unique(uvs(obj)[vertices == vertex], axis=0)
    return tuple(place)


@pytest.mark.parametrize("run", [native, ours])
def test_pins_are_exact_and_pinned_islands_not_packed(run):
    obj = add_grid(4)
    edit_mode()
    places = {6: (2.5, 3.25), 18: (3.0, 3.75)}
    pin(obj, places)
    assert run() == {'FINISHED'}
    assert {vertex: place_of(obj, vertex) for vertex in places} == places
    assert uvs(obj).min() > 1


def stretched(**options):
    """Native Minimum Stretch with its own remedy."""
    return native(method='MINIMUM_STRETCH', no_flip=True, **options)


def natives():
    """As far as this Blender has them."""
    has_no_flip = "no_flip" in bpy.ops.uv.unwrap.get_rna_type().properties
    return [native, stretched] if has_no_flip else [native]


@pytest.mark.parametrize("run", [*natives(), ours])
def test_crossed_pins(run):
    """Two neighbours that change places: native flips faces, even if told not to; ours leads the rest around them."""
    obj = add_grid(4)
    edit_mode()
    pin(obj, {11: (0.75, 0.5), 13: (0.25, 0.5), 0: (0, 0), 24: (1, 1)})
    with contextlib.suppress(RuntimeError):
        assert run() == {'FINISHED'}
    assert np.isfinite(uvs(obj)).all()
    if run is ours:
        (outcome,) = operators.last_outcomes
        assert outcome.is_clean
        assert {vertex: place_of(obj, vertex) for vertex in (11, 13)} == {11: (0.75, 0.5), 13: (0.25, 0.5)}
    else:
        assert (quad_areas(obj) <= 0).any()


@pytest.mark.parametrize("run", [*natives()[1:], ours])
def test_pins_that_swap_two_corners(run):
    """Native sends all UVs to (0, 0); ours keeps the pins, and says that they cross."""
    obj = add_grid(4)
    edit_mode()
    places = {0: (1, 1), 4: (1, 0), 20: (0, 1), 24: (0, 0)}
    pin(obj, places)
    assert run() == {'FINISHED'}
    if run is ours:
        assert {vertex: place_of(obj, vertex) for vertex in places} == places
        (outcome,) = operators.last_outcomes
        assert not outcome.is_clean
        assert "the pins make the outline cross itself: unpin some, or move them" in outcome.messages()
    else:
        assert not uvs(obj).any()


def quad_areas(obj):
    x, y = uvs(obj).reshape(-1, 4, 2).transpose(2, 0, 1)
    return (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2


@pytest.mark.parametrize("run", [native, ours])
def test_hidden_faces_are_untouched(run):
    obj = add_grid(4)
    edit_mode()
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    bm.faces[5].hide_set(True)
    bmesh.update_edit_mesh(obj.data)
    old, inside = uvs(obj), corners(obj, {5})
    assert run() == {'FINISHED'}
    assert np.array_equal(uvs(obj)[inside], old[inside])
    assert not np.array_equal(uvs(obj)[~inside], old[~inside])


@pytest.mark.parametrize("run", [native, ours])
def test_linked_duplicates(run):
    obj = add_grid(3)
    twin = bpy.data.objects.new("Twin", obj.data)
    bpy.context.collection.objects.link(twin)
    twin.select_set(True)
    edit_mode()
    assert [each.mode for each in (obj, twin)].count('EDIT') == 1
    assert run() == {'FINISHED'}
    if run is ours:
        assert len(operators.last_outcomes) == 1


@pytest.mark.parametrize("run", [native, ours])
def test_relaxing_with_a_pin(run):
    """Native `minimize_stretch` moves it; ours with a kept boundary does not."""
    obj = add_grid(4)
    edit_mode()
    pin(obj, {12: (0.6, 0.55)})
    bpy.context.scene.tool_settings.use_uv_select_sync = True
    if run is native:
        bpy.ops.uv.minimize_stretch(iterations=50)
        assert place_of(obj, 12) != pytest.approx((0.6, 0.55), abs=1e-4)
    else:
        run(boundary='KEEP')
        assert place_of(obj, 12) == tuple(np.float32((0.6, 0.55)))


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("run", [native, ours])
def test_subdivision_surface(run, first):
    """Native needs the modifier first in the stack; ours finds it anywhere."""
    obj = add_grid(4)
    for vertex in obj.data.vertices:
        vertex.co.z = 1.5 * (vertex.co.x**2 < 0.3) * (vertex.co.y**2 < 0.3)
    if not first:
        obj.modifiers.new("Weld", 'WELD')
    obj.modifiers.new("Subdivision", 'SUBSURF').levels = 2
    edit_mode()
    start = uvs(obj)

    def result(value):
        write_back(obj, start)
        assert run(use_subsurf_data=value) == {'FINISHED'}
        return uvs(obj)

    differs = np.abs(result(True) - result(False)).max() > 1e-3
    assert differs == (first or run is ours)


def write_back(obj, uv):
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    loops = [loop for face in bm.faces for loop in face.loops]
    for loop, place in zip(loops, uv, strict=True):
        loop[layer].uv = place
    bmesh.update_edit_mesh(obj.data)


@pytest.mark.parametrize("correct", [True, False])
@pytest.mark.parametrize("run", [native, ours])
def test_image_aspect(run, correct):
    obj = add_grid(4)
    material = bpy.data.materials.new("Wide")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Wide", 400, 100)
    obj.data.materials.append(material)
    for vertex in obj.data.vertices:
        vertex.co.z = 0
    edit_mode()
    assert run(correct_aspect=correct) == {'FINISHED'}
    width, height = np.ptp(uvs(obj), axis=0)
    assert width / height == pytest.approx(0.25 if correct else 1, rel=0.02)
