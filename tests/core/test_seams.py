# SPDX-License-Identifier: GPL-3.0-or-later
"""Seams: what is opened is a disk and no more than that, what is cut on is worth it, and wishes count."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from qh_unwrap.core.branches import branches
from qh_unwrap.core.cuttable import Cuttable, Polygons, need_cuts
from qh_unwrap.core.edge_costs import Wishes
from qh_unwrap.core.errors import ClosedError, SettingsError, ShapeError
from qh_unwrap.core.foresight import Foresight
from qh_unwrap.core.opening import opening
from qh_unwrap.core.paths import Paths
from qh_unwrap.core.seam_settings import SeamSettings
from qh_unwrap.core.seams import cut_open, cut_to
from qh_unwrap.core.topology import Topology
from tests.core import closed, shapes


def result_of(polygons, wishes=None, **settings):
    """What `cut_to` returns."""
    steps = cut_to(polygons, SeamSettings(**settings), wishes)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def torus(around=18, across=12):
    return Polygons.of_triangles(*shapes.torus(around, across))


def ball(size=5):
    """A cube of quads, blown up to a sphere."""
    cube = closed.box(size, size, size)
    middle = cube.vertices - size / 2
    points = middle / np.linalg.norm(middle, axis=1)[:, None]
    return Polygons.of_faces(points, cube.corner_vertex, np.full(len(cube.face_start), 4))


def rough(handles):
    """A plate of which no two edges are alike."""
    plate = closed.plate(handles)
    points = plate.vertices + np.random.default_rng(handles).normal(scale=0.1, size=plate.vertices.shape)
    return Polygons.of_triangles(points, closed.triangulated(plate)[1])


def topologies(polygons, seams):
    """Of the islands that a mesh falls into with these seams."""
    islands = polygons.with_seams(seams).islands()
    return [Topology(island.triangles, len(island.vertices)) for island in islands]


def loose_ends(polygons, seams):
    """The vertices at which one seam ends, and nothing else is."""
    ends = polygons.ends[seams]
    return np.flatnonzero(np.bincount(ends.ravel(), minlength=len(polygons.vertices)) == 1)


def mirrored(polygons, axis):
    """For every edge the one at its place in the mirror."""
    points = polygons.vertices - polygons.vertices.mean(axis=0)
    image = points * np.where(np.arange(3) == axis, -1, 1)
    vertex = np.array([np.argmin(np.linalg.norm(points - each, axis=1)) for each in image])
    edge = {tuple(ends): k for k, ends in enumerate(polygons.ends.tolist())}
    return np.array([edge[tuple(sorted(vertex[ends].tolist()))] for ends in polygons.ends])


# Opening


@pytest.mark.parametrize("handles", range(5))
def test_what_is_opened_is_a_disk(handles):
    mesh = closed.plate(handles)
    (topology,) = topologies(mesh, cut_open(mesh).seams)
    assert topology.excess == 0 and topology.loop_counts == 1 and not topology.faults()


@pytest.mark.parametrize("handles", range(1, 5))
def test_nothing_dangles_from_the_loops_of_handles(handles):
    mesh = closed.plate(handles)
    assert not len(loose_ends(mesh, cut_open(mesh).seams))


@pytest.mark.parametrize("handles", range(1, 4))
def test_no_edge_of_the_loops_could_be_sewn(handles):
    mesh = closed.plate(handles)
    seams = cut_open(mesh).seams
    for edge in np.flatnonzero(seams):
        fewer = seams.copy()
        fewer[edge] = False
        (topology,) = topologies(mesh, fewer)
        assert topology.loop_counts != 1 or topology.excess != 0 or len(loose_ends(mesh, fewer))


def test_a_torus_opens_by_two_of_its_shortest_loops():
    seams = cut_open(torus(18, 12), SeamSettings(creases=0)).seams
    assert seams.sum() == 18 + 12


def test_a_sphere_opens_by_a_path_between_far_vertices():
    mesh = ball()
    seams = cut_open(mesh).seams
    one, other = mesh.vertices[loose_ends(mesh, seams)]
    assert np.linalg.norm(one - other) > 1.8


def test_a_tetrahedron_opens():
    mesh = Polygons.of_triangles(np.vstack([np.eye(3), np.zeros(3)]), [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    (topology,) = topologies(mesh, cut_open(mesh).seams)
    assert not topology.faults()


def test_disks_with_holes_stay_as_they_are():
    assert not cut_open(Polygons.of_triangles(*shapes.ring())).seams.any()


def test_a_handle_beside_a_hole_is_cut():
    mesh = Polygons.of_triangles(*shapes.torus(open=True))
    (topology,) = topologies(mesh, cut_open(mesh).seams)
    assert not topology.faults()


def test_seams_that_are_there_count():
    mesh = torus()
    once = cut_open(mesh).seams
    again = cut_open(mesh.with_seams(once))
    assert np.array_equal(again.seams, once)


def test_one_sided_pieces_keep_the_edges_where_they_were_cut():
    count = 12
    angle = 2 * np.pi * np.arange(count) / count
    along = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    across = 0.2 * np.column_stack([np.cos(angle / 2)[:, None] * along[:, :2], np.sin(angle / 2)])
    points = np.vstack([along - across, along + across])
    quads = [[k, k + 1, k + 1 + count, k + count] for k in range(count - 1)] + [[count - 1, count, 0, 2 * count - 1]]
    mesh = Polygons.of_faces(points, np.ravel(quads), [4] * count)
    assert cut_open(mesh).seams.sum() == 1


def test_polygons_are_cut_along_their_own_edges():
    mesh = closed.plate(2)
    (island,) = mesh.islands()
    its = Cuttable(mesh, island)
    cut, _ = opening(its, its.lengths + np.where(its.inner, 0, np.inf))
    assert (its.mesh_edge[cut] >= 0).all()


# Foreseeing


@pytest.mark.parametrize(
    "mesh, size",
    [
        (Polygons.of_triangles(*shapes.grid()), 0),
        (Polygons.of_triangles(*shapes.ring()), 0),
        # A stereographic projection doubles lengths at the pole, relative to the equator.
        (Polygons.of_triangles(*shapes.hemisphere(24)), np.log(2)),
        # u grows by the length over the radius.
        (closed.cylinder(32, rows=20, height=6, capped=False), 6),
    ],
    ids=["flat", "flat with a hole", "half-sphere", "tube"],
)
def test_what_is_foreseen_is_the_scale_of_conformal_maps(mesh, size):
    (island,) = mesh.islands()
    its = Cuttable(mesh, island)
    foresight = Foresight(its)
    u = foresight.scaling(foresight.outline(np.zeros(len(its.edges), bool)))
    assert np.abs(u).max() == pytest.approx(size, rel=0.02, abs=1e-6)


def test_paths_are_the_cheapest():
    ends, cost = np.array([[0, 1], [1, 2], [0, 2], [2, 3]]), np.array([1.0, 1.0, 3.0, 1.0])
    paths = Paths(5, ends, cost, np.ones(4, bool), np.array([0]))
    assert paths.distance.tolist() == [0, 1, 2, 3, np.inf]
    assert paths.to(3).tolist() == [3, 1, 0]
    assert sorted(paths.union(np.array([1, 2])).tolist()) == [0, 1]


# Cutting on


def test_a_cube_becomes_a_net():
    result = result_of(closed.box())
    assert result.seams.sum() == 7
    assert result.energy == pytest.approx(1, abs=1e-6)
    assert result.charts[0].certified


def test_a_cylinder_is_cut_along_its_rims_and_one_side():
    result = result_of(closed.cylinder(16, rows=1))
    assert result.seams.sum() <= 2 * 15 + 1
    assert result.energy < 1.025


def test_a_tube_gets_one_seam_along_it():
    mesh = closed.cylinder(16, rows=4, height=6, capped=False)
    seams = result_of(mesh).seams
    assert seams.sum() == 4
    assert np.ptp(mesh.vertices[mesh.ends[seams].ravel(), 2]) == 6


@pytest.mark.parametrize("bound", [1.1, 1.02])
def test_the_bound_is_kept_and_the_map_certified(bound):
    result = result_of(ball(), distortion=bound)
    assert result.energy <= bound
    assert all(chart.certified and chart.error is None for chart in result.charts)


def test_a_lower_bound_takes_longer_seams():
    lengths = [result_of(ball(), distortion=bound).length for bound in (1.2, 1.05, 1.01)]
    assert lengths == sorted(lengths)


def test_the_same_comes_out_again():
    one, other = result_of(rough(1)), result_of(rough(1))
    assert np.array_equal(one.seams, other.seams) and one.energy == other.energy


def test_what_becomes_of_a_piece_does_not_depend_on_the_others():
    one, other = closed.triangulated(rough(1)), closed.triangulated(rough(2))
    both = Polygons.of_triangles(np.vstack([one[0], other[0] + 20]), np.vstack([one[1], other[1] + len(one[0])]))
    alone = sum(result_of(Polygons.of_triangles(*each)).seams.sum() for each in (one, other))
    result = result_of(both)
    assert result.seams.sum() == alone
    assert len(result.charts) == 2


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 481])  # the last one has a hole that a path could meet twice
def test_random_closed_meshes_unwrap(seed):
    mesh = closed.random_closed(seed)
    result = result_of(mesh)
    assert all(chart.certified for chart in result.charts)
    assert not [topology.faults() for topology in topologies(mesh, result.seams) if topology.faults()]


def test_states_tell_how_far_it_is():
    states = list(cut_to(ball(), SeamSettings()))
    shares = [state.done for state in states]
    assert all(before <= after for before, after in pairwise(shares)) and shares[0] >= 0 and shares[-1] <= 1
    assert states[-1].seams.any() and states[-1].energy < 1.1


def test_it_can_be_stopped_at_any_time():
    steps = cut_to(ball())
    next(steps)
    steps.close()


def test_branches_make_up_the_cut():
    mesh = torus()
    its = Cuttable(mesh, mesh.islands()[0])
    cut, kept = opening(its, its.lengths)
    edges = np.concatenate([branch.edges for branch in branches(its, cut, kept)])
    assert sorted(edges.tolist()) == np.flatnonzero(cut).tolist()


# Wishes


def test_edges_that_may_not_be_cut_are_not_cut():
    mesh = ball()
    spared = (mesh.vertices[:, 2] > 0).astype(float)
    wishes = Wishes(spared=spared)
    result = result_of(mesh, wishes, distortion=1.3)
    assert result.seams.any() and not (spared[mesh.ends[result.seams]] == 1).all(axis=1).any()


def test_vertices_that_are_spared_a_little_repel():
    mesh = ball()
    spared = np.where(mesh.vertices[:, 2] > -0.1, 0.95, 0)
    usual, repelled = (
        (mesh.lengths * (mesh.vertices[mesh.ends, 2].mean(axis=1) > 0))[result_of(mesh, each).seams].sum()
        for each in (None, Wishes(spared=spared))
    )
    assert repelled < usual


def test_seams_keep_away_from_what_is_important():
    mesh = ball()
    importance = np.where(mesh.vertices[:, 2] > -0.1, 100.0, 1)
    usual, repelled = (
        (mesh.lengths * (mesh.vertices[mesh.ends, 2].mean(axis=1) > 0))[result_of(mesh, each).seams].sum()
        for each in (None, Wishes(importance=importance))
    )
    assert repelled < usual
    for factor in (1.0, 4.0):  # whose roots are exact
        alike = Wishes(importance=np.full(len(mesh.vertices), factor))
        assert np.array_equal(result_of(mesh, alike).seams, result_of(mesh, None).seams)


def test_where_nothing_may_be_cut_it_says_so():
    mesh = ball()
    (chart,) = cut_open(mesh, wishes=Wishes(closed=np.ones(len(mesh.seam), bool))).charts
    assert isinstance(chart.error, ClosedError)


def test_marked_edges_attract():
    mesh = ball()
    on_circle = np.abs(mesh.vertices[mesh.ends, 0]).max(axis=1) < 0.25
    plain, marked = (
        (on_circle & result_of(mesh, wishes).seams).sum() / result_of(mesh, wishes).seams.sum()
        for wishes in (None, Wishes(marked=on_circle))
    )
    assert marked > plain


def test_creases_attract():
    mesh = closed.box(6, 6, 6)
    (island,) = mesh.islands()
    its = Cuttable(mesh, island)
    sharp = np.zeros(len(mesh.seam), bool)
    sharp[its.mesh_edge[np.abs(its.dihedral) > 1]] = True
    assert (result_of(mesh).seams & ~sharp).sum() == 0


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("mesh", [ball(4), closed.box(4, 2, 6), closed.box(3, 3, 5)], ids=["ball", "box", "odd box"])
def test_seams_are_symmetric(mesh, axis):
    middle = mesh.vertices[:, "XYZ".index(axis)]
    result = result_of(mesh, symmetry=axis)
    on_plane = np.isclose(middle, middle.mean()).any()
    pairs = result.seams[mirrored(mesh, "XYZ".index(axis))]
    assert np.array_equal(result.seams, pairs) == on_plane
    assert any("symmetric" in text for text in result.charts[0].warnings) == (not on_plane)
    assert result.energy < 1.025 and result.charts[0].certified


def test_a_view_is_kept_free():
    mesh = ball(6)
    high = mesh.vertices[mesh.ends, 2].mean(axis=1) > 0.5
    usual, hidden = (mesh.lengths[result_of(mesh, hide_from=view).seams & high].sum() for view in ("-Z", "Z"))
    assert hidden < 0.5 * usual


# Charts


@pytest.mark.parametrize("charts", [1, 2, 3, 6])
def test_a_cube_is_split_into_as_many_charts_as_asked_for(charts):
    result = result_of(closed.box(4, 4, 4), charts=charts)
    assert len(result.charts) == charts


def test_no_chart_more_than_sharp_edges_and_necks_make():
    assert len(result_of(ball(), charts=20).charts) == 1


def test_two_balls_on_a_neck_are_split_there():
    full = np.zeros((17, 7, 7), bool)
    full[:7], full[10:], full[7:10, 3, 3] = True, True, True
    mesh = closed.voxels(full)
    points = mesh.vertices.copy()
    result = result_of(mesh, charts=2, split_angle=180.0)
    sides = [points[mesh.corner_vertex.reshape(-1, 4)[chart.faces], 0].mean() for chart in result.charts]
    assert len(sides) == 2 and min(sides) < 6 and max(sides) > 11


# What goes wrong


def test_what_no_cut_can_help_is_named():
    flat = Polygons.of_triangles(np.zeros((3, 3)), [[0, 1, 2]])
    (chart,) = result_of(flat).charts
    assert chart.error is not None and not chart.certified


def test_where_nothing_is_selected_nothing_is_cut():
    mesh = closed.box()
    result = result_of(replace(mesh, selected=np.zeros(len(mesh.selected), bool)))
    assert not result.seams.any() and not result.charts


def test_faces_that_are_not_selected_stay_uncut():
    mesh = closed.box(2, 2, 2)
    selected = mesh.vertices[mesh.corner_vertex.reshape(-1, 4), 2].min(axis=1) > 0
    seams = result_of(replace(mesh, selected=selected)).seams
    assert (mesh.vertices[mesh.ends[seams], 2] > 0).any(axis=1).all()


def test_a_mesh_must_have_faces():
    with pytest.raises(ShapeError, match="no faces"):
        Polygons.of_faces(np.zeros((0, 3)), [], [])


def test_wishes_must_fit_the_mesh():
    with pytest.raises(ShapeError, match="marked"):
        cut_open(ball(), wishes=Wishes(marked=np.zeros(3)))


def test_settings_are_checked():
    with pytest.raises(SettingsError, match="distortion"):
        SeamSettings(distortion=1.0)


def test_what_needs_cuts():
    islands = [mesh.islands()[0] for mesh in (ball(), torus(), Polygons.of_triangles(*shapes.bump(1)))]
    assert need_cuts(islands).tolist() == [True, True, False]
    assert not len(need_cuts([]))
