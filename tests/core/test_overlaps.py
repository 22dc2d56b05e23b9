# SPDX-License-Identifier: GPL-3.0-or-later
"""The checker of maps is checked itself, against polygons cut in fractions."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from . import shapes
from .overlaps import faults, is_clean


def shared_area(one, other):
    """The exact area that two triangles share, by cutting one along the other's sides."""
    one, other = ([(Fraction(x), Fraction(y)) for x, y in corners.tolist()] for corners in (one, other))

    def twice_area(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    if twice_area(*other) < 0:
        other = other[::-1]
    polygon = one
    for a, b in zip(other, other[1:] + other[:1], strict=True):
        kept = []
        for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            at_p, at_q = twice_area(a, b, p), twice_area(a, b, q)
            if at_p >= 0:
                kept.append(p)
            if at_p * at_q < 0:
                t = at_p / (at_p - at_q)
                kept.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        polygon = kept
    area = sum((twice_area(polygon[0], p, q) for p, q in pairwise(polygon)), Fraction(0))
    return abs(area) if polygon and twice_area(*other) else Fraction(0)


def brute_force(uv, triangles):
    corners = uv.astype(np.float32).astype(float)[triangles]
    m = len(triangles)
    return {(i, k) for i in range(m) for k in range(i + 1, m) if shared_area(corners[i], corners[k]) > 0}


def as_set(pairs):
    return {(min(pair), max(pair)) for pair in pairs.tolist()}


@pytest.mark.parametrize("seed", range(12))
def test_overlaps_are_those_of_all_pairs(seed):
    random = np.random.default_rng(seed)
    # Corners on a small grid touch, coincide and line up; others are as small or as thin as can be.
    uv = random.integers(0, 5, (24, 2)).astype(float)
    if seed % 3 == 1:
        uv += random.normal(size=uv.shape) * 10.0 ** random.uniform(-8, 0, (24, 1))
    if seed % 3 == 2:
        uv = np.vstack([uv, 1 + 10.0 ** random.uniform(-6, 0, (24, 1)) * random.normal(size=(24, 2))])
    triangles = np.array([random.choice(len(uv), 3, replace=False) for _ in range(25)])
    pairs = faults(uv, triangles)[2]
    assert len(as_set(pairs)) == len(pairs)
    assert as_set(pairs) == brute_force(uv, triangles)


def test_a_flat_patch_is_clean_until_a_vertex_crosses_a_side():
    vertices, triangles = shapes.random_disk(3)
    uv = vertices[:, :2].copy()
    assert is_clean(uv, triangles)
    uv[5] += 0.4
    flipped, collapsed, pairs = faults(uv, triangles)
    assert flipped and not collapsed and as_set(pairs) == brute_force(uv, triangles)


def test_neighbours_that_only_touch_do_not_overlap():
    vertices, triangles = shapes.grid(40, 30, width=1.1)
    assert faults(vertices[:, :2], triangles)[:2] == (0, 0)
    assert is_clean(vertices[:, :2], triangles)
    turned = vertices[:, :2] @ [[0.8, 0.6], [-0.6, 0.8]]
    assert is_clean(turned, triangles)


def test_one_unit_in_the_last_place_is_an_overlap():
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [2, 1], [1, 2.0], [0.5, 0.5]])
    below = np.array([[0, 1, 2], [3, 4, 5], [6, 4, 5]])
    assert is_clean(uv, below[[0, 2]])
    uv[6] = np.nextafter(np.float32(0.5), np.float32(0))
    assert as_set(faults(uv, below[[0, 2]])[2]) == {(0, 1)}


def test_collapsed_triangles_are_counted():
    uv = np.array([[0, 0], [1, 1], [2, 2], [0, 1.0]])
    assert faults(uv, np.array([[0, 1, 2], [0, 1, 3], [1, 0, 3]]))[:2] == (1, 1)
