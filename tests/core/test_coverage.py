# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles lie on others: as an independent check says, and quickly where everything does."""

from time import process_time

import numpy as np
import pytest

from qh_unwrap.core.coverage import covered
from qh_unwrap.core.stepping import finished

from . import shapes
from .overlaps import faults


def found(corners, group=None, sheet=None):
    return finished(covered(corners, np.zeros(len(corners), int) if sheet is None else sheet, group))


def second_opinion(corners):
    """The pairs of triangles (k, 2) that share some area."""
    return faults(corners.reshape(-1, 2), np.arange(3 * len(corners)).reshape(-1, 3))[2]


@pytest.mark.parametrize("seed", range(24))
def test_as_every_pair_compared_exactly(seed):
    random = np.random.default_rng(seed)
    count = random.integers(2, 80)
    corners = random.random((count, 3, 2))
    if seed % 3 == 0:
        corners = np.round(6 * corners) / 6  # many touch, and some have no area
    elif seed % 3 == 1:
        corners = 0.2 * corners + random.random((count, 1, 2))
    corners = corners.astype(np.float32).astype(float)
    pairs = second_opinion(corners)
    expected = np.zeros(count, bool)
    expected[pairs.ravel()] = True
    assert (found(corners).triangles == expected).all()

    group = random.integers(0, 5, count)
    apart = pairs[group[pairs[:, 0]] != group[pairs[:, 1]]]
    expected[:] = False
    expected[apart.ravel()] = True
    result = found(corners, group)
    assert (result.triangles == expected).all()
    meeting = {tuple(sorted(pair)) for pair in group[apart].tolist()}
    assert {tuple(pair) for pair in result.pairs.tolist()} <= meeting
    assert {*result.pairs.ravel().tolist()} == {each for pair in meeting for each in pair}
    assert not found(corners, sheet=np.arange(count)).triangles.any()


def test_neighbours_touch_and_cover_nothing():
    vertices, triangles = shapes.grid(60, 60)
    corners = vertices[triangles][..., :2]
    assert not found(corners).triangles.any()
    assert not found(corners, np.arange(len(corners))).triangles.any()
    assert found(np.concatenate([corners, corners[77:78] + (1e-3, 0)])).triangles.sum() > 1


@pytest.mark.parametrize("way", ["large", "small", "slivers", "on each other"])
def test_a_tangle_takes_no_longer(way):
    random = np.random.default_rng(0)
    corners = random.random((40_000, 3, 2))
    if way == "small":
        corners = random.random((len(corners), 1, 2)) + 0.005 * corners
    elif way == "slivers":
        corners[:, 2] = corners[:, 1] + 1e-5 * corners[:, 0]
    elif way == "on each other":
        corners[:] = corners[0]
    start = process_time()
    assert found(corners).triangles.mean() > 0.4
    assert process_time() - start < 10


def test_a_crowd_far_from_another_triangle_takes_no_longer():
    vertices, triangles = shapes.grid(100, 100)
    corners = np.concatenate([1e-3 * vertices[triangles][..., :2], [[(1, 1), (2, 1), (1, 2)]]])
    start = process_time()
    assert not found(corners).triangles.any()
    assert process_time() - start < 8
