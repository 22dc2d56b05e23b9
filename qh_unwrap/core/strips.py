# SPDX-License-Identifier: GPL-3.0-or-later
"""A start for what is long and narrow: ribbons, straps and belts, which may wind over themselves when laid flat.

Such a strip is laid straight, each of its long sides by its own length.  That is all but an isometry, up to how much
the strip bends sideways over its own width.
"""

from __future__ import annotations

import numpy as np

from .chart import Surface
from .distances import EdgeDistances
from .loops import edge_lengths

_NARROW = 200  # widths that a strip is long, at least: shorter ones end with less distortion from other starts
_ACROSS = 4  # widths that its sides are apart, at most: else it branches
_BLUNT = 2  # power of the superellipse that ends the strip, relative to log2(length / width)


def strip_outlines(surface: Surface, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of the pieces `asked` for, (p,) bool, are strips, (p,) bool, and where their outlines go if they are laid
    straight, (n, 2)."""
    places = np.zeros((len(surface.vertices), 2))
    found = asked & (surface.outline_lengths**2 / 4 > _NARROW)  # of area 1
    for k in np.flatnonzero(found).tolist():
        one = surface.one(k)
        straight = _straight(one)
        found[k] = straight is not None
        if straight is not None:
            places[surface.vertex_ends[k] + one.loops[0]] = straight
    return found, places


def _straight(surface):
    """Places of the outline (k, 2) of a surface of one piece, or None if it is no strip."""
    loop = surface.loops[0]
    sides = edge_lengths(surface.vertices[loop])
    length = sides.sum() / 2
    width = 1 / length
    distances = EdgeDistances(surface.vertices, surface.edges)
    first, last = _ends(distances, loop)
    ahead = (np.arange(len(loop)) - first) % len(loop) <= (last - first) % len(loop)
    if any(distances.to(loop[side])[loop].max() > _ACROSS * width for side in (ahead, ~ahead)):
        return None
    at = np.roll(np.append(0.0, np.cumsum(np.roll(sides, -first))[:-1]), first)  # along the outline from the first end
    middle, whole = at[last], sides.sum()
    along = np.where(ahead, at / middle, (whole - at) / (whole - middle))
    # Where three vertices in a row lie on a straight line, the triangle between them would be flat: convex everywhere
    # are the sides of a superellipse, if hardly.
    power = _BLUNT * np.log2(length / width)
    half = width / 2 * np.maximum(1 - np.abs(2 * along - 1) ** power, 0) ** (1 / power)
    half += _ears(surface)[loop]
    return np.column_stack([length * along, np.where(ahead, -half, half)])


def _ends(distances, loop):
    """The two places in a loop that are farthest apart, nearly."""
    first = int(np.argmax(distances.to(loop[:1])[loop]))
    return first, int(np.argmax(distances.to(loop[first : first + 1])[loop]))


def _ears(surface):
    """How far vertices stand out from the outline because they belong to one triangle alone, (n,)."""
    result = np.zeros(len(surface.vertices))
    tip = np.bincount(surface.triangles.ravel(), minlength=len(result)) == 1
    triangle, corner = np.nonzero(tip[surface.triangles])
    a, b, c = (surface.vertices[surface.triangles[triangle, (corner + k) % 3]] for k in range(3))
    base = np.linalg.norm(c - b, axis=1)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(base, np.finfo(float).tiny)
    result[surface.triangles[triangle, corner]] = height
    return result
