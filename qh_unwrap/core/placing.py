# SPDX-License-Identifier: GPL-3.0-or-later
"""Putting unwrapped islands where they belong: back in place, upright, or each into the unit square."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .pieces import Pieces
from .triangles import boxes_of, corners_of, signed_areas

_FINEST = 1e-5  # side of a square with a triangle's area, by the layout's size, that can still be packed
_STEEPEST_FLAT = 0.25  # slope, height by way along the island, up to which it lies flat and has no upper end
_FIRST = np.zeros(1, int)  # where the one begins
_THROWN = 16  # times the median growth of triangles, from which on one has a vertex that was thrown elsewhere


def say_where(corners: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Whether the UVs of islands say where these belong, (k,) bool: triangles (t, 3, 2), of which each island's begin
    at its place in `starts` (k,).

    They do if they have some area and are no pile of faces, as in a new UV map, where each face fills the square.
    """
    finite = np.isfinite(corners).all(axis=(1, 2))
    corners = np.where(finite[:, None, None], corners, 0)
    area = np.add.reduceat(np.abs(signed_areas(corners)), starts)
    low, high = boxes_of(corners)
    extent = np.prod(np.maximum.reduceat(high, starts) - np.minimum.reduceat(low, starts), axis=1)
    return np.logical_and.reduceat(finite, starts) & (1e-6 * extent < area) & (area <= 1.01 * extent)


def says_where(corners: np.ndarray) -> bool:
    """The same of one island, (t, 3, 2), maybe without any triangles."""
    return bool(len(corners) and say_where(corners, _FIRST)[0])


