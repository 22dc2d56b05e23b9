# SPDX-License-Identifier: GPL-3.0-or-later
"""Splitting of obtuse triangles at their longest edges, so that the cotangent weights are positive (section 6)."""

import numpy as np

from .chart import Surface
from .triangles import corner_angles
from .weights import cotangent

_NEGATIVE = -1e-9  # cotangent weight below which an edge counts as negative: what lies above may be rounding


def refine_obtuse(surface: Surface, limit: float = 16) -> tuple[Surface, np.ndarray]:
    """The surface, of one piece, with edges split until no inner edge has a negative cotangent weight.

    Also returns, for each of its triangles, the triangle that it was cut from, (m',).  The original vertices come
    first, so `uv[:n]` leads back.  It stops early when there are `limit` times as many triangles;
    `has_positive_weights` tells whether it had to.

    Rivara's bisection, which the paper names, halves longest edges.  Halves of an obtuse triangle contain triangles
    similar to it, so that a third of all triangles stays obtuse however long one goes on.  Here an edge with a negative
    weight is split where the heights of its two triangles meet it, which ends far more often; and each round splits
    edges that share no triangle, so that no other edges need to be split with them.
    """
    n = len(surface.triangles)
    parents = np.arange(n)
    while len(surface.triangles) <= limit * n:
        angle_sum, at = _opposite(surface)
        angle_sum[~negative_edges(surface)] = 0
        chosen = _worst_of_both_triangles(surface, angle_sum)
        if not chosen.any():
            break
        surface, origin = _split(surface, chosen, at)
        parents = parents[origin]
    return surface, parents


def has_positive_weights(surface: Surface) -> bool:
    """Whether no inner edge has a negative cotangent weight: then a harmonic map with a convex boundary has no flips.

    A quasi-harmonic map has none if, besides, its tensors are nearly multiples of the identity.
    """
    return not bool(negative_edges(surface).any())


def negative_edges(surface: Surface) -> np.ndarray:
    """The inner edges with a negative cotangent weight, (k,) bool; those of the boundary enter no equation."""
    negative = cotangent(surface)[0] < _NEGATIVE
    negative[surface.half_edge_edges[surface.on_boundary]] = False
    return negative


def _opposite(surface):
    """For every edge the sum of the angles opposite to it, in radians, and the place where the heights of its triangles
    meet it on average, from 0 at its start to 1 at its end, (k,) each."""
    edge = surface.half_edge_edges
    angle = np.roll(corner_angles(surface.rest), -2, axis=1).T.ravel()
    third = np.roll(surface.triangles.T, -2, axis=0).ravel()
    start, end = surface.vertices[surface.edges[edge]].transpose(1, 0, 2)
    along = end - start
    foot = np.einsum("ij,ij->i", surface.vertices[third] - start, along)
    foot /= np.maximum(np.einsum("ij,ij->i", along, along), np.finfo(float).tiny)
    total = np.bincount(edge, angle)
    return total, np.clip(np.bincount(edge, angle * foot) / total, 0.1, 0.9)


def _worst_of_both_triangles(surface, badness):
    """The edges with a positive `badness` (k,) that are the worst edge of each of their triangles, (k,) bool."""
    rank = np.empty(len(badness), dtype=np.int64)
    rank[np.argsort(badness, kind="stable")] = np.arange(len(badness))
    own = rank[surface.triangle_edges]
    wins = np.bincount(surface.triangle_edges.ravel(), (own == own.max(axis=1, keepdims=True)).ravel())
    return (badness > 0) & (wins == np.bincount(surface.triangle_edges.ravel()))


def _split(surface, chosen, at):
    """The surface with the `chosen` edges, (k,) bool, split at the places `at` (k,), and each triangle's origin, (m',).

    A triangle has at most one chosen edge.
    """
    start, end = surface.vertices[surface.edges[chosen]].transpose(1, 0, 2)
    new_vertex = np.full(len(chosen), -1)
    new_vertex[chosen] = len(surface.vertices) + np.arange(len(start))
    vertices = np.vstack([surface.vertices, start + at[chosen, None] * (end - start)])

    corner = np.argmax(chosen[surface.triangle_edges], axis=1)[:, None]  # where the split edge begins
    rotated = np.take_along_axis(surface.triangles, (corner + np.arange(3)) % 3, axis=1)
    middle = new_vertex[np.take_along_axis(surface.triangle_edges, corner, axis=1)[:, 0]]
    cut = middle >= 0
    (a, b, c), p = rotated[cut].T, middle[cut]
    whole, halved = np.flatnonzero(~cut), np.flatnonzero(cut)
    triangles = np.vstack([surface.triangles[whole], np.column_stack([a, p, c]), np.column_stack([p, b, c])])
    return Surface(vertices, triangles), np.concatenate([whole, halved, halved])
