# SPDX-License-Identifier: GPL-3.0-or-later
from fractions import Fraction

import numpy as np
import pytest

from qh_unwrap.core import Surface
from qh_unwrap.core.certificate import count_crossings, enclosed_area, is_injective, orientation, turn

from . import shapes


def test_orientation_is_that_of_the_stored_floats():
    # In double precision counter-clockwise by 1e-10; rounded to 32 bits all three lie on a line.
    uv = np.array([[0.1, 0.1], [0.7, 0.7], [0.3, 0.3 + 1e-10]])
    assert orientation(uv, np.array([[0, 1, 2]])) == [0]
    # An exact sign where doubles cancel: nearly collinear points of very different size
    uv = np.array([[1e-30, 0], [1.0, 1.0], [2.0, 2.0]])
    assert orientation(uv, np.array([[0, 1, 2], [1, 0, 2]])).tolist() == [-1, 1]


def test_turns_are_those_of_exact_arithmetic():
    rng = np.random.default_rng(1)
    points = rng.integers(-3, 4, (3, 4000, 2)) * 0.1
    points[:, 1000:] += rng.choice([0, 1e-16, 1e-9, 1 / 3], (3, 3000, 2))
    points[:, 2000:] = points[:, 2000:].astype(np.float32)
    points[:, 3000:] *= 2.0 ** rng.integers(-40, 40, (3, 1000, 2))
    exact = []
    for a, b, c in zip(*points.tolist(), strict=True):
        (ax, ay), (bx, by), (cx, cy) = (map(Fraction, point) for point in (a, b, c))
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        exact.append((det > 0) - (det < 0))
    assert turn(*points).tolist() == exact
    assert exact.count(0) > 100


def test_enclosed_area():
    square = np.array([[0, 0], [2, 0], [2, 1.0], [0, 1]])
    assert enclosed_area(square) == 2 and enclosed_area(square[::-1]) == -2


def test_crossings_equal_those_of_all_pairs():
    rng = np.random.default_rng(0)

    def crosses(a, b, c, d):
        def side(p, q, r):
            return np.sign((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

        return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0

    for n in (3, 4, 9, 30):
        polygon = rng.random((n, 2))
        ends = np.roll(polygon, -1, axis=0)
        expected = sum(crosses(polygon[i], ends[i], polygon[k], ends[k]) for i in range(n) for k in range(i))
        assert count_crossings([polygon]) == expected
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    assert count_crossings([square, square * 0.5 + 0.1]) == 0
    assert count_crossings([square, square + 0.5]) == 2


def test_touching_counts_on_demand():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    for other in (square + [1, 0.2], square + [1, 1], 0.3 * square + [0.3, 0], square[:3] * 0.5):
        assert count_crossings([square, other]) == 0
        assert count_crossings([square, other], touching=True) > 0
    spike = np.array([[0, 0], [1, 0], [2, 0], [1, 0], [1, 1.0]])
    assert count_crossings([spike], touching=True) > 0
    assert count_crossings([square, 3 * square - 1], touching=True) == 0


def spiral(turns):
    """A flat ribbon whose end comes round to its beginning, and over it if `turns` is more than one."""
    angle = np.linspace(0, 2 * np.pi * turns, 60)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    k = np.arange(59)
    triangles = np.vstack([np.c_[k, k + 60, k + 61], np.c_[k, k + 61, k + 1]])
    return np.vstack([0.6 * rim, rim]), triangles


@pytest.mark.parametrize("turns, injective", [(0.9, True), (1.02, False), (1.1, False), (2.2, False)])
def test_overlaps_without_flips_are_not_certified(turns, injective):
    uv, triangles = spiral(turns)
    surface = Surface(np.column_stack([uv, np.arange(len(uv)) % 60]), triangles)
    assert (orientation(uv, triangles) > 0).all()
    assert is_injective(uv, triangles, surface.loops) == injective


def test_flips_and_holes_outside_are_not_certified():
    vertices, triangles = shapes.ring()
    surface = Surface(vertices, triangles)
    assert is_injective(vertices[:, :2], triangles, surface.loops)
    assert not is_injective(vertices[:, :2] * [-1, 1], triangles, surface.loops)
    inside_out = vertices[:, :2] / (vertices[:, :2] ** 2).sum(axis=1, keepdims=True)
    assert not is_injective(inside_out, triangles, surface.loops)


def test_thousands_of_turns_over_one_another_are_no_injective_map():
    angle = 2 * np.pi * np.arange(3000) / 20
    turns = np.column_stack([np.cos(angle), np.sin(angle)])
    wound = np.vstack([turns, 1.2 * turns[::-1]])
    apart = np.vstack([angle, 0 * angle]).T, np.vstack([angle, 0 * angle + 1]).T[::-1]
    for outline, expected in ((wound, False), (np.vstack(apart), True)):
        outline = outline[:: 1 if enclosed_area(outline) > 0 else -1]
        assert is_injective(outline, np.empty((0, 3), int), [np.arange(len(outline))]) == expected
