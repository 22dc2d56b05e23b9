# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of several pieces laid end to end, and where each begins."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def starts_of(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Where each of the arrays begins when they are joined, (p,)."""
    return np.cumsum([0, *(len(each) for each in arrays[:-1])])


def numbers(starts: np.ndarray, count: int) -> np.ndarray:
    """The piece of each of `count` items, (count,), if those of each piece begin at its place in `starts` (p,)."""
    return np.repeat(np.arange(len(starts)), np.diff(starts, append=count))


def starts_of_numbers(number: np.ndarray, count: int) -> np.ndarray:
    """Where the items of each of `count` pieces begin, (count,), of items (k,) whose pieces' numbers ascend."""
    return np.searchsorted(number, np.arange(count))


def among(values: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Which of the values (k,) are among the sorted `numbers` (m,), of which there is one at least, (k,) bool."""
    return numbers[np.minimum(np.searchsorted(numbers, values), len(numbers) - 1)] == values


def around_faces(face_start: np.ndarray, corner_count: int) -> tuple[np.ndarray, np.ndarray]:
    """The face of each corner, (c,), and the corner that follows it around that face, (c,).

    The corners of each face begin at its place in `face_start` (f,).
    """
    face_end = np.append(face_start[1:], corner_count)
    corner_face = numbers(face_start, corner_count)
    following = np.arange(1, corner_count + 1)
    following[face_end - 1] = face_start
    return corner_face, following


def first_and_last(items: np.ndarray, place: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The first and the last item at each of `count` places, (count,) each; anything at a place that has none.

    `place` (k,) tells where each of the `items` (k,) is.  Where several numbers are assigned to one place of an array,
    NumPy keeps the last of them: assigned in reverse, that is the first.  This finds pairs without sorting.
    """
    first, last = np.empty((2, count), items.dtype)
    first[place[::-1]], last[place] = items[::-1], items
    return first, last


def components(count: int, one: np.ndarray, other: np.ndarray) -> tuple[int, np.ndarray]:
    """How many parts `count` things fall into, and the part of each, (count,).

    The k-th link joins the things `one[k]` and `other[k]`; parts are what hangs together by links.
    """
    one, other = one.astype(np.int32), other.astype(np.int32)  # the type that SciPy would convert them to
    return connected_components(coo_array((np.ones(len(one)), (one, other)), shape=(count, count)), directed=False)


def joined(
    points: Sequence[np.ndarray], triangles: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Several meshes as one: its points (n, d), its triangles (m, 3), and where each mesh begins in both, (p,) each.

    The k-th mesh has the points `points[k]` and the `triangles[k]` of these.
    """
    point_starts, triangle_starts = starts_of(points), starts_of(triangles)
    moved = [its + start for its, start in zip(triangles, point_starts, strict=True)]
    return np.concatenate(points), np.concatenate(moved), point_starts, triangle_starts
