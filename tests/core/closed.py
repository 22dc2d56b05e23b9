# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed meshes made for the tests, as `Polygons`."""

import numpy as np

from qh_unwrap.core.cuttable import Polygons

_SIDES = np.array(  # the corners of a unit cube's faces, wound counter-clockwise from outside, and what they face
    [
        [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
        [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
        [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    ]
)
_FACING = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])


def voxels(full):
    """The surface of the voxels that are `full` (a, b, c) bool, of quads."""
    full = np.pad(full, 1)
    quads = []
    for corners, facing in zip(_SIDES, _FACING, strict=True):
        cells = np.argwhere(full & ~np.roll(full, -facing, axis=(0, 1, 2)))
        quads.append(cells[:, None] + corners)
    points, quads = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    return Polygons.of_faces(points - 1.0, quads.ravel(), np.full(len(quads.ravel()) // 4, 4))


def box(columns=1, rows=1, layers=1):
    """A box of so many cubes."""
    return voxels(np.ones((columns, rows, layers), bool))


def plate(handles, width=1):
    """A plate with holes, each a handle of its surface."""
    full = np.ones((width + handles * 2 * width, 3 * width, width), bool)
    for k in range(handles):
        full[width + 2 * k * width : 2 * width + 2 * k * width, width : 2 * width] = False
    return voxels(full)


def cylinder(around=16, rows=1, height=2.0, capped=True):
    """A cylinder of radius 1, whose caps are faces with many corners."""
    angle = 2 * np.pi * np.arange(around) / around
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([np.column_stack([rim, np.full(around, height * k / rows)]) for k in range(rows + 1)])
    here = np.arange(around)
    after = np.roll(here, -1)
    corners = [np.column_stack([here, after, after + around, here + around]) + k * around for k in range(rows)]
    sizes = [4] * (around * rows)
    if capped:
        corners += [here[::-1], here + rows * around]
        sizes += [around, around]
    return Polygons.of_faces(points, np.concatenate([each.ravel() for each in corners]), sizes)


def triangulated(polygons):
    """The vertices (n, 3) and triangles (m, 3) of a mesh."""
    return polygons.vertices, polygons.corner_vertex[polygons.corner_triangles]


def random_closed(seed):
    """One to three closed pieces with up to five handles, smooth or rough, some with bad triangles."""
    random = np.random.default_rng(seed)
    vertices, triangles = [], []
    for _ in range(random.choice([1, 1, 2, 3])):
        points, its = triangulated(_random_piece(random))
        points = _relaxed(points, its, random.integers(0, 8))
        points *= np.exp(random.uniform(-1, 1, 3))
        if random.random() < 0.5:
            points += random.normal(scale=0.1 * random.random(), size=points.shape)
        if random.random() < 0.4:
            points = _with_bad_triangles(points, its, random)
        start = sum(len(each) for each in vertices)
        vertices.append(points * np.exp(random.uniform(-2, 2)))
        triangles.append(its + start)
    return Polygons.of_triangles(np.concatenate(vertices), np.concatenate(triangles))


def _random_piece(random):
    kind = random.integers(4)
    if kind == 0:
        return plate(int(random.integers(0, 6)), int(random.integers(1, 3)))
    if kind == 1:
        return box(*random.integers(1, 7, 3))
    if kind == 2:
        return cylinder(int(random.integers(3, 30)), int(random.integers(1, 12)), float(np.exp(random.uniform(-2, 3))))
    # A walk through a grid, which may close to rings.
    full = np.zeros((9, 9, 9), bool)
    place = np.array([4, 4, 4])
    for _ in range(random.integers(5, 60)):
        full[tuple(place)] = True
        place = np.clip(place + _FACING[random.integers(6)], 0, 8)
    return voxels(full)


def _relaxed(points, triangles, rounds):
    """The points nearer to the middle of their neighbours, again and again."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    number = np.maximum(np.bincount(start, minlength=len(points)), 1)[:, None]
    for _ in range(rounds):
        middle = np.array([np.bincount(start, values[end], len(points)) for values in points.T]).T / number
        points = (points + middle) / 2
    return points.copy()


def _with_bad_triangles(points, triangles, random):
    """Some vertices moved onto a neighbour, or nearly, or onto the line between two."""
    points = points.copy()
    for triangle in triangles[random.integers(len(triangles), size=random.integers(1, 5))]:
        a, b, c = random.permutation(triangle)
        points[a] = points[b] + random.choice([0, 1e-9, 1e-3]) * (points[c] - points[b])
        if random.random() < 0.5:
            points[a] = (points[b] + points[c]) / 2
    return points
