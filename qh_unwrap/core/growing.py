# SPDX-License-Identifier: GPL-3.0-or-later
"""Cuts that grow to where a map stretches most, and shrink where they bring little.

What a cut brings is foreseen (`foresight`), so that many can be tried, and a map is made only of what seems good
enough.  What the map then shows corrects what is foreseen.
"""

from __future__ import annotations

import heapq
from collections.abc import Generator
from itertools import count

import numpy as np

from .branches import Branch, branches, pruned, shortening
from .cuttable import Cuttable
from .foresight import Foresight
from .mirroring import Mirror
from .paths import Paths, beside_rims

_FIRST = 0.6  # of the square of the scaling, by which the energy exceeds 1 by and large
_RANGE = 0.15, 6.0  # of what the square of the scaling counts somewhere, once a map has been made
_STRETCHED = 4.0  # the energy of a triangle that counts, at most: a map that failed tells only where
_CANDIDATES = 4, 3  # places that are tried for every new cut: where it is missing most, and far from the others
_APART = 0.5  # of how far such a place is from the cut, within which there is no other
_EACH = 0.05  # of the root of the area, that every new cut costs beside its length
_SHARP = 0.7  # radians between two faces, from which on a cut along an edge goes on to the end of the line
_STEP = 0.25  # of a branch, by which its end is drawn back at once
_RATE = 1.0  # of what the cut brings for its cost on the average, that a cheaper way may lose
_WORSE = 1.5  # times what such a step was to cost, from which on the next one is asked first

Steps = Generator[None, None, None]


