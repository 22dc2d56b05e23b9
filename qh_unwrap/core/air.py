# SPDX-License-Identifier: GPL-3.0-or-later
"""Air: the triangulated plane around an island, as far as a circle, and within its holes."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from .certificate import orientation, turn
from .errors import BoundaryError
from .loops import followers
from .triangles import corners_of, signed_areas

Triangulator = Callable[[np.ndarray, np.ndarray], np.ndarray | None]
"""A function of points (p, 2) and sides (s, 2), pairs of points, that returns the triangles (t, 3), all wound the same
way, of a constrained Delaunay triangulation of exactly these points, or None where that cannot be."""

_RADIUS = 2.5  # of the circle that ends the air, relative to that of the island
_CIRCLE = 48  # vertices on the circle
_WALLED = 0.95  # of the circle's radius, within which walls are kept out of
_PIECES = 8  # pieces of the circle's radius, of which none of a wall is longer
_SAMPLES = 5  # points of a wall that the air around keeps its distance from
_COARSEST = 4  # edges of the coarsest air that reach from the middle to the circle
_FINEST = 64  # edges of the finest air that reach across the island's radius, at most,
_COARSER = 2, 4  # times as long as those of the outline, at least and at most:
_SIDES = 150  # once for so many sides of it
_UNEVEN = 1e-3  # of a grid's step
_EVEN = 1e-6  # by the cube of the outline: how little longer sides may lie to one side for no axis to be told by them


class Air(NamedTuple):
    """Air around one island of n vertices."""

    points: np.ndarray  # (a, 2), its own vertices, numbered after the island's
    on_circle: np.ndarray  # (a,) bool, those on the circle that ends it, and on walls: they stay
    triangles: np.ndarray  # (t, 3), all positive
    left_out: np.ndarray  # (u, 3), those beside them that are too flat or too small for that


def make_air(
    uv: np.ndarray, loops: Sequence[np.ndarray], triangulate: Triangulator, walls: np.ndarray | None = None
) -> Air | None:
    """Triangulate the plane outside the island's boundary `loops`, and within its holes, as far as a circle.

    `uv` (n, 2) is the island's map.  `walls` (w, 2, 2) are segments that the island shall not cross, as `clear_walls`
    returns them.  Returns None where the loops cross or are inside out, or `triangulate` fails.
    """
    outline = np.concatenate(loops)
    start = uv[outline]
    following = followers(loops)
    end = uv[following]
    centre, axes = _frame(start, end)
    radius = np.linalg.norm(start - centre, axis=1).max()
    if not radius > 0:
        return None
    angle = 2 * np.pi * np.arange(_CIRCLE) / _CIRCLE
    circle = centre + _RADIUS * radius * np.column_stack([np.cos(angle), np.sin(angle)]) @ axes
    built, wall_sides = _walls(start, walls, centre, radius)
    from_start, to_end, within = (
        (each - centre) @ axes.T for each in (start, end, np.vstack([start, built])[wall_sides])
    )
    between = centre + _graded_points(from_start, to_end, within, radius) @ axes

    place = np.empty(len(uv), dtype=np.int64)
    place[outline] = np.arange(len(outline))
    sides = np.column_stack([place[outline], place[following]])
    points = np.vstack([start, built, between, circle])
    triangles = triangulate(points, np.vstack([sides, wall_sides]))
    if triangles is None:
        return None
    triangles = np.asarray(triangles)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise BoundaryError("the triangulator must return triangles, whole numbers in the shape (t, 3), or None")
    if not len(triangles) or triangles.min() < 0 or triangles.max() >= len(points):
        raise BoundaryError(f"the triangulator returned numbers of points outside 0 to {len(points) - 1}")
    if signed_areas(corners_of(points, triangles)).sum() < 0:
        triangles = triangles[:, ::-1]
    triangles = _outside(points, triangles, sides)
    if triangles is None or len(np.unique(triangles)) < len(points):
        return None
    added = len(built) + len(between) + _CIRCLE
    number = np.concatenate([outline, len(uv) + np.arange(added)])
    points, triangles = points[len(outline) :], number[triangles]
    # Where the outline is all but straight, or a hole too small for single precision, triangles may be inside out by
    # rounding: they decide nothing as long as that is so.
    solid = orientation(np.vstack([uv, points]), triangles) > 0
    number = np.arange(added)
    return Air(points, (number < len(built)) | (number >= added - _CIRCLE), triangles[solid], triangles[~solid])


def _frame(start, end):
    """The middle of closed polygons with sides from `start` to `end` (s, 2), and two axes (2, 2), its rows, that turn
    with the polygons and are mirrored with them: so the air around them does, too."""
    middle, length = (start + end) / 2, np.linalg.norm(end - start, axis=1)
    centre = length @ middle / length.sum() if length.any() else start[0]
    # Longer sides lie rather on one side of the middle, and if they do not, any axis is as good.
    x, y = length**2 @ (middle - centre)
    size = np.hypot(x, y)
    if not size > _EVEN * length.sum() ** 3:
        return centre, np.eye(2)
    return centre, np.array([[x, y], [-y, x]]) / size


def _walls(start, walls, centre, radius):
    """The ends of the walls within the circle that are no points of the outline (k, 2), each once, and the walls (w, 2)
    as numbers of the outline's points `start` and, after them, of these."""
    if walls is None or not len(walls):
        return np.empty((0, 2)), np.empty((0, 2), np.int64)
    walls = _within_circle(walls, centre, _WALLED * _RADIUS * radius)
    points, number = np.unique(np.vstack([start, walls.reshape(-1, 2)]), axis=0, return_inverse=True)
    number = number.ravel()
    known = np.full(len(points), -1)
    known[number[: len(start)]] = np.arange(len(start))
    new = known < 0
    known[new] = len(start) + np.arange(new.sum())
    return points[new], known[number[len(start) :]].reshape(-1, 2)


