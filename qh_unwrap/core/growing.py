# SPDX-License-Identifier: GPL-3.0-or-later
"""Cuts that grow to where a map would stretch most, and shrink where they bring little.

What a cut brings is foreseen (`foresight`), so that many can be tried; a map is made only of what seems good enough.
"""

from __future__ import annotations

import heapq
from itertools import count

import numpy as np

from .branches import branches, pruned, shortened
from .cuttable import Cuttable
from .foresight import Foresight
from .paths import Paths

_CANDIDATES = 4  # places that are tried for every new cut
_APART = 0.5  # of how far such a place is from the cut, within which there is no other
_EACH = 0.05  # of the root of the area, that every new cut costs beside its length
_STEP = 0.25  # of a branch, by which its end is drawn back at once


class Growth:
    """The cut of an island on its way.

    Parameters
    ----------
    mesh : Cuttable
    cost : (k,), of the edges
    cut : (k,) bool, that opens it
    kept : (n,) bool, what the cut has to reach for that

    Attributes
    ----------
    stretch : how much a map will stretch, as `Foresight.stretch` says
    """

    def __init__(self, mesh: Cuttable, cost: np.ndarray, cut: np.ndarray, kept: np.ndarray):
        self._mesh, self._cost, self._foresight = mesh, cost, Foresight(mesh)
        self._each = _EACH * cost[mesh.inner].sum() / mesh.lengths[mesh.inner].sum()
        self._take(cut, kept)

    def _take(self, cut, kept):
        self.cut, self._kept = cut, kept
        self._held = self._foresight.outline(cut)
        self._scaling = self._foresight.scaling(self._held)
        self.stretch = self._foresight.stretch(self._scaling)

    @property
    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """What `restore` takes: cut (k,) bool and kept (n,) bool."""
        return self.cut, self._kept

    def restore(self, state: tuple[np.ndarray, np.ndarray]) -> None:
        """Go back to an earlier state."""
        self._take(*state)

    def _foreseen(self, cut):
        return self._foresight.stretch(self._foresight.scaling(self._foresight.outline(cut)))

    def grow(self) -> bool:
        """Add the cut that brings most for what it costs; returns whether there is any that brings something."""
        mesh, best, most = self._mesh, None, 0.0
        paths = Paths(len(mesh.points), mesh.edges, self._cost, mesh.inner, np.flatnonzero(self._held))
        for tip in self._places(paths):
            path = paths.to(tip)
            cut = self.cut.copy()
            cut[path] = True
            gain = (self.stretch - self._foreseen(cut)) / (self._cost[path].sum() + self._each)
            if gain > most:
                best, most = (cut, tip), gain
        if best is None:
            return False
        kept = self._kept.copy()
        kept[best[1]] = True
        self._take(best[0], kept)
        return True

    def _places(self, paths):
        """Vertices where a cut is missing, the most first."""
        points, found = self._mesh.points, []
        size = np.where(np.isfinite(paths.distance), np.abs(self._scaling), 0)
        size[self._held] = 0
        for value in (size, size * np.where(size > 0, paths.distance, 0)):
            value = value.copy()
            for _ in range(_CANDIDATES):
                tip = int(np.argmax(value))
                if not value[tip] > 0:
                    break
                if tip not in found:
                    found.append(tip)
                away = np.linalg.norm(points - points[tip], axis=1)
                value[away <= _APART * away[self._held].min()] = 0
        return found

    def shorten(self) -> None:
        """Lay the branches anew where there are cheaper ways."""
        cut = shortened(self._mesh, self._cost, self.cut, self._kept)
        if not np.array_equal(cut, self.cut):
            self._take(cut, self._kept)

    def trim(self, most: float) -> None:
        """Draw back the ends that bring least for what they cost, as long as the stretch is not above `most`."""
        mesh = self._mesh
        tried = count()
        waiting: list = []

        def consider(branch):
            """Put the next step back from the end of a branch into the queue."""
            number = max(1, int(np.ceil(_STEP * len(branch.edges))))
            cut = self.cut.copy()
            cut[branch.edges[-number:]] = False
            if not cut.any():
                return
            loss = self._foreseen(cut) - self.stretch
            price = self._cost[branch.edges[-number:]].sum()
            heapq.heappush(waiting, (loss / price, next(tried), self.stretch, branch, number))

        for branch in self._ends():
            consider(branch)
        while waiting:
            _, _, then, branch, number = heapq.heappop(waiting)
            if not self.cut[branch.edges].all():
                continue
            if then != self.stretch:
                consider(branch)
                continue
            cut, kept = self.cut.copy(), self._kept.copy()
            cut[branch.edges[-number:]] = False
            kept[branch.vertices[-number:]] = False
            if number < len(branch.edges):
                kept[branch.vertices[-number - 1]] = True
            else:
                cut = pruned(mesh, cut, kept)
            before = self.state
            self._take(cut, kept)
            if self.stretch > most or not cut.any():
                self.restore(before)
            else:
                for each in self._ends():
                    if each.vertices[-1] == branch.vertices[-number - 1] or number == len(branch.edges):
                        consider(each)

    def _ends(self):
        """The branches that end at a vertex where nothing else is, running to there."""
        number = self._mesh.degrees(self.cut)
        loose = (number == 1) & ~self._mesh.on_rim
        found = []
        for branch in branches(self._mesh, self.cut, self._kept):
            first, last = loose[branch.vertices[[0, -1]]]
            if last and not first:
                found.append(branch)
            elif first and not last:
                found.append(branch.reversed)
        return found
