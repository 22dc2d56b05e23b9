# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of several pieces laid end to end, and where each begins."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def starts_of(arrays):
    """Where each of the arrays begins when they are joined, (p,)."""
    return np.cumsum([0, *(len(each) for each in arrays[:-1])])


def numbers(starts, count):
    """The piece of each of `count` items, of which those of a piece begin at `starts` (p,)."""
    return np.repeat(np.arange(len(starts)), np.diff(starts, append=count))


def first_and_last(items, place, count):
    """The first and the last of the `items` (k,) at each of `count` places, (count,) each; anything where is none."""
    first, last = np.empty((2, count), items.dtype)
    first[place[::-1]], last[place] = items[::-1], items
    return first, last


def components(count, one, other):
    """How many parts things fall into that are linked in pairs, and that of each, (count,)."""
    one, other = one.astype(np.int32), other.astype(np.int32)  # as SciPy has them, and the links as numbers
    return connected_components(coo_array((np.ones(len(one)), (one, other)), shape=(count, count)), directed=False)


def joined(points, triangles):
    """Points (n, d) and triangles (m, 3) of several meshes, two lists, as one mesh, and where each begins in both."""
    point_starts, triangle_starts = starts_of(points), starts_of(triangles)
    moved = [its + start for its, start in zip(triangles, point_starts, strict=True)]
    return np.concatenate(points), np.concatenate(moved), point_starts, triangle_starts