def _within_circle(walls, centre, radius):
    """The parts of segments (w, 2, 2) within a circle, in pieces that are short beside it."""
    start, along = walls[:, 0], walls[:, 1] - walls[:, 0]
    # Where a segment meets the circle: |start + t along - centre| = radius
    a = (along**2).sum(axis=1)
    b, c = ((start - centre) * along).sum(axis=1), ((start - centre) ** 2).sum(axis=1) - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    first, last = np.maximum((-b - root) / a, 0), np.minimum((-b + root) / a, 1)
    inside = (b * b > a * c) & (first < last)
    start, along, first, last = (each[inside] for each in (start, along, first, last))
    count = np.maximum(np.ceil((last - first) * np.sqrt(a[inside]) * _PIECES / radius), 1).astype(int)
    wall = np.repeat(np.arange(len(count)), count)
    k = np.arange(len(wall)) - np.repeat(np.cumsum(count) - count, count)
    ends = []
    for step in (k, k + 1):
        part = first[wall] + (last - first)[wall] * (step / count[wall])
        end = start[wall] + part[:, None] * along[wall]
        ends.append(np.where((part == 1)[:, None], walls[inside, 1][wall], end))  # to the last bit
    return np.stack(ends, axis=1)


def _graded_points(start, end, walls, radius):
    """Points on ever coarser triangular grids around the origin, which are alike above and below the first axis, each
    about as far from its neighbours as from the outline and from walls (w, 2, 2)."""
    length = np.linalg.norm(end - start, axis=1)
    reach = _RADIUS * radius
    coarsest = step = reach / _COARSEST
    finest = np.clip(np.clip(len(start) / _SIDES, *_COARSER) * length.mean(), radius / _FINEST, coarsest)
    count = np.maximum(1, np.ceil(length / finest)).astype(int)
    side = np.repeat(np.arange(len(start)), count)
    part = (np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count)) / count[side]
    samples = start[side] + part[:, None] * (end - start)[side]
    if len(walls):
        part = np.linspace(0, 1, _SAMPLES)[:, None, None]
        samples = np.vstack([samples, (walls[:, 0] + part * (walls[:, 1] - walls[:, 0])).reshape(-1, 2)])
    tree = cKDTree(samples)

    grids = []
    while step >= finest:
        if step == coarsest:
            cells, around, farthest = np.zeros((1, 2), np.int64), int(np.ceil(reach / step)), np.inf
        else:  # only near the outline
            cells, around, farthest = np.floor(samples / step).astype(np.int64), 3, 2 * step
        column, row = _cells_around(cells, around).T
        # Half a step aside, so that no grid has its points next to those of a coarser one
        grid = step * np.column_stack([column + row % 2 / 2 + 0.5, row]) + _UNEVEN * step * _noise(column, row)
        distance = tree.query(grid, distance_upper_bound=farthest)[0]
        inside = np.linalg.norm(grid, axis=1) < reach - step / 2
        grids.append(grid[(distance >= step) & (distance < farthest) & inside])
        step /= 2
    grid = np.vstack(grids)
    return grid[~_within(grid, start, end)]


