# SPDX-License-Identifier: GPL-3.0-or-later
"""Putting unwrapped islands where they belong: back in place, upright, or each into the unit square."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .pieces import joined, numbers, starts_of
from .triangles import areas_in_space, box, corners_of, signed_areas

_STEEPEST_FLAT = 0.25  # an island that climbs less than this, by the way along it, has no upper end


def says_where(corners):
    """Whether these UVs, given as triangles (t, 3, 2), say where an island belongs.

    They do if they have some area and are no pile of faces, such as those of a new map, where each fills the square.
    """
    if not np.isfinite(corners).all():
        return False
    area = np.abs(signed_areas(corners)).sum()
    return 1e-12 < area <= 1.01 * np.prod(np.ptp(corners.reshape(-1, 2), axis=0))


def in_place(uv, triangles, old):
    """Move, turn and scale `uv` (n, 2) onto `old`, the triangles' old UVs (t, 3, 2).

    Keeps centre and area, and turns it as fits best in the sense of least squares.
    """
    new = uv[triangles]
    area, old_area = (np.abs(signed_areas(each)).sum() for each in (new, old))
    centre, old_centre = _centre(new), _centre(old)
    z, w = ((each.reshape(-1, 2) - middle) @ (1, 1j) for each, middle in ((new, centre), (old, old_centre)))
    turn = np.vdot(z, w)
    turn = turn / abs(turn) if abs(turn) > 1e-9 * np.linalg.norm(z) * np.linalg.norm(w) else 1.0
    moved = (uv - centre) @ (1, 1j) * turn * np.sqrt(old_area / area)
    return np.column_stack([moved.real, moved.imag]) + old_centre


def is_mirrored(corners):
    """Whether most of these UVs, given as triangles (t, 3, 2), are."""
    return signed_areas(corners).sum() < 0


def upright(islands):
    """Turn islands, each given as (uv, vertices, triangles, up), so that what is up in space is up; returns their UVs.

    Where one lies too flat for that, it is turned to its smallest box.
    """
    uvs = [uv for uv, _, _, _ in islands]
    heights = [vertices @ up for _, vertices, _, up in islands]
    points = [np.column_stack(each) for each in zip(uvs, heights, strict=True)]
    points, triangles, _, starts = joined(points, [its for _, _, its, _ in islands])
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
    turned = []
    for uv, steep, way in zip(uvs, steepness > _STEEPEST_FLAT, slope @ (1, 1j), strict=True):
        turned.append(_turned(uv, 1j * abs(way) / way) if steep else _on_smallest_box(uv))
    return turned


def _on_smallest_box(uv):
    """Turned so that its bounding box is the smallest, and lies rather than stands."""
    try:
        outline = uv[ConvexHull(uv).vertices]
    except QhullError:
        return uv
    side = (np.roll(outline, -1, axis=0) - outline) @ (1, 1j)
    turns = np.abs(side[side != 0]) / side[side != 0]
    turned = (outline @ (1, 1j))[:, None] * turns
    extents = np.column_stack([np.ptp(turned.real, axis=0), np.ptp(turned.imag, axis=0)])
    best = np.argmin(extents.prod(axis=1))
    width, height = extents[best]
    return _turned(uv, turns[best] * (1 if width >= height else -1j))


def _turned(uv, turn):
    z = uv @ (1, 1j) * turn
    return np.column_stack([z.real, z.imag])


def free_tile(rest):
    """The first tile to the right, 0 for the unit square itself, that has nothing of the UVs (k, 2) in or beside it."""
    least = 1e-6
    across = rest[(rest[:, 1] > least) & (rest[:, 1] < 1 - least), 0]
    if not len(across) or across.max() < least or across.min() > 1 - least:
        return 0
    return int(np.ceil(across.max() - least))


def in_unit_square(uv):
    """Scale `uv` (n, 2) until its longer side is 1, in the middle of the 0 to 1 square."""
    low, size = box(uv)
    scale = 1 / size.max() if size.max() > 0 else 1.0
    return (uv - low) * scale + (1 - size * scale) / 2


def areas(islands):
    """The areas in space, (k,), of islands given as (vertices, triangles)."""
    points, triangles, _, starts = joined(*zip(*islands, strict=True))
    return np.add.reduceat(areas_in_space(points, triangles), starts)


def areas_of_triangles(vertices, triangles):
    """The areas in space (t,) of triangles (t, 3) with vertices (n, 3)."""
    return areas_in_space(vertices, triangles)


def uv_areas(islands):
    """The areas in the layout, (k,), of islands given as (uv, triangles)."""
    uv, triangles, _, starts = joined(*zip(*islands, strict=True))
    return np.add.reduceat(np.abs(signed_areas(corners_of(uv, triangles))), starts)


def boxes(uvs):
    """Lower left and upper right corners, (k, 2) each, of the islands' UVs."""
    starts, uv = starts_of(uvs), np.concatenate(uvs)
    return np.minimum.reduceat(uv, starts), np.maximum.reduceat(uv, starts)


def _centre(corners):
    weight = np.abs(signed_areas(corners))
    return weight @ corners.mean(axis=1) / weight.sum()
