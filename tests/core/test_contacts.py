# SPDX-License-Identifier: GPL-3.0-or-later
"""Islands that touch themselves: along a seam they may."""

import numpy as np
import pytest

from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.contacts import touches_along_seams_only
from qh_unwrap.core.pieces import components
from qh_unwrap.core.topology import Topology

from .overlaps import is_clean

_SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])


def strip(cells, links):
    """Unit squares at whole numbers, (k, 2), joined as `links` say and nowhere else: points, triangles and loops."""
    corners = (np.asarray(cells)[:, None] + _SQUARE).reshape(-1, 2)
    one, other = [], []
    for i, j in links:
        for a in range(4 * i, 4 * i + 4):
            for b in range(4 * j, 4 * j + 4):
                if (corners[a] == corners[b]).all():
                    one.append(a)
                    other.append(b)
    count, number = components(len(corners), np.array(one), np.array(other))
    uv = np.zeros((count, 2))
    uv[number] = corners
    squares = number.reshape(-1, 4)
    triangles = np.vstack([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    return uv, triangles, Topology(triangles, count).loops


def random_tree(seed, count):
    """Squares, each laid against a free side of one of the last, whatever lies there already."""
    random = np.random.default_rng(seed)
    cells, links, taken = [(0, 0)], [], set()
    while len(cells) < count:
        at, side = random.integers(max(len(cells) - 3, 0), len(cells)), random.integers(4)
        x, y = [(1, 0), (-1, 0), (0, 1), (0, -1)][side]
        cell = cells[at][0] + x, cells[at][1] + y
        if (at, side) not in taken and (cell not in cells or random.random() < 0.05):
            taken |= {(at, side), (len(cells), side ^ 1)}
            links.append((at, len(cells)))
            cells.append(cell)
    return cells, links


def same_places(uv):
    return np.unique(uv, axis=0, return_inverse=True)[1].ravel()


@pytest.mark.parametrize("seed", range(300))
def test_squares_that_touch_each_other_overlap_or_do_not(seed):
    uv, triangles, loops = strip(*random_tree(seed, 4 + seed % 25))
    clean = is_clean(uv, triangles)
    assert touches_along_seams_only(uv, loops, same_places(uv)) == clean
    assert touches_along_seams_only(uv, loops, np.arange(len(uv))) == is_injective(uv, triangles, loops)
    assert clean or not is_injective(uv, triangles, loops)


def test_some_of_them_touch_and_some_overlap():
    kinds = set()
    for seed in range(300):
        uv, triangles, loops = strip(*random_tree(seed, 4 + seed % 25))
        kinds.add((is_clean(uv, triangles), is_injective(uv, triangles, loops)))
    assert kinds == {(True, True), (True, False), (False, False)}


def ring_of_squares(turns):
    """Squares around a hole, as often as that, not joined where they come back to where they began."""
    around = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    cells = around * turns
    return strip(cells, [(k, k + 1) for k in range(len(cells) - 1)])


def test_a_ring_that_is_closed_by_a_seam():
    uv, triangles, loops = ring_of_squares(1)
    assert not is_injective(uv, triangles, loops)
    assert touches_along_seams_only(uv, loops, same_places(uv))


def test_a_ring_that_goes_around_twice_covers_all_twice():
    uv, _, loops = ring_of_squares(2)
    assert not touches_along_seams_only(uv, loops, same_places(uv))


def test_places_that_differ_may_not_touch():
    uv, _, loops = ring_of_squares(1)
    place = same_places(uv)
    spots, counts = np.unique(place, return_counts=True)
    place[np.flatnonzero(place == spots[counts > 1][0])[0]] = 1000
    assert not touches_along_seams_only(uv, loops, place)


@pytest.mark.parametrize(("height", "expected"), [(1.9, True), (2, False), (2.1, False)])
def test_a_vertex_may_not_lie_on_a_side(height, expected):
    """One side of a slit has a vertex more than the other."""
    uv = np.array([(0, 0), (4, 0), (4, 4), (0, 4), (0, 2), (3, 2), (2, height), (0, 2)])
    place = np.array([0, 1, 2, 3, 4, 5, 6, 4])
    assert touches_along_seams_only(uv, [np.arange(8)], place) == expected


def test_holes_that_touch_the_outline():
    """A hole that reaches the outline in a point, and one that reaches another hole."""
    outer = [(0, 0), (6, 0), (6, 6), (0, 6)]
    hole = [(0, 0), (1, 2), (2, 1)]
    uv = np.array([*outer, *hole], dtype=float)
    loops = [np.arange(4), np.array([4, 5, 6])]
    same = np.array([0, 1, 2, 3, 0, 4, 5])
    assert touches_along_seams_only(uv, loops, same)
    assert not touches_along_seams_only(uv, loops, np.arange(7))
    assert not touches_along_seams_only(uv, [loops[0], loops[1][::-1]], same), "it is no hole"
    crossing = uv.copy()
    crossing[5] = (-1, 2)
    assert not touches_along_seams_only(crossing, loops, same)
