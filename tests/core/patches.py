# SPDX-License-Identifier: GPL-3.0-or-later
"""Random disks of triangles: cut from larger surfaces, fans, strips one triangle wide, slivers.

`Patches(sources)` makes them: number `seed` is always the same.
"""

from collections import deque

import numpy as np

from . import shapes

LARGEST = 5000


class Patches:
    """Patches cut from `sources`, pairs of vertices (n, 3) and triangles (m, 3), and made from nothing."""

    def __init__(self, sources=()):
        generated = [Source(*mesh) for mesh in _surfaces()]
        self._sources = generated, [Source(*mesh) for mesh in sources] or generated

    def __call__(self, seed, largest=LARGEST):
        """The kind of patch number `seed`, its vertices and triangles: from 1 to `largest`, log-uniform."""
        random = np.random.default_rng(seed)
        count = round(np.exp(random.uniform(0, np.log(largest))))
        kind = random.choice(["cut", "strip", "fan", "sliver"], p=[0.65, 0.12, 0.08, 0.15])
        if kind == "strip":
            made = random_strip if random.random() < 0.5 else ribbon
            vertices, triangles = made(random, count)
        elif kind == "fan":
            vertices, triangles = fan(random, max(count, 2))
        else:
            sources = [source for source in self._sources[random.integers(2)] if len(source.triangles) > count]
            vertices, triangles = sources[random.integers(len(sources))].patch(random, count)
        if kind == "sliver":
            axes = shapes.rotation(random.integers(1 << 30))
            vertices = vertices @ (axes * 10 ** random.uniform([-2.5, -1, 0], [-1, 0, 0]))
        vertices = vertices @ shapes.rotation(random.integers(1 << 30)) * 10 ** random.uniform(-3, 3)
        return str(kind), vertices + random.normal(size=3), triangles


class Source:
    """A manifold surface to cut patches from."""

    def __init__(self, vertices, triangles):
        self.vertices, self.triangles = vertices, triangles
        start, end = triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
        n, m = len(vertices), len(triangles)
        key, twin = start * n + end, end * n + start
        order = np.argsort(key)
        place = np.minimum(np.searchsorted(key[order], twin), len(key) - 1)
        found = key[order][place] == twin
        # The neighbour across the side from corner c to c + 1, or -1
        self._neighbours = np.where(found, order[place] % m, -1).reshape(3, m).T.tolist()
        self._corners = triangles.tolist()

    def patch(self, random, count):
        """A disk of `count` triangles, or of fewer where it cannot grow: round, ragged or a snake."""
        manner = random.random(3)
        patch, used = set(), set()
        queue = deque([int(random.integers(len(self.triangles)))])
        pick = iter(random.random(40 * count + 40).tolist())
        while queue and len(patch) < count:
            oldest, whatever, _ = manner > next(pick, 1.0)
            if whatever:  # any of them: swap it to the end
                at = int(next(pick, 0.0) * len(queue))
                queue[at], queue[-1] = queue[-1], queue[at]
            triangle = queue.popleft() if oldest and not whatever else queue.pop()
            if triangle in patch or not self._keeps_a_disk(triangle, patch, used):
                continue
            patch.add(triangle)
            used.update(self._corners[triangle])
            queue.extend(other for other in self._neighbours[triangle] if other >= 0 and other not in patch)
        chosen = self.triangles[sorted(patch)]
        kept, chosen = np.unique(chosen, return_inverse=True)
        return self.vertices[kept], chosen.reshape(-1, 3)

    def _keeps_a_disk(self, triangle, patch, used):
        shared = [other in patch for other in self._neighbours[triangle]]
        if sum(shared) == 1:
            return self._corners[triangle][shared.index(True) - 1] not in used
        return sum(shared) == 2 or not patch


