# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces made for the tests: each returns vertices (n, 3) and triangles (m, 3), counter-clockwise from above."""

import numpy as np
from scipy.spatial import Delaunay


def grid(columns=6, rows=5, width=1.0, height=1.0):
    """A flat rectangle of columns x rows quads, each split in two."""
    x, y = np.meshgrid(np.linspace(0, width, columns + 1), np.linspace(0, height, rows + 1))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = np.add.outer(np.arange(rows) * (columns + 1), np.arange(columns)).ravel()
    up = corner + columns + 1
    return vertices, np.vstack([np.column_stack([corner, corner + 1, up + 1]), np.column_stack([corner, up + 1, up])])


def random_disk(seed, inner=80, outer=24):
    """A flat round patch with irregular triangles."""
    rng = np.random.default_rng(seed)
    radius, angle = 0.93 * np.sqrt(rng.random(inner)), 2 * np.pi * rng.random(inner)
    rim = 2 * np.pi * (np.arange(outer) + 0.3 * rng.random(outer)) / outer
    plane = np.column_stack([np.r_[radius * np.cos(angle), np.cos(rim)], np.r_[radius * np.sin(angle), np.sin(rim)]])
    triangles = Delaunay(plane).simplices
    a, b, c = plane[triangles].transpose(1, 0, 2)
    clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return np.column_stack([plane, np.zeros(len(plane))]), triangles


def bump(seed, inner=80, outer=24, height=0.8):
    """A patch with a hill on it, a smooth disk that cannot be flattened without distortion."""
    vertices, triangles = random_disk(seed, inner, outer)
    x, y, _ = vertices.T
    vertices[:, 2] = height * np.exp(-3 * ((x - 0.2) ** 2 + y**2)) + 0.2 * x * y
    return vertices, triangles


def hemisphere(rings=8, flattening=1.0):
    """A half-sphere of nearly equilateral triangles: ring r has 6 r vertices."""
    vertices, triangles = [(0.0, 0.0, 1.0)], []
    start = [0]
    for ring in range(1, rings + 1):
        start.append(len(vertices))
        polar = np.pi / 2 * ring / rings
        for k in range(6 * ring):
            angle = 2 * np.pi * k / (6 * ring)
            vertices.append((np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), flattening * np.cos(polar)))
        inner, outer = max(6 * (ring - 1), 1), 6 * ring
        for sector in range(6):
            for k in range(ring):
                a = start[ring] + (sector * ring + k) % outer
                b = start[ring] + (sector * ring + k + 1) % outer
                c = start[ring - 1] + (sector * (ring - 1) + k) % inner
                triangles.append((a, b, c))
                if k < ring - 1:
                    triangles.append((b, start[ring - 1] + (sector * (ring - 1) + k + 1) % inner, c))
    return np.array(vertices), np.array(triangles)


def bulb(rings=8, opening=0.03, length=10.0):
    """An ellipsoid so many times as long as wide, open at one end by such a share of the way from end to end."""
    vertices, triangles = hemisphere(rings)
    x, y, z = vertices.T
    around, along = np.arctan2(y, x), 2 * (1 - opening) * np.arccos(z)
    x, y = np.sin(along) * np.cos(around), np.sin(along) * np.sin(around)
    return np.column_stack([x, y, length * np.cos(along)]), triangles


