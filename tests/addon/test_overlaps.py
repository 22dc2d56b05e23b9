# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core.overlaps import overlap, overlapping

_TRIANGLE = np.array([[(0, 0), (1, 0), (0, 1)]], dtype=float)


def sheet(size, shift=(0, 0)):
    """A unit square of 2 * size * size triangles."""
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    start = np.column_stack([x.ravel(), y.ravel()])[:, None]
    square = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])
    return np.concatenate([start + triangle for triangle in square]) / size + shift


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (_TRIANGLE, True),
        (_TRIANGLE[:, ::-1], True),
        (1 - _TRIANGLE, False),  # the other half of the square
        (_TRIANGLE + (1, 0), False),  # meets in a point
        (_TRIANGLE + (0.5, 0.5), False),  # along a side
        (_TRIANGLE + (0.4, 0.4), True),
        (0.1 * _TRIANGLE + (0.2, 0.2), True),  # within
        (10 * _TRIANGLE - (3, 3), True),  # around
        (_TRIANGLE * (1, 0), False),  # no area
    ],
)
def test_two_triangles(other, expected):
    assert overlap(_TRIANGLE, other) == overlap(other, _TRIANGLE) == expected


def test_neighbours_do_not_overlap():
    sheets = [sheet(5), sheet(7, (1, 0)), sheet(6, (0, 1)), sheet(4, (1.5, 0.5)), sheet(3, (5, 5))]
    assert overlapping(sheets) == [(1, 3)]
    assert overlapping(sheets[:1]) == []


@pytest.mark.parametrize("seed", range(3))
def test_random_triangles_as_by_sampling(seed):
    random = np.random.default_rng(seed)
    triangles = list(random.random((30, 1, 3, 2)))
    weights = random.dirichlet(np.ones(3), 4000)
    found = set(overlapping(triangles))
    for i in range(30):
        points = weights @ triangles[i][0]
        for j in range(i + 1, 30):
            a, b, c = triangles[j][0]
            inside = np.linalg.solve(np.column_stack([b - a, c - a]), (points - a).T)
            if ((inside > 1e-3).all(axis=0) & (inside.sum(axis=0) < 1 - 1e-3)).any():
                assert (i, j) in found
    assert len(found) < 30 * 29 / 2


def test_dense_stack_is_quick():
    assert overlap(sheet(150), sheet(150, (0.3, 0.3)))
    assert not overlap(sheet(150), sheet(150, (1, 0)))
