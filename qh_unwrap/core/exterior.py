# SPDX-License-Identifier: GPL-3.0-or-later
"""The plane around an island, as triangles: with it the outline is an inner line and finds its own shape.

The paper's map takes the plane to itself.  So the island's triangles carry their tensors, and those of the air around
it, as far as a fixed circle, the identity.  Where all are positive, the whole plane is mapped one to one.
"""

import numpy as np
from scipy.spatial import cKDTree

from .pieces import components
from .solver import Dirichlet
from .triangles import corners_of, signed_areas
from .validity import orientation
from .weights import cotangent

_RADIUS = 2.5  # of the fixed circle, by the island's
_CIRCLE = 48  # vertices on it
_COARSEST = 4  # steps of the coarsest air to the circle's radius
_FINEST = 64  # the same for the island's radius: air need not be finer
_WORN = 0.3  # air is renewed when a triangle keeps less than this of its quality


class Exterior:
    """An island whose outline is free.

    Parameters
    ----------
    surface : Surface
    triangulate : function of points (p, 2) and sides (s, 2) that returns the triangles (t, 3), all wound the same way,
        of a constrained Delaunay triangulation of exactly these points, or None where that cannot be
    pinned : (n,) bool, vertices that stay where they are, or None

    After `renewed`, `surface` is the island with its air, whose vertices follow the island's, and `dirichlet` solves
    on it, with the circle and the pins held.
    """

    def __init__(self, surface, triangulate, pinned=None):
        self._island = surface
        self._triangulate = triangulate
        self._pinned = np.zeros(len(surface.vertices), bool) if pinned is None else pinned
        self._quality = None
        self.surface = surface
        self.dirichlet = None

    def renewed(self, uv):
        """The map with good air: `uv` itself, or its first n rows with other vertices of air.

        Returns None if there is no air yet and none can be made, since the outline crosses itself.
        """
        if self.dirichlet is not None:
            now = _quality(corners_of(uv, self.surface.triangles[self.surface.air]))
            if (now > _WORN * self._quality).all():
                return uv
        n = len(self._island.vertices)
        air = make_air(uv[:n], self._island.loops, self._triangulate)
        if air is None:  # the old air still serves
            return None if self.dirichlet is None else uv
        points, on_circle, triangles = air
        uv = np.vstack([uv[:n], points])
        self.surface = self._island.with_air(triangles, uv)
        # Where the outline is all but straight, triangles may be inside out by rounding: they decide nothing.
        self.surface.degenerate |= self.surface.air & (orientation(uv, self.surface.triangles) <= 0)
        self.dirichlet = Dirichlet(
            self.surface.order, self.surface.edges, np.concatenate([self._pinned, on_circle]), uv
        )
        self._quality = _quality(corners_of(uv, triangles))
        return uv

    def recalled(self, uv, n):
        """An earlier map with new air around its first n vertices, or None where none can be made."""
        self.dirichlet = None
        return self.renewed(uv[:n])

    def balanced(self, uv, tensor):
        """The `tensor` (3, m), on the island times the factor that lets it press on the air as the air presses on it.

        Without it the island would grow or shrink for ever; where the map is an isometry it is 1.
        """
        island = self._island
        i, j = island.edges.T
        weights = cotangent(island, tensor[:, : len(island.triangles)])[0]
        energy = sum(weights @ (x[i] - x[j]) ** 2 for x in uv.T)
        area = signed_areas(corners_of(uv, island.triangles)).sum()
        return tensor * np.where(self.surface.air, 1.0, 2 * area / energy) if area > 0 else tensor


