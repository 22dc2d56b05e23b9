# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxing in place: what moves, what stays to the last bit, in every way to select."""

import bpy  # isort: skip
from itertools import pairwise

import bmesh
import numpy as np
import pytest
from scenes import FIVE, add_grid, changes, edit_mode, mesh_object, select_uvs, snapshot, uvs

import qh_unwrap
from qh_unwrap.addon import operators


def spoilt_grid(size=6, name="Grid", seed=0):
    """A grid whose UVs inside are moved about a little, without flips."""
    obj = add_grid(size, name)
    shift_uvs(obj, seed)
    return obj


def shift_uvs(obj, seed=0, part=0.2):
    mesh = obj.data
    size = round(len(mesh.polygons) ** 0.5)
    values = uvs(obj)
    vertex = np.array([loop.vertex_index for loop in mesh.loops])
    shift = np.random.default_rng(seed).uniform(-part, part, (len(mesh.vertices), 2)) / size
    inner = ((values > 0.01) & (values < 0.99)).all(axis=1)
    values[inner] += shift[vertex][inner].astype(np.float32)
    mesh.uv_layers.active.uv.foreach_set("vector", values.ravel())


def relax(context=None, **options):
    operators.last_outcomes.clear()
    with bpy.context.temp_override(**(context or {})):
        return bpy.ops.uv.qh_relax(**options)


def moved(before, after):
    return (before != after).any(axis=1)


def at_vertices(obj, corners):
    """The vertices that have some of the corners."""
    return {obj.data.loops[k].vertex_index for k in np.flatnonzero(corners)}


def test_all_of_it_in_object_mode():
    obj = spoilt_grid()
    before = snapshot(obj)
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    assert changes(before, snapshot(obj)) == {"UVMap"}
    outline = ((old == 0) | (old == 1)).any(axis=1)
    assert moved(old, uvs(obj)).tolist() == (~outline).tolist()
    (outcome,) = operators.last_outcomes
    assert outcome.injective and outcome.after.symmetric_dirichlet < outcome.before.symmetric_dirichlet


def test_pressing_again_goes_on_and_never_worsens():
    spoilt_grid()
    energies = []
    for _ in range(3):
        relax(steps=1)
        energies += [operators.last_outcomes[0].before, operators.last_outcomes[0].after]
    values = [each.symmetric_dirichlet for each in energies]
    assert all(later <= earlier * (1 + 1e-6) for earlier, later in pairwise(values))


INNER = {14, 15, 20, 21}  # faces in the middle of the grid of 6 by 6
PATCH = {7, 8, 9, 10, 13, 14, 15, 16, 19, 20, 21, 22, 25, 26, 27, 28}


@pytest.mark.parametrize("sticky", [False, True])
@pytest.mark.parametrize("mode", ["VERTEX", "EDGE", "FACE", "ISLAND"])
def test_a_patch_in_the_uv_editor(uv_editor, mode, sticky):
    """Its border stays, whether or not the same UVs of the faces around are selected with it."""
    obj = spoilt_grid()
    edit_mode()
    settings = bpy.context.scene.tool_settings
    settings.use_uv_select_sync = False
    if not (FIVE and mode == "ISLAND"):
        settings.uv_select_mode = mode
    select_uvs(obj, PATCH, sticky)
    old = uvs(obj)
    assert relax(uv_editor) == {'FINISHED'}
    settings.uv_select_mode = "VERTEX"
    bpy.ops.object.mode_set(mode='OBJECT')
    inside = {
        vertex.index
        for vertex in obj.data.vertices
        if {face.index for face in obj.data.polygons if vertex.index in face.vertices} <= PATCH
    }
    assert at_vertices(obj, moved(old, uvs(obj))) == inside and len(inside) == 9


@pytest.mark.parametrize("in_uv_editor", [False, True])
@pytest.mark.parametrize("mode", range(3))
def test_a_patch_with_sync_or_in_the_3d_view(uv_editor, mode, in_uv_editor):
    obj = spoilt_grid()
    edit_mode(lambda _, face: face in PATCH)
    bpy.context.scene.tool_settings.use_uv_select_sync = True
    bpy.context.tool_settings.mesh_select_mode = [k == mode for k in range(3)]
    old = uvs(obj)
    assert relax(uv_editor if in_uv_editor else None) == {'FINISHED'}
    assert len(at_vertices_in_edit_mode(obj, moved(old, uvs(obj)))) == 9