def _noise(column, row):
    """Numbers from -1 to 1 by which grid points are moved (k, 2): else four often lie on a circle, and rounding would
    decide which triangles they make."""
    phase = 12.9898 * column + 78.233 * np.abs(row)
    return np.column_stack([np.sin(phase * phase), np.sign(row) * np.sin(phase * phase + 1)])


def _cells_around(cells, width):
    """The integer points (k, 2) that are at most `width` away from one of the `cells` (c, 2), each once."""
    low = cells.min(axis=0) - width
    columns = cells[:, 0].max() + width + 1 - low[0]
    offset = np.arange(-width, width + 1)
    number = np.unique((cells - low) @ [1, columns])
    number = np.unique(number[:, None, None] + offset[:, None] * columns + offset)
    return np.column_stack([number % columns, number // columns]) + low


def _within(points, start, end):
    """Which points (p, 2) lie within the closed polygons with the sides from `start` to `end`."""
    height, row = np.unique(points[:, 1], return_inverse=True)
    at, side = np.nonzero((start[:, 1] > height[:, None]) != (end[:, 1] > height[:, None]))
    (x, y), (run, rise) = start[side].T, (end - start)[side].T
    crossing = x + run / rise * (height[at] - y)
    # From left to right and row by row, every side crossed leads in or out; each row ends outside.
    order = np.lexsort((np.append(crossing, points[:, 0]), np.append(at, row)))
    crossed = order < len(at)
    inside = np.cumsum(crossed) % 2 == 1
    result = np.empty(len(points), bool)
    result[order[~crossed] - len(at)] = inside[~crossed]
    return result


def _outside(points, triangles, sides):
    """The triangles of `points` (n, 2) that lie on the right of the `sides` (s, 2) of closed polygons; None if these
    are not all edges, or do not separate such triangles from the others."""
    following, before = np.full((2, len(points)), -1)
    following[sides[:, 0]], before[sides[:, 1]] = sides[:, 1], sides[:, 0]
    v, w = triangles.T, np.roll(triangles, -1, axis=1).T
    ahead, behind = following[v], before[v]
    if (ahead == w).sum() != len(sides) or (behind == w).sum() != len(sides):
        return None
    # At a polygon's vertex v, those lie on the left whose first side, from v to w, is the way ahead, or lies between
    # that and the way back.
    at = np.flatnonzero((ahead >= 0).ravel())
    v, w, ahead, behind = (each.ravel()[at] for each in (v, w, ahead, behind))
    here, beside, next_one, last_one = points[v], points[w], points[ahead], points[behind]
    after = (w == ahead) | (turn(here, next_one, beside) > 0)
    ends = (w != behind) & (turn(here, beside, last_one) > 0)
    left = np.where(turn(last_one, here, next_one) > 0, after & ends, after | ends)
    count = np.bincount(at[left] % len(triangles), minlength=len(triangles))
    return triangles[count == 0] if np.isin(count, (0, 3)).all() else None


def quality(corners: np.ndarray) -> np.ndarray:
    """1 for equilateral triangles (t, 3, 2), 0 for flat, negative for flipped ones."""
    x, y = corners.T
    sides = ((x[[1, 2, 0]] - x) ** 2 + (y[[1, 2, 0]] - y) ** 2).sum(axis=0)
    return 4 * np.sqrt(3) * signed_areas(corners) / sides
