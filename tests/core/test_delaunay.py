# SPDX-License-Identifier: GPL-3.0-or-later
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay

from qh_unwrap.core.air import make_air
from qh_unwrap.core.certificate import turn
from qh_unwrap.core.delaunay import _by_qhull, _Edges, _one_by_one, _scaled, triangulate
from qh_unwrap.core.triangles import corners_of, signed_areas

NO_SIDES = np.empty((0, 2), dtype=int)


def edges_of(triangles):
    return np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)


def check(points, sides, triangles):
    assert (turn(*points[triangles.T]) > 0).all()
    edges, count = np.unique(edges_of(triangles), axis=0, return_counts=True)
    assert count.max() <= 2
    assert len(triangles) == 2 * len(points) - 2 - (count == 1).sum()
    assert len(points) - len(edges) + len(triangles) == 1
    np.testing.assert_array_equal(np.unique(triangles), np.arange(len(points)))
    assert set(map(tuple, np.sort(sides, axis=1).tolist())) <= set(map(tuple, edges.tolist()))


def check_area(points, triangles):
    assert signed_areas(corners_of(points, triangles)).sum() == pytest.approx(ConvexHull(points).volume, rel=1e-9)


def loop(n):
    return np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])


def within_a_circle(outline):
    angle = 2 * np.pi * np.arange(48) / 48
    centre = (outline.min(axis=0) + outline.max(axis=0)) / 2
    radius = 2.5 * np.linalg.norm(outline - centre, axis=1).max()
    return np.vstack([outline, centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])])


