# SPDX-License-Identifier: GPL-3.0-or-later
"""Which islands lie on top of each other in the plane."""

from collections.abc import Sequence

import numpy as np

from .certificate import near_boxes
from .placing import boxes

_DEPTH = 1e-5  # depth, relative to the size of the smaller triangle, up to which two triangles merely touch


def overlapping(islands: Sequence[np.ndarray]) -> list[tuple[int, int]]:
    """The pairs (i, j), i < j, of islands, each given as triangles (t, 3, 2), that share some area."""
    found = []
    for one, other in _meeting(*boxes([island.reshape(-1, 2) for island in islands])):
        pairs = zip(one.tolist(), other.tolist(), strict=True)
        found += [(min(pair), max(pair)) for pair in pairs if overlap(*(islands[k] for k in pair))]
    return sorted(found)


def overlap(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether triangles (s, 3, 2) share some area with triangles (t, 3, 2)."""
    low = np.maximum(one.min(axis=(0, 1)), other.min(axis=(0, 1)))
    high = np.minimum(one.max(axis=(0, 1)), other.max(axis=(0, 1)))
    one, other = (each[_meets(each, low, high)] for each in (one, other))
    if not len(one) or not len(other):
        return False
    both = np.concatenate([one, other])
    for first, second in _meeting(both.min(axis=1), both.max(axis=1)):
        apart = (first < len(one)) != (second < len(one))
        if _share_area(both[first[apart]], both[second[apart]]).any():
            return True
    return False


def _meets(triangles, low, high):
    """Which triangles (t, 3, 2) have a box that shares some area with that from `low` to `high`, (t,) bool."""
    return ((triangles.max(axis=1) > low) & (triangles.min(axis=1) < high)).all(axis=1)


def _meeting(low, high):
    """Yield the pairs (k,), (k,) of boxes (n, 2) that overlap, some at a time; each pair comes once."""
    for one, other in near_boxes(low, high, np.zeros(len(low), int)):
        meet = ((low[one] < high[other]) & (low[other] < high[one])).all(axis=1)
        yield one[meet], other[meet]


def _share_area(one, other):
    """Which pairs of triangles, (k, 3, 2) each, share some area, (k,) bool.

    Two triangles share none if and only if some side of either has them on different sides of it.  So both are measured
    across each of the six sides: how far their ranges there overlap is how deep they lie in each other.
    """
    shared = np.ones(len(one), dtype=bool)
    least = _DEPTH * np.minimum(np.ptp(one, axis=1).max(axis=1), np.ptp(other, axis=1).max(axis=1))
    for sides in (np.roll(one, -1, axis=1) - one, np.roll(other, -1, axis=1) - other):
        length = np.linalg.norm(sides, axis=2)
        for side in range(3):
            normal = sides[:, side, ::-1] * (1, -1) / np.maximum(length[:, side], 1e-300)[:, None]
            first, second = (np.einsum("kcd,kd->kc", each, normal) for each in (one, other))
            depth = np.minimum(first.max(axis=1), second.max(axis=1)) - np.maximum(
                first.min(axis=1), second.min(axis=1)
            )
            shared &= (depth > least) | (length[:, side] == 0)
    return shared