def at_vertices_in_edit_mode(obj, corners):
    bm = bmesh.from_edit_mesh(obj.data)
    loops = [loop for face in bm.faces for loop in face.loops]
    return {loops[k].vert.index for k in np.flatnonzero(corners)}


def test_single_vertices_move_among_what_stays():
    obj = spoilt_grid()
    edit_mode(lambda *_: False)
    bpy.context.tool_settings.mesh_select_mode = (True, False, False)
    bm = bmesh.from_edit_mesh(obj.data)
    bm.verts.ensure_lookup_table()
    for k in (24, 32):
        bm.verts[k].select_set(True)
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    assert at_vertices_in_edit_mode(obj, moved(old, uvs(obj))) == {24, 32}


def test_nothing_selected_says_so():
    obj = spoilt_grid()
    edit_mode(lambda *_: False)
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="No UVs are selected"):
        relax()
    assert not changes(before, snapshot(obj))


def test_what_cannot_move_says_so():
    obj = spoilt_grid()
    edit_mode(lambda _, face: face == 14)
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="nothing that is selected can move: select more"):
        relax()
    assert not changes(before, snapshot(obj))


def test_pins_and_hidden_faces_stay():
    obj = spoilt_grid()
    edit_mode()
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    layer = bm.loops.layers.uv.active
    bm.verts.ensure_lookup_table()
    for loop in bm.verts[24].link_loops:
        loop[layer].pin_uv = True
    bm.faces[0].hide_set(True)
    bm.faces[7].hide_set(True)
    bmesh.update_edit_mesh(obj.data)
    old = uvs(obj)
    corner = {vertex.index for face in (0, 7) for vertex in bm.faces[face].verts}
    assert relax() == {'FINISHED'}
    changed = at_vertices_in_edit_mode(obj, moved(old, uvs(obj)))
    assert changed and not changed & ({24} | corner)


