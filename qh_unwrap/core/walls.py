# SPDX-License-Identifier: GPL-3.0-or-later
"""Walls: segments in the plane that an island's outline must not cross, as the outlines of the islands around it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .certificate import near_boxes, turn


def clear_walls(walls: np.ndarray, polygons: Sequence[np.ndarray]) -> np.ndarray:
    """The walls (w, 2, 2), each once, but for those that cross or touch a side of the closed `polygons`, (k, 2) each,
    or another wall.  Ends that two have in common do not count as touching."""
    walls = np.asarray(walls, dtype=float)
    walls = walls[(walls[:, 0] != walls[:, 1]).any(axis=1)]
    if not len(walls):
        return walls
    flipped = (walls[:, 0, 0] > walls[:, 1, 0]) | (
        (walls[:, 0, 0] == walls[:, 1, 0]) & (walls[:, 0, 1] > walls[:, 1, 1])
    )
    walls = np.unique(np.where(flipped[:, None, None], walls[:, ::-1], walls).reshape(-1, 4), axis=0).reshape(-1, 2, 2)
    start = np.concatenate([walls[:, 0], *polygons])
    end = np.concatenate([walls[:, 1], *(np.roll(points, -1, axis=0) for points in polygons)])
    bad = np.zeros(len(start), bool)
    for one, other in near_boxes(np.minimum(start, end), np.maximum(start, end), np.zeros(len(start), int)):
        some = (one < len(walls)) | (other < len(walls))
        one, other = one[some], other[some]
        meet = _meet(start[one], end[one], start[other], end[other])
        bad[one[meet]] = bad[other[meet]] = True
    return walls[~bad[: len(walls)]]


def _meet(a, b, c, d):
    """Whether the segments from a to b and from c to d, (k, 2) each, have more in common than an end, (k,) bool."""
    meet = (turn(a, b, c) * turn(a, b, d) <= 0) & (turn(c, d, a) * turn(c, d, b) <= 0)
    shared = [(one == other).all(axis=1) for one in (a, b) for other in (c, d)]
    once = np.sum(shared, axis=0) == 1
    # With an end in common they meet elsewhere only where both lie on a line, on the same side of that end.
    on_a_line = (turn(a, b, c) == 0) & (turn(a, b, d) == 0)
    along = np.where((shared[0] | shared[1])[:, None], b - a, a - b)
    its = np.where((shared[0] | shared[2])[:, None], d - c, c - d)
    back = (along * its).sum(axis=1) > 0
    return np.where(once, on_a_line & back, meet)