def spiral(n, turns, pitch):
    """A ribbon half as wide as its turns lie apart."""
    angle = np.linspace(0, 2 * np.pi * turns, n // 2)
    inner = 1 + pitch * angle / (2 * np.pi)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([inner[:, None] * direction, (inner[::-1, None] + pitch / 2) * direction[::-1]])


def comb(teeth, width):
    left, right = 2 * width * np.arange(teeth), 2 * width * np.arange(teeth) + width
    zero, one = np.zeros(teeth), np.ones(teeth)
    outline = np.column_stack([left, zero, left, one, right, one, right, zero]).reshape(-1, 2)
    return np.vstack([outline, [[2 * width * teeth, -width], [0, -width]]])


def koch(depth):
    corner = np.array([0, np.exp(1j * np.pi / 3), 1])
    for _ in range(depth):
        third = (np.roll(corner, -1) - corner) / 3
        tip = corner + third * (1 + np.exp(1j * np.pi / 3))
        corner = np.column_stack([corner, corner + third, tip, corner + 2 * third]).ravel()
    return np.column_stack([corner.real, corner.imag])


def maze(size, seed):
    """The outline of a random tree on a grid, thickened to half the grid's step."""
    rng = np.random.default_rng(seed)
    inside = np.zeros((2 * size + 1, 2 * size + 1), bool)
    inside[1, 1] = True
    stack = [(1, 1)]
    while stack:
        x, y = stack[-1]
        ways = [(i, j) for i, j in ((2, 0), (-2, 0), (0, 2), (0, -2)) if 0 < x + i < 2 * size and 0 < y + j < 2 * size]
        ways = [(i, j) for i, j in ways if not inside[x + i, y + j]]
        if not ways:
            stack.pop()
            continue
        i, j = ways[rng.integers(len(ways))]
        inside[x + i // 2, y + j // 2] = inside[x + i, y + j] = True
        stack.append((x + i, y + j))
    following = {}
    for x, y in np.argwhere(inside).tolist():
        for i, j in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            if not inside[x + i, y + j]:  # the side to this neighbour, with the cell on its left
                middle, along = np.array([2 * x + i, 2 * y + j]), np.array([-j, i])
                following[tuple((middle - along).tolist())] = tuple((middle + along).tolist())
    outline = [next(iter(following))]
    while following[outline[-1]] != outline[0]:
        outline.append(following[outline[-1]])
    assert len(outline) == len(following)
    return np.array(outline, dtype=float)


def star(n, seed):
    points = np.random.default_rng(seed).standard_normal((n, 2))
    return points[np.argsort(np.arctan2(points[:, 1], points[:, 0]))]


OUTLINES = {
    "spiral": lambda: spiral(2000, 20, 0.01),
    "fine spiral": lambda: spiral(2002, 5, 1e-4),
    "comb": lambda: comb(300, 1e-6),
    "koch": lambda: koch(5),
    "maze": lambda: maze(15, 1),
    "star": lambda: star(1500, 2),
    "flat": lambda: spiral(400, 0.5, 0.1) * [1, 1e-9],
    "far away": lambda: koch(3) + 1e6,
    "tiny": lambda: koch(3) * 1e-30,
}


@pytest.mark.parametrize("name", OUTLINES)
def test_outlines_become_edges(name):
    outline = OUTLINES[name]()
    points, sides = within_a_circle(outline), loop(len(outline))
    triangles = triangulate(points, sides)
    check(points, sides, triangles)
    check_area(points, triangles)


def test_thousands_of_sides_are_missing_at_first_in_a_spiral():
    points = _scaled(within_a_circle(spiral(2000, 20, 0.01)))
    assert not _Edges(_by_qhull(points), len(points)).contain(loop(2000)).all()


def test_air_is_made_without_blender():
    uv = star(60, 1) + 3
    points, on_circle, triangles, _ = make_air(uv, [np.arange(60)], triangulate)
    everything = np.vstack([uv, points])
    assert (turn(*everything[triangles.T]) > 0).all() and on_circle.sum() == 48
    assert make_air(uv[[1, 0, *range(2, 60)]], [np.arange(60)], triangulate) is None


@given(st.integers(0, 2**32 - 1), st.integers(4, 80))
@settings(deadline=None)
def test_any_triangulation_comes_back_from_its_edges(seed, n):
    # The Delaunay triangulation of the same points, stretched, is another one.
    points = np.random.default_rng(seed).random((n, 2))
    other = Delaunay(points * [1, 20]).simplices
    sides = np.random.default_rng(seed).permutation(np.unique(edges_of(other), axis=0))
    triangles = triangulate(points, sides)
    check(points, sides, triangles)
    as_sets = [set(map(tuple, np.sort(each, axis=1).tolist())) for each in (triangles, other)]
    assert as_sets[0] == as_sets[1]


def random_points(rng):
    """Up to 40 distinct points: on a grid, a line, a circle, in clusters, of very different size, or only random."""
    n = rng.integers(3, 40)
    kind = rng.integers(6)
    points = rng.random((n, 2))
    if kind == 0:
        points = rng.integers(0, 7, (n, 2)) @ [[0.8, 0.6], [-0.6, 0.8]] / 7 ** rng.integers(2)
    elif kind == 1:
        points[:, 1] = points[:, 0] / 3 + rng.choice([0, 1e-17, 1e-12]) * points[:, 1]
    elif kind == 2:
        points = np.column_stack([np.cos(40 * points[:, 0]), np.sin(40 * points[:, 0])])
    elif kind == 3:
        points[::2] = points[rng.integers(n)] + 10.0 ** -rng.integers(5, 16) * points[::2]
    elif kind == 4:
        points *= 10.0 ** rng.integers(-12, 1, (n, 1))
    return rng.permutation(np.unique(points, axis=0))


def are_possible(points, sides):
    """Whether the points do not lie on a line, no two sides cross, and no point lies on one: in exact arithmetic."""
    p = [tuple(map(Fraction, point)) for point in points.tolist()]

    def side_of(a, b, c):
        det = (p[b][0] - p[a][0]) * (p[c][1] - p[a][1]) - (p[b][1] - p[a][1]) * (p[c][0] - p[a][0])
        return (det > 0) - (det < 0)

    def on(a, b, c):
        return side_of(a, b, c) == 0 and min(p[a], p[b]) < p[c] < max(p[a], p[b])

    def cross(a, b, c, d):
        return side_of(a, b, c) * side_of(a, b, d) < 0 and side_of(c, d, a) * side_of(c, d, b) < 0

    sides = sides.tolist()
    return (
        len(p) > 2
        and any(side_of(0, 1, c) for c in range(len(p)))
        and not any(on(a, b, c) for a, b in sides for c in range(len(p)))
        and not any(cross(*one, *other) for one in sides for other in sides)
    )


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=300)
def test_triangles_come_back_exactly_where_there_can_be_some(seed):
    rng = np.random.default_rng(seed)
    points = random_points(rng)
    if len(points) < 2:
        return
    sides = rng.integers(0, len(points), (rng.integers(5), 2))
    sides = sides[sides[:, 0] != sides[:, 1]]
    triangles = triangulate(points, sides)
    assert (triangles is not None) == are_possible(points, sides)
    if triangles is not None:
        check(points, sides, triangles)


@given(st.integers(0, 2**32 - 1), st.integers(3, 60))
@settings(deadline=None)
def test_without_qhull_the_triangles_are_the_same(seed, n):
    points = _scaled(np.random.default_rng(seed).random((n, 2)))
    as_sets = []
    for triangles in (_one_by_one(points), _by_qhull(points)):
        check(points, NO_SIDES, triangles)
        as_sets.append(set(map(tuple, np.sort(triangles, axis=1).tolist())))
    assert as_sets[0] == as_sets[1]


def test_points_nearer_than_single_precision_stay_apart():
    points = within_a_circle(spiral(200, 3, 0.1))
    points = np.vstack([points, points[:50] + 1e-13])
    check(points, loop(200), triangulate(points, loop(200)))


SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])


def test_there_are_no_triangles_where_there_can_be_none():
    assert triangulate(SQUARE, np.array([[0, 2], [1, 3]])) is None  # sides cross
    assert triangulate(np.vstack([SQUARE, [[0.5, 0.5]]]), np.array([[0, 2]])) is None  # a point lies on a side
    assert triangulate(np.vstack([SQUARE, SQUARE[:1]]), loop(4)) is None  # points coincide
    assert triangulate(SQUARE, np.array([[2, 2]])) is None
    assert triangulate(SQUARE[[0, 1]], NO_SIDES) is None
    assert triangulate(np.column_stack([np.arange(9), np.arange(9)]) / 3, NO_SIDES) is None
    assert triangulate(0 * SQUARE, loop(4)) is None
    assert triangulate(SQUARE * np.nan, loop(4)) is None
    assert triangulate(SQUARE + [1, np.inf], loop(4)) is None


def test_sides_may_be_given_twice_and_either_way():
    check(SQUARE, SQUARE[:0].astype(int), triangulate(SQUARE, np.array([[0, 2], [2, 0], [0, 1], [1, 0]])))


def test_the_hull_may_have_straight_sides():
    grid = np.mgrid[:20, :20].reshape(2, -1).T.astype(float)
    for points in (grid, grid @ [[0.8, 0.6], [-0.6, 0.8]] / 7):
        triangles = triangulate(points, NO_SIDES)
        check(points, NO_SIDES, triangles)
        check_area(points, triangles)