def random_strip(random, count):
    """Each triangle on one of the two free sides of the one before, folded at random: flat, if one lets it overlap."""
    points = [np.array([0.0, 0, 0]), np.array([1.0, 0, 0]), np.array([0.4, 0.9, 0])]
    triangles = [(0, 1, 2)]
    straight, bend = random.uniform(0.2, 1), random.uniform(0, 0.5)
    length, left = 10 ** random.uniform(-0.2, 0.2, count), random.random(count) < 0.5
    for k in range(1, count):
        a, b, c = triangles[-1]
        if k > 1 and random.random() < straight:
            left[k] = not left[k - 1]
        start, end, behind = (a, c, b) if left[k] else (c, b, a)
        along = points[end] - points[start]
        along /= np.linalg.norm(along)
        middle = (points[start] + points[end]) / 2
        away = middle - points[behind]
        away -= (away @ along) * along
        away /= np.linalg.norm(away)
        angle = bend * random.normal()
        away = np.cos(angle) * away + np.sin(angle) * np.cross(along, away)
        side = np.linalg.norm(points[end] - points[start])
        points.append(middle + 0.9 * length[k] * away + 0.2 * (side - 1) * along)
        # Keep the newest vertex in the middle place of a triangle wound like the others.
        triangles.append((start, end, len(points) - 1))
    return np.array(points), np.array(triangles)


def ribbon(random, count):
    """A zigzag ribbon along a straight line, a wave, a circle or a spiral stair."""
    k = np.arange(count + 2)
    width, turns = 10 ** random.uniform(-1.5, 0.5), random.uniform(0, 0.2)
    curve = random.integers(4)
    t = 0.5 * k
    centre = np.column_stack([t, 0 * t, 0 * t])
    across = np.tile([0.0, 1, 0], (len(k), 1))
    if curve == 1:
        centre[:, 2] = 3 * np.sin(turns * t)
    elif curve >= 2:
        radius = 1 / max(turns, 2 * np.pi / (t[-1] + 1)) if curve == 2 else 1 + 5 * random.random()
        angle = t / radius * (0.9 if curve == 2 else 1)
        across = np.column_stack([np.cos(angle), np.sin(angle), 0 * t])
        centre = radius * across + np.outer(0.3 * angle, [0, 0, 1])
        width = min(width, 0.8 * radius)
    points = centre + width * across * (k % 2)[:, None] * -1.0
    triangles = np.column_stack([k[:-2], k[1:-1], k[2:]])
    triangles[1::2] = triangles[1::2, ::-1]
    return points, triangles


def fan(random, count):
    """Triangles around one vertex, in the open or closed: flat, a cone, or wavy with more than a full turn."""
    closed = count > 2 and random.random() < 0.5
    ends = count if closed else count + 1
    total = 2 * np.pi * (1 if closed else random.uniform(0.05, 0.97))
    angle = total * np.sort(random.random(ends)) if random.random() < 0.5 else total * np.arange(ends) / count
    radius = 10 ** (random.uniform(0, 0.5) * random.normal(size=ends))
    height = random.uniform(-1, 1) + random.uniform(0, 1.5) * np.sin(random.integers(1, 6) * angle)
    rim = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle), height])
    k = 1 + np.arange(count)
    return np.vstack([np.zeros(3), rim]), np.column_stack([0 * k, k, k % ends + 1])


def _surfaces():
    """Surfaces of some ten thousand triangles: smooth, rough, with uneven and obtuse triangles."""
    yield shapes.hemisphere(42)
    yield shapes.torus(120, 44)
    vertices, triangles = shapes.grid(90, 70, width=1.3)
    x, y, _ = vertices.T
    for height in (0.05, 0.4):
        rough = height * np.random.default_rng(1).normal(size=len(x)) / 30
        yield np.column_stack([x, y, height * np.sin(9 * x) * np.cos(7 * y) + rough]), triangles
    for seed, stretch in ((1, 1), (2, 12)):
        vertices, triangles = shapes.random_disk(seed, inner=5000, outer=90)
        x, y, _ = vertices.T
        yield np.column_stack([x, y / stretch, np.exp(-3 * ((x - 0.2) ** 2 + y**2)) + 0.2 * x * y]), triangles