def are_mirrored(corners: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Whether most of the area of the UVs of islands, given as for `say_where`, is mirrored, (k,) bool."""
    return np.add.reduceat(signed_areas(corners), starts) < 0


def is_mirrored(corners: np.ndarray) -> bool:
    """The same of one island, (t, 3, 2)."""
    return bool(are_mirrored(corners, _FIRST)[0])


def in_place(islands: Pieces, uv: np.ndarray, old: np.ndarray) -> np.ndarray:
    """The UVs (n, 2) of islands moved, rotated and scaled onto `old`, their triangles' old UVs (t, 3, 2).

    They get the old centres and areas, and the rotations that fit best in the sense of least squares.  Where an old map
    has flips, triangles that are far too large in it, as around a vertex thrown elsewhere, do not count.
    """
    new, piece = corners_of(uv, islands.triangles), islands.triangle_piece
    size, old_size = np.abs(signed_areas(new)), signed_areas(old)
    flipped = old_size * np.sign(islands.sums(old_size))[piece] < 0
    old_size = np.abs(old_size)
    sound = np.ones(len(old), bool)
    for k in np.unique(piece[flipped]).tolist():
        its = islands.triangles_of(k)
        growth = old_size[its] / np.maximum(size[its], np.finfo(float).tiny)
        sound[its] = growth <= _THROWN * np.median(growth[growth > 0])
    size, old_size = np.where(sound, size, 0), np.where(sound, old_size, 0)
    middle, old_middle = _centres(islands, new, size), _centres(islands, old, old_size)
    z, w = (
        sound[:, None] * ((corners - its[piece, None]) @ (1, 1j)) for corners, its in ((new, middle), (old, old_middle))
    )
    turn = islands.sums((z.conj() * w).sum(axis=1))
    lengths = (np.sqrt(islands.sums((np.abs(each) ** 2).sum(axis=1))) for each in (z, w))
    clear = np.abs(turn) > 1e-9 * np.prod(list(lengths), axis=0)
    turn = np.where(clear, turn / np.where(clear, np.abs(turn), 1), 1)
    area, old_area = islands.sums(size), islands.sums(old_size)
    turn = turn * np.where(area > 0, np.sqrt(old_area / np.where(area > 0, area, 1)), 1)
    moved = (uv - middle[islands.piece]) @ (1, 1j) * turn[islands.piece]
    return np.column_stack([moved.real, moved.imag]) + old_middle[islands.piece]


def upright(islands: Pieces, uv: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The UVs (n, 2) of islands rotated so that what is up in space, for each of them a vector in `up` (k, 3), is up.

    Where one lies too flat for that, it is rotated so that its bounding box is the smallest.
    """
    heights = np.einsum("nc,nc->n", islands.points, up[islands.piece])
    x, y, height = corners_of(np.column_stack([uv, heights]), islands.triangles).T
    weight = np.abs(signed_areas(corners_of(uv, islands.triangles)))

    def sums(values):
        return islands.sums(weight * values.sum(axis=0))

    total, piece = islands.sums(weight), islands.triangle_piece
    size = np.sqrt(islands.areas / total)
    x, y = ((along - (sums(along) / (3 * total))[piece]) * size[piece] for along in (x, y))
    # The slope of the height over the layout, by least squares.
    xx, xy, yy, xh, yh = (sums(one * other) for one, other in ((x, x), (x, y), (y, y), (x, height), (y, height)))
    spread = np.moveaxis(np.array([[xx, xy], [xy, yy]]), 2, 0)
    slope = (np.linalg.pinv(spread) @ np.column_stack([xh, yh])[:, :, None])[:, :, 0] @ (1, 1j)
    steep = np.abs(slope) > _STEEPEST_FLAT
    rotation = np.where(steep, 1j, 1.0)
    rotation[steep] *= np.abs(slope[steep]) / slope[steep]
    if not steep.all():
        uvs = islands.of_each(uv)
        rotation[~steep] = [_into_smallest_box(uvs[k]) for k in np.flatnonzero(~steep)]
    rotated = uv @ (1, 1j) * rotation[islands.piece]
    return np.column_stack([rotated.real, rotated.imag])


def _into_smallest_box(uv):
    """By what to rotate UVs (n, 2), as a complex number of length 1, so that their bounding box is the smallest, and
    lies rather than stands.

    One of its sides then lies along a side of the convex hull, so only these directions are tried.
    """
    try:
        outline = uv[ConvexHull(uv).vertices]
    except QhullError:
        return 1.0
    side = (np.roll(outline, -1, axis=0) - outline) @ (1, 1j)
    rotations = np.abs(side[side != 0]) / side[side != 0]
    rotated = (outline @ (1, 1j))[:, None] * rotations
    sizes = np.column_stack([np.ptp(rotated.real, axis=0), np.ptp(rotated.imag, axis=0)])
    best = np.argmin(sizes.prod(axis=1))
    width, height = sizes[best]
    return rotations[best] * (1 if width >= height else -1j)


def free_tile(rest: np.ndarray) -> int:
    """The number of a free tile in the row of the unit square, which is number 0, beside other UVs (k, 2).

    The unit square is free if all UVs in its row lie on one side of it; else take the first tile to the right of all.
    """
    least = 1e-6
    across = rest[(rest[:, 1] > least) & (rest[:, 1] < 1 - least), 0]
    if not len(across) or across.max() < least or across.min() > 1 - least:
        return 0
    return int(np.ceil(across.max() - least))


def in_unit_square(uv: np.ndarray) -> np.ndarray:
    """The UVs (n, 2) scaled until the longer side of their box is 1, in the middle of the 0 to 1 square."""
    low, size = uv.min(axis=0), np.ptp(uv, axis=0)
    scale = 1 / size.max() if size.max() > 0 else 1.0
    return (uv - low) * scale + (1 - size * scale) / 2


def to_scale(islands: Pieces, uv: np.ndarray, importance: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The UVs (n, 2) of islands scaled to the same texel density and about the area 1 all together; and which, (k,)
    bool, are larger, since single precision could not tell their vertices apart.

    `importance` (k,) is what the islands' areas count times, by default 1.
    """
    in_space = islands.areas if importance is None else islands.areas * importance
    share = in_space / in_space.sum()
    least = _FINEST**2 * np.bincount(islands.triangle_piece)
    scale = np.sqrt(np.maximum(share, least) / np.maximum(islands.areas_in(uv), 1e-300))
    return uv * scale[islands.piece, None], share < least


def centres(islands: Pieces, uv: np.ndarray) -> np.ndarray:
    """The centres of area, (k, 2), of islands with the UVs (n, 2), all triangles counted as positive."""
    corners = corners_of(uv, islands.triangles)
    return _centres(islands, corners, np.abs(signed_areas(corners)))


def _centres(islands, corners, weight):
    """The mean places (k, 2) of islands' triangles (t, 3, 2), which count by their `weight` (t,); those of islands
    without any count alike."""
    weight = np.where((islands.sums(weight) > 0)[islands.triangle_piece], weight, 1)
    sums = [islands.sums(weight * along) for along in corners.mean(axis=1).T]
    return (sums / islands.sums(weight)).T
