# SPDX-License-Identifier: GPL-3.0-or-later
"""Tangled maps within borders of any shape, made for the tests."""

import numpy as np
from scipy.spatial import Delaunay

KINDS = ("convex", "star", "general")


def tangled(kind, seed):
    """Vertices (n, 3), triangles (m, 3), a map (n, 2) whose inner vertices lie anywhere in a simple border of this
    kind, and how many vertices lie on the border: the first ones."""
    rng = np.random.default_rng(seed)
    if kind == "general":
        corners = int(rng.integers(5, 20))
        border = _subdivided(_simple_polygon(rng, corners), int(rng.integers(2 * corners, 4 * corners)))
        inner = int(rng.integers(4 * len(border), 600))
    else:
        count, inner = int(rng.integers(16, 50)), int(rng.integers(20, 400))
        border = _convex(rng, count) if kind == "convex" else _star(rng, count)
    vertices, triangles = _disk(rng, len(border), inner)
    low, size = border.min(axis=0), np.ptp(border, axis=0)
    return vertices, triangles, np.vstack([border, low + size * rng.random((inner, 2))]), len(border)


def _disk(rng, outer, inner):
    """A wavy disk with these numbers of vertices."""
    angle = 2 * np.pi * np.arange(outer) / outer
    radius, turn = 0.93 * np.cos(np.pi / outer) * np.sqrt(rng.random(inner)), 2 * np.pi * rng.random(inner)
    x = np.concatenate([np.cos(angle), radius * np.cos(turn)])
    y = np.concatenate([np.sin(angle), radius * np.sin(turn)])
    triangles = Delaunay(np.column_stack([x, y])).simplices
    a, b, c = np.column_stack([x, y])[triangles].transpose(1, 0, 2)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return np.column_stack([x, y, 0.3 * np.sin(3 * x) * np.cos(2 * y)]), triangles


def _convex(rng, count):
    angle = np.sort(rng.random(count)) * 2 * np.pi
    return np.column_stack([np.cos(angle) * (1 + rng.random()), np.sin(angle)])


def _star(rng, count):
    angle = 2 * np.pi * (np.arange(count) + 0.5 * rng.random(count)) / count
    return (0.3 + rng.random(count))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _simple_polygon(rng, count):
    """Random points in an order in which no two sides cross: of crossing ones, what lies between is turned round."""
    points, order = rng.random((count, 2)), list(range(count))
    crossing = True
    while crossing:
        crossing = False
        for i in range(count - 1):
            for j in range(i + 2, count - (i == 0)):
                ends = order[i], order[i + 1], order[j], order[(j + 1) % count]
                if _cross(*points[list(ends)]):
                    order[i + 1 : j + 1] = order[i + 1 : j + 1][::-1]
                    crossing = True
    polygon = points[order]
    x, y = polygon.T
    return polygon if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0 else polygon[::-1]


def _cross(a, b, c, d):
    def side(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def _subdivided(polygon, count):
    """The polygon with `count` vertices, evenly along its sides."""
    following = np.roll(polygon, -1, axis=0)
    length, pieces = np.linalg.norm(following - polygon, axis=1), np.ones(len(polygon), int)
    while pieces.sum() < count:
        pieces[np.argmax(length / pieces)] += 1
    return np.concatenate(
        [
            start + np.arange(k)[:, None] / k * (end - start)
            for start, end, k in zip(polygon, following, pieces, strict=True)
        ]
    )