def ring(around=16, across=3):
    """A flat disk with a round hole."""
    radius, angle = np.meshgrid(np.linspace(0.4, 1, across + 1), 2 * np.pi * np.arange(around) / around)
    vertices = np.column_stack(
        [(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel(), np.zeros(radius.size)]
    )
    i, k = (index.ravel() for index in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    here, there = i * (across + 1) + k, (i + 1) % around * (across + 1) + k
    return vertices, np.vstack(
        [np.column_stack([here, here + 1, there + 1]), np.column_stack([here, there + 1, there])]
    )


def torus(around=9, across=7, open=False):
    """A torus, with one triangle missing if `open`."""
    u, v = np.meshgrid(2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(across) / across, indexing="ij")
    radius = 2 + np.cos(v)
    vertices = np.column_stack([(radius * np.cos(u)).ravel(), (radius * np.sin(u)).ravel(), np.sin(v).ravel()])
    i, k = (index.ravel() for index in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))

    def at(i, k):
        return i % around * across + k % across

    triangles = np.vstack(
        [
            np.column_stack([at(i, k), at(i + 1, k), at(i + 1, k + 1)]),
            np.column_stack([at(i, k), at(i + 1, k + 1), at(i, k + 1)]),
        ]
    )
    return vertices, triangles[1:] if open else triangles


def strip(length, segments, bend=0.0):
    """A developable ribbon of width 1, rolled by `bend` radians in all."""
    vertices, triangles = grid(segments, max(2, segments // int(length)), width=length)
    x, y, _ = vertices.T
    if bend:
        radius = length / bend
        vertices = np.column_stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)])
    return vertices, triangles


def stairs(count, across=1, rise=0.05, width=0.2):
    """A strip of so many quads that winds up a helix, `across` side by side, each cut in two and so wide."""
    step, side = np.meshgrid(np.arange(count + 1), np.arange(across + 1), indexing="ij")
    angle, radius = 0.2 * step, 1 + width * side
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), rise * angle], axis=-1).reshape(-1, 3)
    corner = ((across + 1) * step + side)[:-1, :-1].ravel()
    ahead = corner + across + 1
    return vertices, np.vstack(
        [np.column_stack([corner, ahead, ahead + 1]), np.column_stack([corner, ahead + 1, corner + 1])]
    )


def subdivided(vertices, triangles):
    """Every triangle cut in four at the middles of its edges, which are numbered after the vertices."""
    sides = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    a, b, c = triangles.T
    ab, bc, ca = len(vertices) + number.reshape(3, -1)
    parts = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return np.vstack([vertices, vertices[edges].mean(axis=1)]), np.vstack([np.column_stack(part) for part in parts])


def cut(vertices, triangles, keep):
    """The triangles whose centres `keep` accepts, and their vertices."""
    triangles = triangles[keep(*vertices[triangles].mean(axis=1).T)]
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], triangles.reshape(-1, 3)


DEVELOPABLE = ("strip 4:1", "strip 40:1", "L", "spiral", "cone", "cylinder")


def developable(name):
    """A surface that can be flattened without distortion: one of `DEVELOPABLE`."""
    if name == "strip 4:1":
        return strip(4, 32, bend=2)
    if name == "strip 40:1":
        return strip(40, 160, bend=5)
    if name == "L":
        vertices, triangles = cut(*grid(24, 24), lambda x, y, z: (x < 0.3) | (y < 0.3))
        x, y, _ = vertices.T
        return np.column_stack([np.sin(2 * x) / 2, y, np.cos(2 * x) / 2]), triangles
    if name == "spiral":
        angle, across = np.meshgrid(np.linspace(0, 5 * np.pi, 200), np.linspace(0, 1, 5))
        radius = 1 + 0.25 * angle / np.pi + 0.35 * across
        _, triangles = grid(199, 4)
        return np.column_stack(
            [(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel(), 0 * angle.ravel()]
        ), (triangles[:, ::-1])
    if name == "cone":
        vertices, triangles = cut(*grid(30, 10, width=1.8 * np.pi), lambda x, y, z: y > 0.1)
        x, y, _ = vertices.T
        return np.column_stack([y * np.cos(x), y * np.sin(x), y]), triangles[:, ::-1]
    vertices, triangles = grid(40, 8, width=2 * np.pi, height=2)  # a cylinder cut open
    x, y, _ = vertices.T
    return np.column_stack([np.sin(x), y, np.cos(x)]), triangles


def tetrahedron():
    """The smallest closed surface."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    return vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def rotation(seed):
    """A random rotation matrix (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def furthest_apart(one, other):
    """The largest distance of points (n, 2) that are moved, turned and scaled so that they lie as near as can be, by
    their extent."""
    a, b = (uv @ [1, 1j] - (uv @ [1, 1j]).mean() for uv in (one, other))
    return np.abs(a - np.vdot(b, a) / np.vdot(b, b) * b).max() / np.ptp(one, axis=0).max()
