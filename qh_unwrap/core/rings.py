# SPDX-License-Identifier: GPL-3.0-or-later
"""A start for what is deep: tubes, horns, towers and trees, whose other maps shrink towards the tips.

Along a tube with one opening a harmonic map shrinks like exp(-length / radius), more than single precision can hold
beyond some forty radii.  Laid out in rings around the tip, each as far outside the one before as it lies along the
tube, the same tube shrinks only like radius / length.  With more conductivity along the tube than around it that
layout is itself harmonic; and with positive weights on a convex outline nothing flips (Tutte 1963), however the
surface branches.
"""

from __future__ import annotations

import numpy as np

from .distances import EdgeDistances
from .domain import Held
from .pieces import components
from .weights import cotangent, mean_value

_BAND = 2.5  # width of the bands that tell how wide the surface is, relative to the mean edge of the piece
_POSITIVE = 1e-3  # the least weight, relative to the mean value weight of the same edge
_DEEPEST = 1e4  # of a place, by its radius, that the layout still makes up for


def ring_map(domain: Held) -> np.ndarray:
    """The map (n, 2) of a domain whose outlines are held on convex polygons, in rings around its tips."""
    distances = EdgeDistances(domain.points, domain.triangles.edges)
    length, distance = distances.length, distances.to(np.concatenate(domain.island.outlines))
    depth = _depths(domain, length, distance)
    weights = []
    for chart in domain.charts:
        # A ring of radius r that goes on for the depth d is to lie d around its tip, d / r times as wide as it is.
        # Then what flows along the tube balances what flows around it, if the conductivity along is this:
        conductivity = 0.5 + 0.5 * np.maximum(depth[chart.triangles].mean(axis=1) + 0.5, 1) ** 2
        away = _gradients(chart, distance)
        x, y = away / np.maximum(np.linalg.norm(away, axis=0), np.finfo(float).tiny)
        more = conductivity - 1
        tensor = np.array([1 + more * x * x, 1 + more * y * y, more * x * y])
        weights.append(np.maximum(cotangent(chart, tensor), _POSITIVE * mean_value(chart)))
    return domain.constrained.solve(domain.triangles.joined(weights))


def _gradients(chart, values):
    """The gradients (2, m), in the triangles' shapes at rest, of values (n,) at vertices."""
    a, b, c = values[chart.triangles.T]
    (h1, h2), (k1, k2) = chart.hats
    return np.array([(b - a) * h1 + (c - a) * k1, (b - a) * h2 + (c - a) * k2])


def _depths(domain, length, distance):
    """How far it goes on from every vertex, away from the outline, relative to the radius of the surface there, (n,).

    The surface is cut into bands of equal distance from the outline, which fall into rings where it branches.  A ring's
    area by its width is its perimeter.
    """
    n, piece = len(distance), domain.vertex_piece
    edges = domain.triangles.edges
    i, j = edges.T
    pieces = domain.island.piece_count
    mean = np.bincount(piece[i], length, pieces) / np.bincount(piece[i], minlength=pieces)
    width = _BAND * mean[piece]
    band = np.floor(distance / width).astype(np.int64)
    same = band[i] == band[j]
    count, ring = components(n, i[same], j[same])
    area = np.zeros(n)
    for chart in domain.charts:
        if not chart.is_air:
            area += np.bincount(chart.triangles.ravel(), np.repeat(chart.area / 3, 3), n)
    ring_width = np.zeros(count)
    ring_width[ring] = width
    radius = np.bincount(ring, area, count) / (2 * np.pi * ring_width)
    ring_band = np.zeros(count, np.int64)
    ring_band[ring] = band

    # From the innermost rings outward: what lies beyond a ring is the deepest of what begins there.
    beyond = np.zeros(count)
    outer, inner = (np.where(band[i] < band[j], i, j), np.where(band[i] < band[j], j, i))
    outer, inner = ring[outer[~same]], ring[inner[~same]]
    order = np.argsort(-ring_band[inner], kind="stable")
    outer, inner = outer[order], inner[order]
    starts = np.flatnonzero(np.diff(ring_band[inner], prepend=-1))
    for part in np.split(np.arange(len(inner)), starts[1:]):
        np.maximum.at(beyond, outer[part], beyond[inner[part]] + ring_width[inner[part]])
    return np.minimum(beyond / np.maximum(radius, 1e-12), _DEEPEST)[ring]
