# SPDX-License-Identifier: GPL-3.0-or-later
"""Conformal maps to begin with, and what to do about outlines that cross themselves."""

from __future__ import annotations

import numpy as np

from .certificate import are_crossed, crossing_sides
from .chart import Surface
from .domain import Fixed, Held
from .loops import followers
from .pieces import parts_of, starts_of
from .weights import cotangent

_ROUNDEST = 0.5  # share of a circle's bends that outlines take on at most not to cross themselves,
_HALVINGS = 2  # of the range in which the least such share is looked for
_REACH = 16  # lengths of what lies between two crossing sides, to which it bends around them
_SEVERAL = 500  # pairs of crossing sides of an outline that are looked at


class Flattening:
    """The conformal map of every piece of a surface with the lengths of its outline (Sawhney, Crane 2017).

    Of all conformal maps of a disk it has the least area distortion: its scale factors exp(u) are 1 along the outline.
    u solves Yamabe's equation, and its flux out of the outline tells how much the map's outline bends at each vertex.
    Holes are closed meanwhile.
    """

    def __init__(self, surface: Surface):
        self._surface, self._loop = surface, np.concatenate(surface.outlines)
        fixed = Fixed(np.zeros((len(surface.vertices), 2), bool), np.zeros((len(surface.vertices), 2)))
        fixed.held[self._loop] = True
        solid = Held(surface, fixed, surface.plugs(solid=True))
        self._n = n = len(solid.vertex_piece)
        weights = solid.triangles.joined([cotangent(chart) for chart in solid.charts])
        angle_sums = np.sum([chart.angle_sums(n) for chart in solid.charts], axis=0)
        self._solve = solid.constrained.factor(weights)
        u = self._solve(np.zeros((n, 1)), (angle_sums - 2 * np.pi)[:, None])[:, 0]
        i, j = solid.triangles.edges.T
        flux = np.bincount(i, weights[0] * (u[i] - u[j]), n) + np.bincount(j, weights[1] * (u[j] - u[i]), n)
        self._outlines = _Outlines(surface, np.pi - angle_sums[self._loop] + flux[self._loop])

    def map(self) -> np.ndarray:
        """The map (n, 2)."""
        return self._within(np.zeros(len(self._loop)))

    def opened(self, crossed: np.ndarray) -> np.ndarray:
        """The map (n, 2) where the outlines of the pieces that are `crossed`, (p,) bool, bend as much more like circles
        as they need not to cross themselves, unless half way to a circle is not enough: there it is nearly conformal.
        """
        return self._within(self._outlines.uncrossed(crossed))

    def crossed(self) -> np.ndarray:
        """Which outlines cross themselves in the map, (p,) bool."""
        return self._outlines.crossed()

    def _within(self, share):
        outline = np.zeros((self._n, 2))
        outline[self._loop] = self._outlines.at(share)
        return _turned_by_farthest(self._surface, self._solve(outline)[: len(self._surface.vertices)])


def conformal(surface: Surface) -> np.ndarray:
    """The conformal map (n, 2) of every piece of a surface, opened where it would cross itself."""
    flattening = Flattening(surface)
    crossed = flattening.crossed()
    return flattening.opened(crossed) if crossed.any() else flattening.map()


