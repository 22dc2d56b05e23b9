# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic on many triangles at once.

It is fastest where neighbours in memory are alike.  So the points at the corners of triangles, arrays (m, 3, d), are
kept in memory coordinate by coordinate: transposed, (d, 3, m), they are contiguous.  A field is an array that has the
triangles in its last axis, (..., m); fields are worked on a part of the triangles at a time.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

_AT_ONCE = 8192  # triangles, or entries of a matrix, in a part: what is made of them stays in the processor's cache
_COLLAPSED = 0.1  # length, relative to that of an edge by and large, that a triangle gets which is all in one place
_FLATTEST = 1e-6  # height, relative to its longest edge, below which a triangle has no area in single precision
_LOWEST = 1e-7  # height below which it cannot be told from its rounding errors, where the whole surface has the area 1
_OUTSIZE = 30  # lengths of an edge by and large, above which no longest edge makes a triangle count as flatter
_THICKENED = 1e-2  # height, relative to its longest edge, that it gets: enough to stay valid, too little to bend a map


def parts(count: int) -> list[slice]:
    """The parts, slices of at most `_AT_ONCE`, that so many triangles are worked on in."""
    return [slice(start, min(start + _AT_ONCE, count)) for start in range(0, count, _AT_ONCE)]


def by_parts(function: Callable[..., Any], *fields: np.ndarray) -> Any:
    """`function(*fields)`, a field or a tuple of fields, where that treats every triangle by itself.

    It is worked out for one part of the triangles after the other: so the many arrays that the function makes on the
    way are small enough for the processor's cache, and only its results are as long as the fields.
    """
    count = fields[0].shape[-1]
    if count <= _AT_ONCE:
        return function(*fields)
    results: list[np.ndarray] = []
    for part in parts(count):
        found = function(*(field[..., part] for field in fields))
        several = isinstance(found, tuple)
        found = found if several else (found,)
        results = results or [np.empty((*each.shape[:-1], count), each.dtype) for each in found]
        for result, each in zip(results, found, strict=True):
            result[..., part] = each
    return tuple(results) if several else results[0]


def sums_by_parts(function: Callable[..., np.ndarray], starts: np.ndarray, *fields: np.ndarray) -> np.ndarray:
    """The sums (r, p) of the field `function(*fields)` (r, m) over each piece; those begin at the `starts` (p,).

    Like `by_parts`, but the field itself is never as long as the others.  A piece may begin in one part and end in
    another: each part adds what it has of every piece that it meets.
    """
    sums = np.zeros((0, len(starts)))
    for part in parts(fields[0].shape[-1]):
        found = function(*(field[..., part] for field in fields))
        if not len(sums):
            sums = np.zeros((len(found), len(starts)))
        pieces = slice(np.searchsorted(starts, part.start, side="right") - 1, np.searchsorted(starts, part.stop))
        sums[:, pieces] += np.add.reduceat(found, np.maximum(starts[pieces] - part.start, 0), axis=1)
    return sums


def corners_of(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The points at the corners of the triangles, (m, 3, d), of `points` (n, d) and `triangles` (m, 3).

    Points that are used for one part after another are best kept coordinate by coordinate as well.
    """
    corner = triangles.T
    corners = np.empty((points.shape[1], *corner.shape))
    for values, result in zip(points.T, corners, strict=True):
        np.take(values, corner, out=result, mode="clip")  # which needs no further copy
    return corners.T


def boxes_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lower and the upper corners, (m, d) each, of the boxes around triangles (m, 3, d)."""
    a, b, c = corners.swapaxes(0, 1)
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def signed_areas(corners: np.ndarray) -> np.ndarray:
    """Signed areas (m,) of plane triangles (m, 3, 2), positive counter-clockwise."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return 0.5 * (ax * by - ay * bx)


def normals(corners: np.ndarray) -> np.ndarray:
    """Normals (m, 3) of triangles in space (m, 3, 3), as long as twice their areas."""
    (ax, ay, az), (bx, by, bz) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


def areas_of(corners: np.ndarray) -> np.ndarray:
    """Areas (m,) of triangles in space (m, 3, 3)."""
    return 0.5 * np.linalg.norm(normals(corners), axis=1)


def areas_in_space(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Areas (m,) of triangles (m, 3) with points (n, 3)."""
    points = np.asfortranarray(points)
    return by_parts(lambda part: areas_of(corners_of(points, part.T)), triangles.T)


def laid_flat(points: np.ndarray, triangles: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """The triangles (m, 3) of points (n, 3) laid into the plane in their true shape, counter-clockwise, (m, 3, 2).

    Also returns which of them are too flat, (m,) bool: these get a height.  `size` is the length of an edge, by and
    large; no longest edge counts as shorter than a small part of it.
    """
    points, shortest = np.asfortranarray(points), _FLATTEST * size

    def laid(corner_vertex):
        corners = corners_of(points, corner_vertex.T)
        sides = np.roll(corners, -1, axis=1) - corners
        squares = (sides * sides).sum(axis=2).T
        base = np.argmax(squares, axis=0)
        longest = np.sqrt(squares.max(axis=0))
        longest = np.where(longest < shortest, _COLLAPSED * size, longest)
        # How far along its longest edge, the base, the third corner lies, and how high above it
        products = -(sides * np.roll(sides, 1, axis=1)).sum(axis=2).T
        along = np.choose(base, products) / longest
        height = np.linalg.norm(normals(corners), axis=1) / longest
        degenerate = height < np.maximum(_FLATTEST * np.minimum(longest, _OUTSIZE * size), _LOWEST)
        height = np.where(degenerate, _THICKENED * longest, height)
        flat = np.zeros((2, *corner_vertex.shape))
        # The base begins at the origin, with that corner that has the number `base`.
        for c, (x, y) in enumerate(flat.swapaxes(0, 1)):
            second, third = base == (c + 2) % 3, base == (c + 1) % 3
            x[second], x[third], y[third] = longest[second], along[third], height[third]
        return flat, degenerate

    flat, degenerate = by_parts(laid, triangles.T)
    return flat.T, degenerate


def hat_gradients(corners: np.ndarray) -> np.ndarray:
    """Gradients of the hat functions of plane triangles' (m, 3, 2) second and third corners, (2, 2, m).

    The first axis is the corner, the second the coordinate, the last the triangle.  The first corner's gradient is
    missing, since all three sum to zero.
    """
    (a, c), (b, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    det = a * d - b * c
    return np.array([[d / det, -b / det], [-c / det, a / det]])


def corner_angles(corners: np.ndarray) -> np.ndarray:
    """Interior angles of plane triangles (m, 3, 2), at each corner (m, 3), in radians."""

    def angles(corners):  # (2, 3, m)
        ahead = np.roll(corners, -1, axis=1) - corners
        back = np.roll(corners, 1, axis=1) - corners
        cross = ahead[0] * back[1] - ahead[1] * back[0]
        return np.arctan2(np.abs(cross), (ahead * back).sum(axis=0))

    return by_parts(angles, corners.T).T
