# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles can be asked how they hang together, whatever is wrong with them."""

from functools import cached_property

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qh_unwrap.core import Topology, errors
from qh_unwrap.core.chart import numbered_edges
from qh_unwrap.core.pieces import joined

from . import shapes
from .test_surface import broken
from .test_tensor import seeds


def moebius(around=12):
    """The triangles of a band with half a twist: at one place neighbours are wound against each other."""
    k = np.arange(around)
    above, below, next_above, next_below = k, k + around, k + 1, k + 1 + around
    next_above[-1], next_below[-1] = around, 0
    return np.vstack([np.column_stack(t) for t in ((above, below, next_below), (above, next_below, next_above))])


def fans_at_one_vertex(count=3):
    """Fans of two triangles each that have nothing but vertex 0 in common."""
    k = 1 + 3 * np.arange(count)
    return np.vstack([np.column_stack([0 * k, k, k + 1]), np.column_stack([0 * k, k + 1, k + 2])])


def everything(topology):
    """All that can be asked, by name."""
    kinds = vars(Topology).items()
    return {name: getattr(topology, name) for name, kind in kinds if isinstance(kind, property | cached_property)}


def check(topology):
    """That all can be asked, and that it fits together."""
    found = everything(topology)
    assert len(found) > 15
    m, k, p = len(topology.triangles), len(topology.edges), topology.piece_count
    for name in ("repeated", "duplicate"):
        assert found[name].shape == (m,)
    for name in ("crowded", "misaligned"):
        assert found[name].shape == (k,)
    for name in ("component_counts", "loop_counts", "is_closed", "excess", "handles"):
        assert found[name].shape == (p,)
    assert topology.edge_uses.sum() == 3 * m and (topology.edge_uses == 2).sum() == len(found["twins"][0])
    edges = np.sort(np.column_stack(topology.half_edges), axis=1)
    np.testing.assert_array_equal(topology.edges[topology.half_edge_edges], edges)
    for loop in topology.loops:
        sides = set(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))
        on_boundary = np.column_stack([ends[topology.on_boundary] for ends in topology.half_edges])
        assert sides <= set(map(tuple, on_boundary.tolist()))
    assert set(topology.faults()) <= set(range(p))


def test_closed_triangles():
    topology = Topology(shapes.tetrahedron()[1], 4)
    check(topology)
    assert topology.is_closed.all() and not topology.loops and topology.excess[0] == 0
    assert not topology.on_boundary.any()
    assert type(topology.faults()[0]) is errors.ClosedError


@pytest.mark.parametrize("holes", [0, 1, 2])
def test_handles_are_counted_whether_closed_or_open(holes):
    vertices, triangles = shapes.torus()
    topology = Topology(np.delete(triangles, [0, 40][:holes], axis=0), len(vertices))
    check(topology)
    assert topology.handles.tolist() == [1] and topology.loop_counts.tolist() == [holes]
    assert type(topology.faults()[0]) is (errors.GenusError if holes else errors.ClosedError)


def test_pinched_vertices():
    topology = Topology(fans_at_one_vertex(), 10)
    check(topology)
    assert np.flatnonzero(topology.pinched).tolist() == [0]
    assert topology.component_counts.tolist() == [3]
    assert not topology.loops, "at the pinched vertex they cannot be told apart"
    assert type(topology.faults()[0]) is errors.NonManifoldVertexError


def test_crowded_edges():
    k = np.arange(2, 6)
    topology = Topology(np.column_stack([0 * k, 0 * k + 1, k]), 6)
    check(topology)
    assert topology.edges[topology.crowded].tolist() == [[0, 1]]
    assert not topology.loops
    assert type(topology.faults()[0]) is errors.NonManifoldEdgeError


def test_a_band_with_half_a_twist():
    topology = Topology(moebius(), 24)
    check(topology)
    assert topology.misaligned.sum() == 1 and not topology.crowded.any() and not topology.pinched.any()
    assert type(topology.faults()[0]) is errors.WindingError


def test_one_bad_piece_hides_nothing_of_the_others():
    ring, closed = shapes.ring(), shapes.tetrahedron()
    twisted = np.zeros((24, 3)), moebius()
    vertices, triangles, *starts = joined(*zip(ring, twisted, closed, ring, strict=True))
    topology = Topology(triangles, len(vertices), *starts)
    check(topology)
    assert {k: type(error) for k, error in topology.faults().items()} == {1: errors.WindingError, 2: errors.ClosedError}
    assert topology.loop_counts.tolist() == [2, 0, 0, 2]
    assert topology.component_counts.tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize(
    "name", ["loose", "repeated", "duplicate", "edge", "winding", "vertex", "bubble", "pieces", "closed", "handle"]
)
def test_every_defect_can_be_asked_about(name):
    vertices, triangles = broken(name)
    topology = Topology(triangles, len(vertices))
    check(topology)
    assert len(topology.faults()) == 1


@given(seeds, st.integers(1, 12), st.integers(1, 40))
def test_any_triangles_can_be_asked_about(seed, n, m):
    topology = Topology(np.random.default_rng(seed).integers(n, size=(m, 3)), n)
    check(topology)


def test_indices_of_32_bits_do_not_overflow():
    # 46 341 squared does not fit into 32 bits.
    vertices, triangles = shapes.grid(220, 220)
    n = len(vertices)
    assert n > 46_341
    one, other = (Topology(triangles.astype(kind), n) for kind in (np.int32, np.int64))
    np.testing.assert_array_equal(one.edges, other.edges)
    np.testing.assert_array_equal(one.triangle_edges, other.triangle_edges)
    assert one.edges.min() >= 0 and one.edges.max() == n - 1
    assert not one.duplicate.any() and one.component_counts.tolist() == [1] and len(one.loops) == 1
    for found, expected in zip(
        numbered_edges(triangles.astype(np.int32), n), numbered_edges(triangles, n), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(numbered_edges(triangles.astype(np.int32), n)[0], one.edges)


@pytest.mark.parametrize("seed", range(5))
def test_loops_are_walked_around_from_their_smallest_vertices(seed):
    """Of several pieces with holes, whatever the vertices' numbers are."""
    rng = np.random.default_rng(seed)
    vertices, triangles = shapes.grid(24, 18)
    row, column = np.divmod(np.tile(np.arange(24 * 18), 2), 24)  # of every triangle's quad
    kept = column != 12  # two pieces
    for left, below in ((4, 4), (17, 9)):
        kept &= (np.abs(column - left) > 2) | (np.abs(row - below) > 2)
    number = rng.permutation(len(vertices))
    triangles = number[triangles[kept]][rng.permutation(kept.sum())]
    topology = Topology(triangles, len(vertices))
    start, end = (each[topology.on_boundary].tolist() for each in topology.half_edges)
    found = [list(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)) for loop in topology.loops]
    assert len(found) == 4
    assert sorted(side for loop in found for side in loop) == sorted(zip(start, end, strict=True))
    assert [loop[0] for loop in topology.loops] == sorted(loop.min() for loop in topology.loops)