class _Outlines:
    """The outlines of a surface's pieces in the plane, with the lengths that they have in space, or nearly.

    Their vertices, k in all, are taken outline after outline.

    bend  (k,), by how much each is to bend at each of its vertices, in radians
    """

    def __init__(self, surface: Surface, bend: np.ndarray):
        self._starts = starts_of(surface.outlines)
        loop = np.concatenate(surface.outlines)
        size = np.diff(self._starts, append=len(loop))
        self._piece = np.repeat(np.arange(len(size)), size)
        self._length = np.linalg.norm(surface.vertices[followers(surface.outlines)] - surface.vertices[loop], axis=1)
        self._before = np.arange(-1, len(loop) - 1)
        self._before[self._starts] = self._starts + size - 1
        self._bend, self._whole = bend, surface.outline_lengths
        self._circle = np.pi * (self._length + self._length[self._before]) / self._whole[self._piece]

    def at(self, share: np.ndarray) -> np.ndarray:
        """The places (k, 2) of outlines that bend by such a share, (k,), like circles instead, closed by the least
        change of their lengths."""
        more = share * (self._circle - self._bend)
        more -= np.add.reduceat(more, self._starts)[self._piece] * self._circle / (2 * np.pi)
        direction = np.cumsum(self._bend + more)  # of the side that follows each vertex
        along = np.column_stack([np.cos(direction), np.sin(direction)])
        gap = np.add.reduceat(self._length[:, None] * along, self._starts)
        stiffness = np.add.reduceat(self._length[:, None, None] * along[:, :, None] * along[:, None], self._starts)
        change = (np.linalg.pinv(stiffness) @ gap[:, :, None])[self._piece, :, 0]
        length = self._length * (1 - (along * change).sum(axis=1))
        # Closed, they end where the next one begins.
        return np.cumsum(length[:, None] * along, axis=0)[self._before]

    def uncrossed(self, crossed: np.ndarray) -> np.ndarray:
        """The share, (k,), by which those that are `crossed`, (p,) bool, are to bend like circles, as little as they
        must not to cross themselves, if that helps: around where they do, else everywhere."""
        share = np.zeros(len(self._bend))
        for where in (self._around, self._everywhere):
            weight = where(crossed)
            least, most = np.zeros(len(crossed)), np.where(crossed, _ROUNDEST, 0)
            most[self._crossed(most[self._piece] * weight, crossed)] = 0
            for _ in range(_HALVINGS if most.any() else 0):
                middle = (least + most) / 2
                enough = ~self._crossed(middle[self._piece] * weight, most > 0)
                least, most = np.where(enough, least, middle), np.where(enough, middle, most)
            share += most[self._piece] * weight
            crossed = crossed & (most == 0)
            if not crossed.any():
                break
        return share

    def crossed(self) -> np.ndarray:
        """Which cross themselves as they are, (p,) bool."""
        return self._crossed(np.zeros(len(self._bend)), np.ones(len(self._starts), bool))

    def _polygons(self, share):
        return parts_of(self.at(share), self._starts)

    def _crossed(self, share, asked):
        """Which of the pieces that are `asked` for cross themselves with such shares, (p,) bool."""
        result = np.zeros(len(asked), bool)
        which = np.flatnonzero(asked)
        if len(which):
            polygons = self._polygons(share)
            result[which] = are_crossed([polygons[k] for k in which], np.arange(len(which)))
        return result

    def _everywhere(self, _crossed):
        return np.ones(len(self._bend))

    def _around(self, crossed):
        """How much every vertex belongs to what lies between sides that cross, of the pieces that are `crossed`, (p,)
        bool, from 0 to 1, (k,)."""
        weight = np.zeros(len(self._bend))
        polygons = self._polygons(weight)
        ends = np.append(self._starts, len(weight))
        for k in np.flatnonzero(crossed).tolist():
            its = slice(ends[k], ends[k + 1])
            whole, at = self._whole[k], np.cumsum(self._length[its]) - self._length[its]
            middle = at + self._length[its] / 2  # of the side that follows each vertex
            found = 0
            for sides in crossing_sides(polygons[k : k + 1], np.zeros(1, int)):
                for one, other in np.sort(np.column_stack(sides), axis=1)[: _SEVERAL - found].tolist():
                    # The shorter of both parts of the outline
                    begin, length = middle[one], middle[other] - middle[one]
                    if length > whole / 2:
                        begin, length = middle[other], whole - length
                    away = np.abs((at - begin - length / 2 + whole / 2) % whole - whole / 2) - length / 2
                    weight[its] = np.maximum(weight[its], np.clip(1 - away / (_REACH * length), 0, 1))
                found += len(sides[0])
                if found >= _SEVERAL:
                    break
        return weight


def _turned_by_farthest(surface, uv):
    """Every piece's map (n, 2) turned so that the vertex farthest from its middle lies to the right, whatever the
    vertices' numbers are.
    """
    piece, starts = surface.vertex_piece, surface.vertex_starts
    count = np.diff(starts, append=len(uv))
    z = uv @ np.array([1, 1j])
    z = z - (np.add.reduceat(z, starts) / count)[piece]
    distance = np.abs(z)
    is_farthest = distance >= (1 - 1e-6) * np.maximum.reduceat(distance, starts)[piece]  # of equal ones the first
    farthest = np.flatnonzero(is_farthest)
    farthest = farthest[np.diff(piece[farthest], prepend=-1) > 0]
    way = np.conj(z[farthest]) / np.maximum(distance[farthest], np.finfo(float).tiny)
    z = z * way[piece]
    return np.column_stack([z.real, z.imag])
