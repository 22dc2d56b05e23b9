# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic on many triangles at once.

It is fastest where neighbours in memory are alike.  So corners, arrays (m, 3, d), are kept in memory coordinate by
coordinate, and fields, which have the triangles in the last axis, are worked on a part at a time.
"""

import numpy as np

_AT_ONCE = 8192  # triangles, or entries of a matrix: what is at work stays in the processor's cache
# A triangle lower than this part of its longest edge has no area, for all that single precision can tell.
_FLATTEST = 1e-6
# It is laid out with this part as its height: enough to stay valid in a map, too little to bend it.
_THICKENED = 1e-2


def parts(count):
    """Slices of so many triangles, one after the other."""
    return [slice(start, min(start + _AT_ONCE, count)) for start in range(0, count, _AT_ONCE)]


def by_parts(function, *fields):
    """`function(*fields)`, a field or a tuple of some, worked out for a part of the triangles after the other."""
    count = fields[0].shape[-1]
    if count <= _AT_ONCE:
        return function(*fields)
    results = None
    for part in parts(count):
        found = function(*(field[..., part] for field in fields))
        several = isinstance(found, tuple)
        if results is None:
            results = [np.empty((*each.shape[:-1], count), each.dtype) for each in (found if several else (found,))]
        for result, each in zip(results, found if several else (found,), strict=True):
            result[..., part] = each
    return tuple(results) if several else results[0]


def sums_by_parts(function, starts, *fields):
    """The sums (r, p) of the field `function(*fields)` (r, m) over the triangles from each of the `starts` (p,)."""
    sums = 0
    for part in parts(fields[0].shape[-1]):
        found = function(*(field[..., part] for field in fields))
        pieces = slice(np.searchsorted(starts, part.start, side="right") - 1, np.searchsorted(starts, part.stop))
        in_part = np.add.reduceat(found, np.maximum(starts[pieces] - part.start, 0), axis=1)
        sums = sums + np.pad(in_part, ((0, 0), (pieces.start, len(starts) - pieces.stop)))
    return sums


def corners_of(points, triangles):
    """The corners (m, 3, d) of `triangles` (m, 3) with these points (n, d).

    Points that are asked for a part at a time are best kept coordinate by coordinate as well.
    """
    corner = triangles.T
    corners = np.empty((points.shape[1], *corner.shape))
    for values, result in zip(points.T, corners, strict=True):
        np.take(values, corner, out=result, mode="clip")  # which needs no further copy
    return corners.T


def box(points):
    """The lower corner and the size, (d,) each, of the smallest box around points (n, d)."""
    low, high = (np.array([extreme(values) for values in points.T]) for extreme in (np.min, np.max))
    return low, high - low


def signed_areas(corners):
    """Signed areas of plane triangles (m, 3, 2), positive counter-clockwise."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return 0.5 * (ax * by - ay * bx)


def normals(corners):
    """Normals of triangles in space (m, 3, 3), twice as long as their areas, (m, 3)."""
    (ax, ay, az), (bx, by, bz) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


def areas_in_space(points, triangles):
    """Areas (m,) of triangles (m, 3) with points (n, 3)."""
    points = np.asfortranarray(points)
    return by_parts(lambda corner: 0.5 * np.linalg.norm(normals(corners_of(points, corner.T)), axis=1), triangles.T)


def laid_flat(points, triangles, size):
    """Triangles of points (n, 3) laid isometrically in the plane, counter-clockwise: their corners (m, 3, 2).

    Also which of them are too flat (m,), and were given a height.  `size` is an edge's length, by and large.
    """
    shortest = _FLATTEST * size

    def laid(corner):
        corners = corners_of(points, corner.T)
        sides = np.roll(corners, -1, axis=1) - corners
        squares = (sides * sides).sum(axis=2).T
        base = np.argmax(squares, axis=0)
        longest = np.maximum(np.sqrt(squares.max(axis=0)), shortest)
        # How far along the base the third corner lies, and how high above it
        products = -(sides * np.roll(sides, 1, axis=1)).sum(axis=2).T
        along = np.choose(base, products) / longest
        height = np.linalg.norm(normals(corners), axis=1) / longest
        degenerate = height < _FLATTEST * longest
        height = np.where(degenerate, _THICKENED * longest, height)
        flat = np.zeros((2, *corner.shape))
        for c, (x, y) in enumerate(flat.swapaxes(0, 1)):
            second, third = base == (c + 2) % 3, base == (c + 1) % 3
            x[second], x[third], y[third] = longest[second], along[third], height[third]
        return flat, degenerate

    flat, degenerate = by_parts(laid, triangles.T)
    return flat.T, degenerate


def hat_gradients(corners):
    """Gradients of the hat functions of the second and third corners of plane triangles (m, 3, 2), (2, 2, m)."""
    (a, c), (b, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    det = a * d - b * c
    return np.array([[d / det, -b / det], [-c / det, a / det]])


def corner_angles(corners):
    """Interior angles of plane triangles (m, 3, 2), at each corner (m, 3), in radians."""

    def angles(corners):
        ahead = np.roll(corners, -1, axis=1) - corners
        back = np.roll(corners, 1, axis=1) - corners
        cross = ahead[0] * back[1] - ahead[1] * back[0]
        return np.arctan2(np.abs(cross), (ahead * back).sum(axis=0))

    return by_parts(angles, corners.T).T
