# SPDX-License-Identifier: GPL-3.0-or-later
"""Putting unwrapped islands where they belong: back in place, upright, or each into the unit square."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .pieces import joined, numbers, starts_of
from .triangles import areas_in_space, corners_of, signed_areas

_FINEST = 1e-5  # side of a square with a triangle's area, by the layout's size, that can still be packed
_STEEPEST_FLAT = 0.25  # slope, height by way along the island, up to which it lies flat and has no upper end
_THROWN = 16  # times the median growth of triangles, from which on one has a vertex that was thrown elsewhere


def says_where(corners: np.ndarray) -> bool:
    """Whether these UVs, given as triangles (t, 3, 2), say where an island belongs.

    They do if they have some area and are no pile of faces, as in a new UV map, where each face fills the square.
    """
    if not len(corners) or not np.isfinite(corners).all():
        return False
    area = np.abs(signed_areas(corners)).sum()
    extent = np.prod(np.ptp(corners.reshape(-1, 2), axis=0))
    return bool(1e-6 * extent < area <= 1.01 * extent)


def in_place(uv: np.ndarray, triangles: np.ndarray, old: np.ndarray) -> np.ndarray:
    """The UVs (n, 2) of triangles (t, 3) moved, rotated and scaled onto `old`, the triangles' old UVs (t, 3, 2).

    They get the old centre and area, and the rotation that fits best in the sense of least squares.  Where the old map
    has flips, triangles that are far too large in it, as around a vertex thrown elsewhere, do not count.
    """
    new = uv[triangles]
    signed = signed_areas(old)
    if (signed * np.sign(signed.sum()) < 0).any():
        growth = np.abs(signed) / np.maximum(np.abs(signed_areas(new)), np.finfo(float).tiny)
        sound = growth <= _THROWN * np.median(growth[growth > 0])
        new, old = new[sound], old[sound]
    area, old_area = (float(np.abs(signed_areas(each)).sum()) for each in (new, old))
    middle, old_middle = centre(new), centre(old)
    z, w = ((each.reshape(-1, 2) - its) @ (1, 1j) for each, its in ((new, middle), (old, old_middle)))
    rotation = np.vdot(z, w)
    rotation = rotation / abs(rotation) if abs(rotation) > 1e-9 * np.linalg.norm(z) * np.linalg.norm(w) else 1.0
    size = np.sqrt(old_area / area) if area > 0 else 1.0
    moved = (uv - middle) @ (1, 1j) * rotation * size
    return np.column_stack([moved.real, moved.imag]) + old_middle


def is_mirrored(corners: np.ndarray) -> bool:
    """Whether most of the area of these UVs, given as triangles (t, 3, 2), is mirrored."""
    return bool(signed_areas(corners).sum() < 0)


def upright(islands: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """The UVs of islands, each given as (uv, vertices, triangles, up), rotated so that what is up in space is up.

    Where one lies too flat for that, it is rotated so that its bounding box is the smallest.
    """
    uvs = [uv for uv, _, _, _ in islands]
    heights = [vertices @ up for _, vertices, _, up in islands]
    lifted = [np.column_stack(each) for each in zip(uvs, heights, strict=True)]
    points, triangles, _, starts = joined(lifted, [its for _, _, its, _ in islands])
    x, y, height = corners_of(points, triangles).T
    piece = numbers(starts, len(triangles))
    weight = np.abs(signed_areas(corners_of(points[:, :2], triangles)))

    def sums(values):
        return np.add.reduceat(weight * values.sum(axis=0), starts)

    total = np.add.reduceat(weight, starts)
    size = np.sqrt(areas([(vertices, its) for _, vertices, its, _ in islands]) / total)
    x, y = ((along - (sums(along) / (3 * total))[piece]) * size[piece] for along in (x, y))
    # The slope of the height over the layout, by least squares.
    xx, xy, yy, xh, yh = (sums(one * other) for one, other in ((x, x), (x, y), (y, y), (x, height), (y, height)))
    spread = np.moveaxis(np.array([[xx, xy], [xy, yy]]), 2, 0)
    slope = (np.linalg.pinv(spread) @ np.column_stack([xh, yh])[:, :, None])[:, :, 0]
    steepness = np.linalg.norm(slope, axis=1)
    rotated = []
    for uv, steep, way in zip(uvs, steepness > _STEEPEST_FLAT, slope @ (1, 1j), strict=True):
        rotated.append(_rotated(uv, 1j * abs(way) / way) if steep else _in_smallest_box(uv))
    return rotated


def _in_smallest_box(uv):
    """UVs (n, 2) rotated so that their bounding box is the smallest, and lies rather than stands.

    One of its sides then lies along a side of the convex hull, so only these directions are tried.
    """
    try:
        outline = uv[ConvexHull(uv).vertices]
    except QhullError:
        return uv
    side = (np.roll(outline, -1, axis=0) - outline) @ (1, 1j)
    rotations = np.abs(side[side != 0]) / side[side != 0]
    rotated = (outline @ (1, 1j))[:, None] * rotations
    sizes = np.column_stack([np.ptp(rotated.real, axis=0), np.ptp(rotated.imag, axis=0)])
    best = np.argmin(sizes.prod(axis=1))
    width, height = sizes[best]
    return _rotated(uv, rotations[best] * (1 if width >= height else -1j))


def _rotated(uv, rotation):
    """UVs (n, 2) multiplied, as complex numbers, by one of length 1."""
    z = uv @ (1, 1j) * rotation
    return np.column_stack([z.real, z.imag])


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
    (low,), (high,) = boxes([uv])
    size = high - low
    scale = 1 / size.max() if size.max() > 0 else 1.0
    return (uv - low) * scale + (1 - size * scale) / 2


def to_scale(
    islands: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], importance: np.ndarray | None = None
) -> tuple[list[np.ndarray], np.ndarray]:
    """The UVs of islands, each given as (uv, vertices, triangles), scaled to the same texel density and about the area
    1 all together; and which, (k,) bool, are larger, since single precision could not tell their vertices apart.

    `importance` (k,) is what the islands' areas count times, by default 1.
    """
    uvs, vertices, triangles = (list(each) for each in zip(*islands, strict=True))
    in_space, in_layout = (
        areas(list(zip(vertices, triangles, strict=True))),
        uv_areas(list(zip(uvs, triangles, strict=True))),
    )
    if importance is not None:
        in_space = in_space * importance
    share = in_space / in_space.sum()
    least = _FINEST**2 * np.array([len(each) for each in triangles])
    scale = np.sqrt(np.maximum(share, least) / np.maximum(in_layout, 1e-300))
    return [uv * size for uv, size in zip(uvs, scale.tolist(), strict=True)], share < least


def areas(islands: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The areas in space, (k,), of islands given as (vertices, triangles)."""
    points, triangles, _, starts = joined(*zip(*islands, strict=True))
    return np.add.reduceat(areas_in_space(points, triangles), starts)


def uv_areas(islands: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The areas in the layout, (k,), of islands given as (uv, triangles)."""
    uv, triangles, _, starts = joined(*zip(*islands, strict=True))
    return np.add.reduceat(np.abs(signed_areas(corners_of(uv, triangles))), starts)


def boxes(uvs: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The lower left and the upper right corners, (k, 2) each, of the boxes around islands with these UVs, (n, 2)."""
    starts, uv = starts_of(uvs), np.concatenate(uvs)
    return np.minimum.reduceat(uv, starts), np.maximum.reduceat(uv, starts)


def centre(corners: np.ndarray) -> np.ndarray:
    """The centre of area, (2,), of triangles (t, 3, 2), all counted as positive."""
    weight = np.abs(signed_areas(corners))
    if not weight.any():
        weight = np.ones(len(corners))
    return weight @ corners.mean(axis=1) / weight.sum()
