# SPDX-License-Identifier: GPL-3.0-or-later
"""A second opinion on maps: every pair of triangles that could overlap, compared exactly.

It shares no code and no theorem with the package: no outlines, no winding numbers, only triangles.
"""

from itertools import product

import numpy as np

_BITS = 149  # every 32-bit float is a whole number of 2^-149


def faults(uv, triangles):
    """How many triangles are flipped, how many are collapsed, and the pairs (k, 2) of triangles whose interiors meet,
    for the map `uv` (n, 2) in 32-bit floats.
    """
    corners = np.asarray(uv).astype(np.float32).astype(np.float64)[triangles]
    side = _sides(*corners.transpose(1, 0, 2))
    return int(np.sum(side < 0)), int(np.sum(side == 0)), _overlapping(corners, side)


def is_clean(uv, triangles):
    """Whether no triangle is flipped or collapsed and no two overlap."""
    flipped, collapsed, pairs = faults(uv, triangles)
    return not flipped and not collapsed and not len(pairs)


def _overlapping(corners, side):
    corners = np.where((side < 0)[:, None, None], corners[:, ::-1], corners)
    solid = np.flatnonzero(side)
    found = []
    for pairs in _near(corners[solid]):
        one, other = corners[solid[pairs.T]]
        doubtful = np.flatnonzero(~_separated(one, other, _likely_sides))
        meeting = doubtful[~_separated(one[doubtful], other[doubtful], _sides)]
        found.append(solid[pairs[meeting]])
    return np.vstack(found) if found else np.zeros((0, 2), dtype=np.int64)


def _separated(one, other, sides):
    """Whether a side of one of two counter-clockwise triangles (k, 3, 2) has the other triangle on its right."""
    result = np.zeros(len(one), bool)
    for first, second in ((one, other), (other, one)):
        for c in range(3):
            a, b = first[:, c], first[:, (c + 1) % 3]
            result |= np.all([sides(a, b, second[:, k]) <= 0 for k in range(3)], axis=0)
    return result


def _likely_sides(a, b, p):
    """1 where p lies on the left of the line from a to b or very near it, else -1; all (k, 2)."""
    (x, y), (u, v) = (b - a).T, (p - a).T
    error = 1e-15 * (np.abs(x * v) + np.abs(y * u))
    at_end = (p == a).all(axis=1) | (p == b).all(axis=1)
    return np.where((x * v - y * u < -error) | at_end, -1, 1)


def _sides(a, b, p):
    """1 where p lies on the left of the line from a to b, -1 on the right, 0 on it, in whole numbers where doubtful."""
    (x, y), (u, v) = (b - a).T, (p - a).T
    twice_area = x * v - y * u
    result = np.sign(twice_area).astype(np.int64)
    k = np.flatnonzero(np.abs(twice_area) <= 1e-15 * (np.abs(x * v) + np.abs(y * u)))
    if len(k):
        (ax, ay), (bx, by), (px, py) = (_whole(points[k]) for points in (a, b, p))
        twice_area = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
        result[k] = (twice_area > 0).astype(np.int64) - (twice_area < 0).astype(np.int64)
    return result


def _whole(points):
    numbers = [[int(value * 2.0**_BITS) for value in axis] for axis in points.T.tolist()]
    return np.array(numbers, dtype=object)


def _near(corners):
    """Pairs (k, 2) of triangles (m, 3, 2) whose bounding boxes meet, each once, in portions.

    Every triangle enters a grid with cells of its own size, two by two of them at most; and looks itself for larger
    ones and its like in theirs.
    """
    if len(corners) < 2:
        return
    low, high = corners.min(axis=1), corners.max(axis=1)
    low, high = low - low.min(axis=0), high - low.min(axis=0)
    size = np.ceil(np.log2(np.maximum((high - low).max(axis=1), 1e-7 * high.max()))).astype(int)
    for level in np.unique(size):
        filed, owner = _cells(low, high, np.flatnonzero(size == level), level)
        order = np.argsort(filed, kind="stable")
        filed, owner = filed[order], owner[order]
        asked, asking = _cells(low, high, np.flatnonzero(size <= level), level)
        first, last = np.searchsorted(filed, asked), np.searchsorted(filed, asked, side="right")
        for part in np.array_split(np.arange(len(asked)), 1 + (last - first).sum() // 2_000_000):
            count = (last - first)[part]
            at = np.repeat(first[part] - np.cumsum(count) + count, count) + np.arange(count.sum())
            one, other = np.repeat(asking[part], count), owner[at]
            meet = (low[one] < high[other]).all(axis=1) & (low[other] < high[one]).all(axis=1)
            new = meet & ((size[one] < level) | (one < other))
            # Of the cells that two share, count the one with the low corner of what they share.
            corner = np.floor(np.maximum(low[one], low[other]) / 2.0**level).astype(np.int64)
            new &= _key(corner) == np.repeat(asked[part], count)
            yield np.column_stack([one, other])[new]


def _cells(low, high, chosen, level):
    """The cells of 2^level that meet the `chosen` boxes, as keys, and which box each is of."""
    first, last = (np.floor(corner[chosen] / 2.0**level).astype(np.int64) for corner in (low, high))
    keys, boxes = [], []
    for step in product((0, 1), repeat=2):
        within = (first + step <= last).all(axis=1)
        keys.append(_key(first[within] + step))
        boxes.append(chosen[within])
    return np.concatenate(keys), np.concatenate(boxes)


def _key(cell):
    return cell @ [1 << 31, 1]