def make_air(uv, loops, triangulate):
    """Triangulate the plane outside the island's boundary `loops`, and within its holes, as far as a circle.

    Returns the points that follow the n vertices `uv` (n, 2), which of them lie on the circle, and triangles (t, 3) of
    all; None where the loops cross or are inside out, or `triangulate` fails.
    """
    outline = np.concatenate(loops)
    start = uv[outline]
    following = np.concatenate([np.roll(loop, -1) for loop in loops])
    end = uv[following]
    centre = (start.min(axis=0) + start.max(axis=0)) / 2
    radius = np.linalg.norm(start - centre, axis=1).max()
    if not radius > 0:
        return None
    angle = 2 * np.pi * np.arange(_CIRCLE) / _CIRCLE
    circle = centre + _RADIUS * radius * np.column_stack([np.cos(angle), np.sin(angle)])
    between = _graded_points(start, end, centre, radius)

    place = np.empty(len(uv), dtype=np.int64)
    place[outline] = np.arange(len(outline))
    sides = np.column_stack([place[outline], place[following]])
    points = np.vstack([start, between, circle])
    triangles = triangulate(points, sides)
    if triangles is None:
        return None
    if signed_areas(corners_of(points, triangles)).sum() < 0:
        triangles = triangles[:, ::-1]
    triangles = _outside(triangles, sides, len(points))
    if triangles is None or len(np.unique(triangles)) < len(points):
        return None
    added = len(between) + _CIRCLE
    number = np.concatenate([outline, len(uv) + np.arange(added)])
    return points[len(outline) :], np.arange(added) >= len(between), number[triangles]


def _graded_points(start, end, centre, radius):
    """Points on ever coarser triangular grids, each about as far from its neighbours as from the outline."""
    length = np.linalg.norm(end - start, axis=1)
    reach = _RADIUS * radius
    coarsest = step = reach / _COARSEST
    finest = np.clip(length.mean(), radius / _FINEST, coarsest)
    count = np.maximum(1, np.ceil(length / finest)).astype(int)
    side = np.repeat(np.arange(len(start)), count)
    part = (np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count)) / count[side]
    samples = start[side] + part[:, None] * (end - start)[side]
    tree = cKDTree(samples)

    grids = []
    while step >= finest:
        if step == coarsest:
            cells, around, farthest = np.zeros((1, 2), np.int64), int(np.ceil(reach / step)), np.inf
        else:  # only near the outline
            cells, around, farthest = np.floor((samples - centre) / step).astype(np.int64), 3, 2 * step
        column, row = _cells_around(cells, around).T
        grid = centre + step * np.column_stack([column + row % 2 / 2 + 0.25, row + 0.25])
        distance = tree.query(grid, distance_upper_bound=farthest)[0]
        inside = np.linalg.norm(grid - centre, axis=1) < reach - step / 2
        grids.append(grid[(distance >= step) & (distance < farthest) & inside])
        step /= 2
    grid = np.vstack(grids)
    return grid[~_within(grid, start, end)]


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


def _outside(triangles, sides, n):
    """The triangles that lie on the right of the `sides` (s, 2); None if these do not separate them from the others."""
    m = len(triangles)
    start, end = triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    owner = np.tile(np.arange(m), 3)
    forward, backward = sides @ [n, 1], sides @ [1, n]
    key = start * n + end
    with_side, against_side = np.isin(key, forward), np.isin(key, backward)
    edge = np.minimum(start, end) * n + np.maximum(start, end)
    inner = np.flatnonzero(~with_side & ~against_side)
    inner = inner[np.argsort(edge[inner], kind="stable")]
    twins = edge[inner[1:]] == edge[inner[:-1]]
    one, other = owner[inner[:-1][twins]], owner[inner[1:][twins]]
    part = components(m, one, other)[1]
    outside = np.isin(part, part[owner[against_side]])
    if against_side.sum() != len(sides) or outside[owner[with_side]].any():
        return None
    return triangles[outside]


def _quality(corners):
    """1 for equilateral triangles (t, 3, 2), 0 for flat, negative for flipped ones."""
    sides = np.roll(corners, -1, axis=1) - corners
    return 4 * np.sqrt(3) * signed_areas(corners) / (sides**2).sum(axis=(1, 2))