def test_a_ring_and_parts_that_touch_at_a_corner():
    obj = spoilt_grid(8)
    ring = {k for k in range(64) if 1 <= k // 8 <= 6 and 1 <= k % 8 <= 6 and k not in (27, 28, 35, 36)}
    edit_mode(lambda _, face: face in ring)
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    assert moved(old, uvs(obj)).any() and all(outcome.injective for outcome in operators.last_outcomes)
    both = {k for k in range(64) if (k // 8 < 4) == (k % 8 < 4)}
    edit_mode(lambda _, face: face in both)
    assert relax() == {'FINISHED'}
    assert len(operators.last_outcomes) == 2


def test_several_islands_and_objects_keep_their_places():
    one, other = spoilt_grid(4, "One", 1), spoilt_grid(5, "Other", 2)
    other.data.uv_layers.active.uv.foreach_set("vector", (uvs(other) * (-0.3, 0.3) + (2, 0)).astype(np.float32).ravel())
    before = [uvs(one), uvs(other)]
    assert relax() == {'FINISHED'}
    for obj, old in zip((one, other), before, strict=True):
        assert moved(old, uvs(obj)).any()
        assert np.allclose(old.min(axis=0), uvs(obj).min(axis=0)) and np.allclose(old.max(axis=0), uvs(obj).max(axis=0))
    assert all(outcome.injective for outcome in operators.last_outcomes)


@pytest.mark.parametrize(("direction", "kept"), [("U", 1), ("V", 0)])
def test_one_direction_keeps_the_other_coordinate(direction, kept):
    obj = spoilt_grid()
    old = uvs(obj)
    assert relax(direction=direction) == {'FINISHED'}
    new = uvs(obj)
    assert np.array_equal(old[:, kept], new[:, kept]) and moved(old, new).any()
    (outcome,) = operators.last_outcomes
    assert outcome.injective and outcome.after.symmetric_dirichlet < outcome.before.symmetric_dirichlet


def test_blend():
    obj = spoilt_grid()
    old = uvs(obj)
    relax(blend=0.0)
    assert np.array_equal(old, uvs(obj))
    relax()
    far = uvs(obj)
    obj.data.uv_layers.active.uv.foreach_set("vector", old.ravel())
    relax(blend=0.5)
    assert np.allclose(uvs(obj), (old + far) / 2, atol=1e-4)


def test_the_outline_moves_if_it_may_and_the_island_keeps_its_place_and_size():
    obj = spoilt_grid()
    values = uvs(obj) * (0.5, 0.2) + (3, 1)
    obj.data.uv_layers.active.uv.foreach_set("vector", values.astype(np.float32).ravel())
    old = uvs(obj)
    relax()
    held = operators.last_outcomes[0].after.symmetric_dirichlet
    relax(move_outline=True)
    (outcome,) = operators.last_outcomes
    assert outcome.injective and outcome.after.symmetric_dirichlet < held - 0.1
    new = uvs(obj)
    assert np.allclose(new.mean(axis=0), old.mean(axis=0), atol=0.02)
    assert np.isclose(np.prod(np.ptp(new, axis=0)), np.prod(np.ptp(old, axis=0)), rtol=0.1)


def test_what_a_seam_parts_from_the_selection_stays():
    """In the mesh its vertices are selected, too."""
    obj = spoilt_grid()
    values = uvs(obj)
    right = np.repeat([face % 6 >= 3 for face in range(36)], 4)
    values[right] += (1, 0)
    obj.data.uv_layers.active.uv.foreach_set("vector", values.ravel())
    edit_mode(lambda _, face: face % 6 < 3)
    old = uvs(obj)
    assert relax(move_outline=True) == {'FINISHED'}
    assert moved(old, uvs(obj)).tolist() == (~right).tolist()


def with_neighbours(*boxes):
    """A flat grid that fills (0, 0) to (1, 0.2), joined with quads that fill the `boxes` (left, bottom, right, top) of
    the UV map, and with the grid's faces selected."""
    obj = spoilt_grid(4, "One")
    for left, bottom, right, top in boxes:
        other = mesh_object("Wall", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
        corners = np.float32([[left, bottom], [right, bottom], [right, top], [left, top]])
        other.data.uv_layers.new().uv.foreach_set("vector", corners.ravel())
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
        bpy.ops.object.join()
    values = uvs(obj)
    values[:64] *= (1, 0.2)
    obj.data.uv_layers.active.uv.foreach_set("vector", values.ravel())
    edit_mode(lambda _, face: face < 16)
    return obj


def test_an_outline_that_moves_keeps_off_other_islands():
    """Between two of them it can only become longer; above the one it moves away from the other."""
    obj = with_neighbours((-1, 0.21, 2, 0.9), (-1, -0.9, 2, -0.01))
    old = uvs(obj)
    relax()
    held = operators.last_outcomes[0].after.symmetric_dirichlet
    assert relax(move_outline=True) == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    new = uvs(obj)
    assert outcome.injective and not outcome.overlaps and not outcome.warnings
    assert outcome.after.symmetric_dirichlet < held - 0.01
    assert np.array_equal(old[64:], new[64:])
    assert new[:64, 1].max() < 0.21 and new[:64, 1].min() > -0.01


# Islands that cross each other, and so are no walls
CROSSING = (-0.5, 0.21, 1.5, 0.9), (0.1, 0.21, 0.9, 1.5), (-0.5, -0.9, 1.5, -0.01), (0.1, -1.5, 0.9, -0.01)


def test_an_outline_stays_where_others_are_no_wall():
    """What comes to lie on them is relaxed within its outline."""
    obj = with_neighbours(*CROSSING)
    old = uvs(obj)
    assert relax(move_outline=True) == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert not outcome.overlaps and any("would run over other islands" in text for text in outcome.warnings)
    new = uvs(obj)
    assert np.array_equal(old[64:], new[64:]) and moved(old, new).any()


def test_what_is_relaxed_once_more_is_told_once():
    obj = with_neighbours(*CROSSING)
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    bm.faces[5].normal_flip()
    bmesh.update_edit_mesh(obj.data)
    assert relax(move_outline=True) == {'FINISHED'}
    warnings = operators.last_outcomes[0].warnings
    assert len(warnings) == 2 and sum("inside out" in text for text in warnings) == 1


def tangle(obj, how):
    values = uvs(obj)
    inner = ((values > 0.01) & (values < 0.99)).all(axis=1)
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    rng = np.random.default_rng(0)
    new = {
        "tangled": rng.random((len(obj.data.vertices), 2))[vertex],
        "a point": np.full_like(values, 0.5),
        "a line": np.column_stack([values[:, 0], np.full(len(values), 0.5)]),
        "zero": np.zeros_like(values),
        "one thrown out": np.where((vertex == vertex[inner][0])[:, None], 40.0, values),
    }[how]
    values[inner] = new[inner]
    obj.data.uv_layers.active.uv.foreach_set("vector", values.astype(np.float32).ravel())


@pytest.mark.parametrize("how", ["tangled", "a point", "a line", "zero", "one thrown out"])
def test_bad_maps_come_right_within_their_border(how):
    obj = spoilt_grid()
    outline = ((uvs(obj) == 0) | (uvs(obj) == 1)).any(axis=1)
    tangle(obj, how)
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert outcome.injective and not outcome.after.flips
    assert np.array_equal(old[outline], uvs(obj)[outline])


@pytest.mark.parametrize("move_outline", [False, True])
def test_unset_uvs_need_an_outline_that_moves(move_outline):
    obj = add_grid(4)
    obj.data.uv_layers.active.uv.foreach_set("vector", np.zeros(2 * len(obj.data.loops), np.float32))
    if move_outline:
        assert relax(move_outline=True) == {'FINISHED'}
        assert operators.last_outcomes[0].injective
    else:
        before = snapshot(obj)
        with pytest.raises(RuntimeError, match="all its UVs are in one place"):
            relax()
        assert not changes(before, snapshot(obj))


def test_a_border_that_crosses_itself_is_refused():
    obj = spoilt_grid()
    values = uvs(obj)
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    values[vertex == 3] = (0.5, 2.0)
    obj.data.uv_layers.active.uv.foreach_set("vector", values.ravel())
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match=r"Grid .*outline crosses itself"):
        relax()
    assert not changes(before, snapshot(obj))


def test_flips_need_both_directions():
    obj = spoilt_grid()
    tangle(obj, "tangled")
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="relax it in both directions first"):
        relax(direction="U")
    assert not changes(before, snapshot(obj))


def test_seams_do_not_matter_where_the_uvs_hang_together():
    obj = spoilt_grid()
    for edge in obj.data.edges:
        edge.use_seam = True
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    assert len(operators.last_outcomes) == 1 and moved(old, uvs(obj)).any()


def test_doubled_faces_with_uvs_of_their_own_stay():
    points = [(x, y, 0.2 * x * y) for y in range(4) for x in range(4)]
    quads = [(4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4) for y in range(3) for x in range(3)]
    obj = mesh_object("Card", points, quads + [quad[::-1] for quad in quads])
    layer = obj.data.uv_layers.new()
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    values = np.array(points)[vertex][:, :2] / 3
    values[vertex == 5] += 0.1
    values[36:] *= (-1, 1)
    layer.uv.foreach_set("vector", values.astype(np.float32).ravel())
    edit_mode(lambda _, face: face < 9)
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    new = uvs(obj)
    assert np.array_equal(old[36:], new[36:]) and moved(old, new).any()


def test_a_pin_of_a_doubled_face_holds_what_it_lies_on():
    points = [(x, y, 0.2 * x * y) for y in range(4) for x in range(4)]
    quads = [(4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4) for y in range(3) for x in range(3)]
    obj = mesh_object("Card", points, quads + [quads[4][::-1]])
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    values = np.array(points)[vertex][:, :2] / 3
    values[vertex == 5] += 0.1
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", values.astype(np.float32).ravel())
    pins = np.zeros(len(vertex), bool)
    pins[36:] = vertex[36:] == 5
    obj.data.attributes.new(".pn.UVMap", 'BOOLEAN', 'CORNER').data.foreach_set("value", pins)
    old = uvs(obj)
    assert relax() == {'FINISHED'}
    assert at_vertices(obj, moved(old, uvs(obj))) == {6, 9, 10}


@pytest.mark.parametrize("name", ["qh_relax", "qh_straighten", "qh_seams"])
def test_a_missing_group_of_importance_is_told(name):
    obj = spoilt_grid()
    bpy.context.scene.qh_unwrap.use_weights = True
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="There is no vertex group uv_importance"):
        getattr(bpy.ops.uv, name)()
    assert not changes(before, snapshot(obj))


def test_no_uv_map_says_so():
    add_grid(uv=False)
    with pytest.raises(RuntimeError, match="has no UV map: unwrap it first"):
        relax()


def straighten(**options):
    operators.last_outcomes.clear()
    return bpy.ops.uv.qh_straighten(**options)


def select_edges(obj, chosen):
    """In Edit Mode, the edges between vertices of which `chosen` (vertex, vertex) -> bool says so."""
    edit_mode(lambda *_: False)
    bpy.context.tool_settings.mesh_select_mode = (False, True, False)
    for edge in bmesh.from_edit_mesh(obj.data).edges:
        edge.select_set(chosen(*sorted(vertex.index for vertex in edge.verts)))


def turned_grid(angle=0.2):
    """A grid of 6 by 6 whose UVs are turned and moved about."""
    obj = spoilt_grid()
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    obj.data.uv_layers.active.uv.foreach_set("vector", (uvs(obj) @ turn.T).astype(np.float32).ravel())
    return obj


def at_vertex(obj):
    """The UVs of each vertex of the grid, (7, 7, 2)."""
    bpy.ops.object.mode_set(mode='OBJECT')
    found = np.empty((len(obj.data.vertices), 2), np.float32)
    found[[loop.vertex_index for loop in obj.data.loops]] = uvs(obj)
    return found.reshape(7, 7, 2)


def test_edges_become_straight_along_the_axis_they_run_along():
    obj = turned_grid()
    row, column = (lambda i, j: i // 7 == j // 7 == 3), (lambda i, j: i % 7 == j % 7 == 2)
    select_edges(obj, lambda i, j: row(i, j) or column(i, j))
    assert straighten() == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert outcome.injective
    grid = at_vertex(obj)
    assert len(np.unique(grid[3, :, 1])) == 1 and len(np.unique(grid[:, 2, 0])) == 1
    assert len(np.unique(grid[2, :, 1])) == 7, "others stay as crooked as they are"


def test_edges_become_straight_along_the_axis_that_is_wanted():
    obj = turned_grid()
    select_edges(obj, lambda i, j: i // 7 == j // 7 == 3)
    assert straighten(along="V") == {'FINISHED'}
    assert operators.last_outcomes[0].injective and len(np.unique(at_vertex(obj)[3, :, 0])) == 1


def test_pins_say_where_a_line_goes_or_are_in_its_way():
    obj = turned_grid()
    select_edges(obj, lambda i, j: i // 7 == j // 7 == 3)
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    bm.verts.ensure_lookup_table()
    for loop in bm.verts[23].link_loops:
        loop[layer].pin_uv = True
    place = bm.verts[23].link_loops[0][layer].uv[1]
    assert straighten() == {'FINISHED'}
    assert np.unique(at_vertex(obj)[3, :, 1]).tolist() == [place]
    obj.data.uv_layers.active.uv.foreach_set("vector", uvs(turned_grid()).ravel())
    select_edges(obj, lambda i, j: i // 7 == j // 7 == 3)
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    bm.verts.ensure_lookup_table()
    for loop in bm.verts[26].link_loops:
        loop[layer].pin_uv = True
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="pins lie beside the line"):
        straighten()
    assert not changes(before, snapshot(obj))


def test_quads_become_a_rectangle_with_straight_rows():
    obj = turned_grid()
    edit_mode(lambda _, face: face in PATCH)
    assert straighten(shape="RECTANGLE") == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert outcome.injective
    grid = at_vertex(obj)[1:6, 1:6]
    assert all(len(np.unique(grid[k, :, 1])) == len(np.unique(grid[:, k, 0])) == 1 for k in range(5))
    points = np.array([vertex.co for vertex in obj.data.vertices]).reshape(7, 7, 3)[1:6, 1:6]
    width, height = (np.linalg.norm(np.diff(points, axis=axis), axis=2).sum(axis=axis).mean() for axis in (1, 0))
    size = np.ptp(grid.reshape(-1, 2), axis=0)
    assert np.isclose(size[0] / size[1], width / height, rtol=1e-5)


def test_pinned_corners_of_a_rectangle_hold():
    obj = turned_grid(0.0)
    edit_mode(lambda _, face: face in PATCH)
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    bm.verts.ensure_lookup_table()
    for k, place in ((8, (0.1, 0.1)), (12, (0.9, 0.1)), (40, (0.9, 0.8)), (36, (0.1, 0.8))):
        for loop in bm.verts[k].link_loops:
            loop[layer].pin_uv = True
            loop[layer].uv = place
    assert straighten(shape="RECTANGLE") == {'FINISHED'}
    grid = at_vertex(obj)[1:6, 1:6]
    assert grid.reshape(-1, 2).min(axis=0).tolist() == np.float32([0.1, 0.1]).tolist()
    assert grid.reshape(-1, 2).max(axis=0).tolist() == np.float32([0.9, 0.8]).tolist()


def test_what_cannot_be_straight_is_refused():
    obj = turned_grid()
    edit_mode(lambda _, face: face in (7, 8, 13))
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match="has 5 corners, and a rectangle has four"):
        straighten(shape="RECTANGLE")
    ring = {k for k in PATCH if k not in INNER}
    edit_mode(lambda _, face: face in ring)
    with pytest.raises(RuntimeError, match="in one piece without holes"):
        straighten(shape="RECTANGLE")
    edit_mode(lambda *_: False)
    with pytest.raises(RuntimeError, match="Nothing is selected that could become straight"):
        straighten()
    assert "UVMap" not in changes(before, snapshot(obj))


def test_a_map_with_flips_is_to_be_relaxed_first():
    obj = turned_grid(0.0)
    tangle(obj, "tangled")
    select_edges(obj, lambda i, j: i // 7 == j // 7 == 3)
    with pytest.raises(RuntimeError, match="relax it first"):
        straighten()


def test_selected_edges_of_the_uv_editor(uv_editor):
    obj = turned_grid()
    edit_mode()
    settings = bpy.context.scene.tool_settings
    settings.use_uv_select_sync = False
    settings.uv_select_mode = 'EDGE'
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    for face in bm.faces:
        for loop in face.loops:
            ends = {loop.vert.index, loop.link_loop_next.vert.index}
            chosen = all(k // 7 == 3 for k in ends)
            if FIVE:
                loop.uv_select_edge = chosen
            else:
                loop[layer].select_edge = chosen
    if FIVE:
        bm.uv_select_sync_valid = True
    with bpy.context.temp_override(**uv_editor):
        assert straighten() == {'FINISHED'}
    settings.uv_select_mode = 'VERTEX'
    assert len(np.unique(at_vertex(obj)[3, :, 1])) == 1


@pytest.mark.parametrize("suffix", [".blend", ".obj"])
def test_files_are_relaxed(tmp_path, suffix):
    obj = spoilt_grid()
    old, outline = uvs(obj), ((uvs(obj) == 0) | (uvs(obj) == 1)).any(axis=1)
    path, output = tmp_path / f"in{suffix}", tmp_path / f"out{suffix}"
    if suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    else:
        bpy.ops.wm.obj_export(filepath=str(path))
    report = qh_unwrap.unwrap_file(path, output, relax=True, overwrite=True)
    assert report["exit_code"] == 0 and report["totals"]["certified"] == 1 and not report["cuts"]
    assert report["settings"]["steps"] == 30 and "boundary" not in report["settings"]
    (island,) = report["islands"]
    assert island["after"]["symmetric_dirichlet"] < island["before"]["symmetric_dirichlet"]
    if suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(output))
    else:
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.ops.wm.obj_import(filepath=str(output))
    new = uvs(bpy.data.objects[0])
    tolerance = 0 if suffix == ".blend" else 1e-5  # digits of the exporter
    assert np.abs(old[outline] - new[outline]).max() <= tolerance and moved(old, new).any()


def test_a_file_without_uvs_cannot_be_relaxed(tmp_path):
    add_grid(uv=False)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "in.blend"))
    report = qh_unwrap.unwrap_file(tmp_path / "in.blend", tmp_path / "out.blend", relax=True)
    assert report["exit_code"] == 3 and "has no UV map" in report["islands"][0]["error"]
    assert not (tmp_path / "out.blend").exists()