class Growth:
    """The cut of an island on its way.

    Parameters
    ----------
    mesh : Cuttable
    cost : (k,), of the edges, relative to their lengths about 1 or less where they like to be cut
    cut : (k,) bool, that opens it
    kept : (n,) bool, what the cut has to reach for that
    mirror : Mirror, None where the cut need not be symmetric

    Attributes
    ----------
    cut : (k,) bool
    excess : by how much the energy of a map is foreseen to exceed 1
    """

    def __init__(
        self, mesh: Cuttable, cost: np.ndarray, cut: np.ndarray, kept: np.ndarray, mirror: Mirror | None = None
    ):
        self._mesh, self._cost, self._foresight, self._mirror = mesh, cost, Foresight(mesh), mirror
        if mirror is not None:
            self._cost = cost = np.maximum(cost, cost[mirror.edge])
        self._price = beside_rims(mesh, cost)
        self._usable = np.isfinite(self._price)
        if mirror is not None:
            self._usable &= mirror.first_half[mesh.edges].all(axis=1)
        relative = cost[mesh.inner] / np.maximum(mesh.lengths[mesh.inner], 1e-12)
        relative = relative[np.isfinite(relative)]
        self._each = _EACH * float(np.median(relative)) if len(relative) else 0.0
        self._sharp = mesh.inner & (np.abs(mesh.dihedral) > _SHARP) & np.isfinite(cost)
        self._amid = mesh.degrees(self._sharp) == 2  # the vertices where a line of sharp edges goes on
        self._count = np.full(len(mesh.points), _FIRST)
        self._seen = np.zeros(len(mesh.points))
        self._gains: dict[tuple[int, float], float] = {}
        self._take(cut, kept)

    def _take(self, cut, kept):
        self.cut, self._kept = cut, kept
        self._held = self._foresight.outline(cut)
        self._scaling = self._foresight.scaling(self._held)
        self.excess = self._sum(self._scaling)

    def _sum(self, u):
        return float((self._foresight.area * self._count * u * u).sum())

    def _foreseen(self, cut):
        return self._sum(self._foresight.scaling(self._foresight.outline(cut)))

    @property
    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """What `restore` takes: cut (k,) bool and kept (n,) bool."""
        return self.cut, self._kept

    def restore(self, state: tuple[np.ndarray, np.ndarray]) -> None:
        """Go back to an earlier state."""
        self._take(*state)

    def learn(self, energy: np.ndarray) -> None:
        """Correct what is foreseen by the `energy` (m,) that a map of the present cut has in every triangle."""
        its = self._foresight
        seen = its.smoothed(its.at_vertices(np.minimum(np.nan_to_num(energy, nan=np.inf), _STRETCHED) - 1))
        square = its.smoothed(self._scaling**2)
        if self._mirror is not None:
            seen, square = ((each + each[self._mirror.vertex]) / 2 for each in (seen, square))
        self._seen = seen
        ratio = (its.area * seen).sum() / max((its.area * square).sum(), 1e-12)
        low, high = _RANGE[0] * ratio, _RANGE[1] * ratio
        self._gains = {}
        self._count = np.clip(seen / np.maximum(square, 1e-12), low, high)
        # The sum is to be that of the map.
        self._count *= (its.area * seen).sum() / max(self._sum(self._scaling), 1e-12)
        self.excess = self._sum(self._scaling)

    def grow(self) -> bool:
        """Add the cuts that bring most for what they cost; returns whether there is any that brings something."""
        mesh = self._mesh
        plane = None if self._mirror is None else self._mirror.on_plane
        sources = np.flatnonzero(self._held)
        paths = Paths(len(mesh.points), mesh.edges, self._price, self._usable, sources, plane=plane)
        most, chosen = 0.0, None
        places = self._places(paths)
        # What a place brought when it was asked last, it hardly exceeds now, unless it lies nearer to the cut.
        known = {tip: self._gains.get((tip, round(float(paths.distance[tip]), 9)), np.inf) for tip in places}
        self._gains = {}
        for tip in sorted(places, key=lambda tip: -known[tip]):
            key = tip, round(float(paths.distance[tip]), 9)
            if known[tip] <= most:
                self._gains[key] = known[tip]
                continue
            cut, tips = self._joined(paths, tip)
            price = self._cost[cut & ~self.cut].sum() + self._each * len(tips)
            self._gains[key] = gain = (self.excess - self._foreseen(cut)) / price
            if gain > most:
                most, chosen = gain, (cut, tips)
        if chosen is None:  # then to where the last map stretched
            seen = self._seen * np.where(np.isfinite(paths.distance), paths.distance, 0)
            if not seen.any():
                return False
            chosen = self._joined(paths, int(np.argmax(seen)))
        kept = self._kept.copy()
        kept[chosen[1]] = True
        self._take(chosen[0], kept)
        return True

    def _joined(self, paths, tip):
        """The cut with the path to a tip, and what mirrors it; and the tip with its mirror's, a list."""
        cut, path = self.cut.copy(), paths.to(tip)
        cut[path] = self._mesh.inner[path]
        tip = self._at_end_of_line(cut, path, tip)
        tips = [tip]
        if self._mirror is not None:
            cut[self._mirror.edge[cut]] = True
            tips = sorted({tip, int(self._mirror.vertex[tip])})
        return cut, tips

    def _at_end_of_line(self, cut, path, tip):
        """Go on from the tip of a path, whose edges begin there, along the line of sharp edges that it follows; returns
        where that ends."""
        if not (len(path) and self._sharp[path[0]]):
            return tip
        edge, taken = path[0], self._held | self._mesh.touched(path) | self._mesh.on_rim
        while self._amid[tip]:
            beside = self._mesh.triangle_edges[(self._mesh.triangles == tip).any(axis=1)]
            beside = np.unique(beside[self._sharp[beside] & (self._mesh.edges[beside] == tip).any(axis=2)])
            edge = beside[beside != edge][0]
            following = int(self._mesh.edges[edge].sum()) - tip
            if taken[following] or (self._mirror is not None and not self._usable[edge]):
                break
            cut[edge], taken[following], tip = True, True, following
        return tip

    def _places(self, paths):
        """Vertices where a cut is missing, the most first."""
        points, found = self._mesh.points, []
        size = np.where(np.isfinite(paths.distance), np.abs(self._scaling) * np.sqrt(self._count), 0)
        size[self._held] = 0  # which is where no path is needed
        far = size * np.where(size > 0, paths.distance, 0)
        for value, number in zip((size, far), _CANDIDATES, strict=True):
            value = value.copy()
            for _ in range(number):
                tip = int(np.argmax(value))
                if not value[tip] > 0:
                    break
                if tip not in found:
                    found.append(tip)
                away = np.linalg.norm(points - points[tip], axis=1)
                value[away <= _APART * away[self._held].min(initial=np.inf)] = 0
        return found

    def shorten(self) -> Steps:
        """Lay the branches anew where there are cheaper ways; yields after each try."""
        if self._mirror is not None:
            return  # which would have to lay both sides alike
        rate = _RATE * self.excess / max(self._cost[self.cut].sum(), 1e-12)
        known = {self.cut.tobytes(): self.excess}

        def is_better(cut, other):
            known[cut.tobytes()] = excess = self._foreseen(cut)
            saved = self._cost[other].sum() - self._cost[cut].sum()
            return excess <= known[other.tobytes()] + rate * saved

        cut = yield from shortening(self._mesh, self._cost, self.cut, self._kept, is_better)
        if not np.array_equal(cut, self.cut):
            self._take(cut, self._kept)

    def trim(self, most: float) -> Steps:
        """Draw back the ends that bring least for what they cost, as long as the excess is not above `most`; yields
        after each try."""
        tried = count()
        waiting: list[tuple[float, int, Branch, int]] = []

        def consider(branch):
            """Put the next step back from the end of a branch into the queue."""
            number = max(1, int(np.ceil(_STEP * len(branch.edges))))
            while number < len(branch.edges) and self._amid[branch.vertices[-number - 1]]:
                if not self._sharp[branch.edges[-number - 1]]:
                    break
                number += 1  # to where the line of sharp edges begins
            cut, _, price = self._drawn_back(branch, number)
            if cut.sum() >= self._mesh.fewest:
                loss = (self._foreseen(cut) - self.excess) / price
                heapq.heappush(waiting, (loss, next(tried), branch, number))

        for branch in self._ends():
            consider(branch)
            yield
        while waiting:
            yield
            expected, _, branch, number = heapq.heappop(waiting)
            if not self.cut[branch.edges].all():
                continue
            before, excess = self.state, self.excess
            cut, kept, price = self._drawn_back(branch, number)
            self._take(cut, kept)
            loss = (self.excess - excess) / price
            if self.excess > most or cut.sum() < self._mesh.fewest:
                self.restore(before)
                continue
            if waiting and loss > max(_WORSE * expected, waiting[0][0]):
                self.restore(before)
                heapq.heappush(waiting, (loss, next(tried), branch, number))
                continue
            if number < len(branch.edges):
                consider(Branch(branch.edges[:-number], branch.vertices[:-number]))
            else:
                fork = branch.vertices[0]
                for each in self._ends():
                    if fork in each.vertices:
                        consider(each)

    def _drawn_back(self, branch, number):
        """The cut and what it keeps without the last `number` edges of a branch, and what mirrors them; what that
        saves."""
        cut, kept = self.cut.copy(), self._kept.copy()
        edges, vertices = branch.edges[-number:], branch.vertices[-number:]
        if self._mirror is not None:
            edges = np.append(edges, self._mirror.edge[edges])
            vertices = np.append(vertices, self._mirror.vertex[vertices])
        cut[edges], kept[vertices] = False, False
        if number < len(branch.edges):
            end = branch.vertices[-number - 1]
            kept[end] = True
            if self._mirror is not None:
                kept[self._mirror.vertex[end]] = True
        else:
            cut = pruned(self._mesh, cut, kept)
        return cut, kept, self._cost[self.cut & ~cut].sum() + (self._each if number == len(branch.edges) else 0)

    def _ends(self):
        """The branches that end at a vertex where nothing else is, running to there."""
        loose = (self._mesh.degrees(self.cut) == 1) & ~self._mesh.on_rim
        found = []
        for branch in branches(self._mesh, self.cut, self._kept):
            first, last = loose[branch.vertices[[0, -1]]]
            if last and not first:
                found.append(branch)
            elif first and not last:
                found.append(branch.reversed)
        return found
