# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of several pieces laid end to end, and where each begins."""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from .triangles import areas_in_space, corners_of, signed_areas


def starts_of(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Where each of the arrays begins when they are joined, (p,)."""
    sizes = np.fromiter(map(len, arrays), np.intp, len(arrays))
    return np.cumsum(sizes) - sizes


def parts_of(values: np.ndarray, starts: np.ndarray) -> list[np.ndarray]:
    """The values of each piece, where they begin at its place in `starts` (p,): `joined` undone."""
    return [values[start:end] for start, end in pairwise([*starts.tolist(), len(values)])]


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


def first_of_parts(count: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The first of all of `count` things that hang together by links with each of them, (count,).

    The k-th link joins the things `one[k]` and `other[k]`.
    """
    first = np.arange(count)
    while len(one):
        # Whatever is no least one among its neighbours is led to one of these, so that at most half remain, and then
        # all to where their leaders were led.
        first[np.maximum(one, other)] = np.minimum(one, other)
        while True:
            farther = first[first]
            if np.array_equal(farther, first):
                break
            first = farther
        one, other = first[one], first[other]
        apart = one != other
        one, other = one[apart], other[apart]
    return first


def components(count: int, one: np.ndarray, other: np.ndarray) -> tuple[int, np.ndarray]:
    """How many parts `count` things fall into, and the part of each, (count,), numbered by their first things.

    Parts are what hangs together by links, as in `first_of_parts`.
    """
    first = first_of_parts(count, one, other)
    is_first = first == np.arange(count)
    return int(is_first.sum()), (np.cumsum(is_first) - 1)[first]


def joined(
    points: Sequence[np.ndarray], triangles: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Several meshes as one: its points (n, d), its triangles (m, 3), and where each mesh begins in both, (p,) each.

    The k-th mesh has the points `points[k]` and the `triangles[k]` of these.
    """
    point_starts, triangle_starts = starts_of(points), starts_of(triangles)
    corners = np.concatenate(triangles)
    corners = corners + np.repeat(point_starts, np.diff(triangle_starts, append=len(corners)))[:, None]
    return np.concatenate(points), corners, point_starts, triangle_starts


class Pieces:
    """Several meshes as one: its points, its triangles, and where each of them begins in both.

    Parameters
    ----------
    points : sequence of (n, 3)
    triangles : sequence of (m, 3), at least one of each mesh
    """

    def __init__(self, points: Sequence[np.ndarray], triangles: Sequence[np.ndarray]):
        self.points, self.triangles, self.starts, self._triangle_starts = joined(points, triangles)

    @cached_property
    def piece(self) -> np.ndarray:
        """(n,), the piece of every point."""
        return numbers(self.starts, len(self.points))

    @cached_property
    def triangle_piece(self) -> np.ndarray:
        """(m,), the piece of every triangle."""
        return numbers(self._triangle_starts, len(self.triangles))

    @cached_property
    def areas(self) -> np.ndarray:
        """(p,), in space."""
        return self.sums(areas_in_space(self.points, self.triangles))

    def areas_in(self, uv: np.ndarray) -> np.ndarray:
        """The areas (p,) of the pieces in the map `uv` (n, 2), all triangles counted as positive."""
        return self.sums(np.abs(signed_areas(corners_of(uv, self.triangles))))

    def triangles_of(self, k: int) -> slice:
        """The triangles of piece k."""
        return slice(*np.append(self._triangle_starts, len(self.triangles))[k : k + 2])

    def boxes(self, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The lower left and the upper right corners, (p, 2) each, of the boxes around the pieces in the map `uv`
        (n, 2)."""
        return np.minimum.reduceat(uv, self.starts), np.maximum.reduceat(uv, self.starts)

    def sums(self, values: np.ndarray) -> np.ndarray:
        """The sums (p,) of values (m,) over the triangles of each piece."""
        return np.add.reduceat(values, self._triangle_starts)

    def of_each(self, values: np.ndarray) -> list[np.ndarray]:
        """The values (n, ...) at the points, piece by piece."""
        return parts_of(values, self.starts)
