# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for the seams of one island: maps are made of its cut, until one is good enough and needs all of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .cuttable import Cuttable, Polygons
from .distortion import densities
from .edge_costs import Wishes, edge_costs
from .errors import ClosedError, UnwrapError
from .growing import Growth, Steps
from .mirroring import Mirror
from .opening import opening
from .report import Result, Shape
from .seam_settings import SeamSettings

_LOPSIDED = 2.0  # times the distortion allowed, from which on seams are rather not symmetric
_MAPS = 12  # that are made of an island, at most, until its distortion is small enough
_TRIMS = 5  # that are made at most to see which ends of its cut it does not need
_CLOSE = 0.94  # of the distortion that is allowed, from which on no end is drawn back any more
_AIM = 0.97  # of it, that drawing back aims at
_HARDER = 0.6, 0.9  # times that is aimed at after each map that was not good enough
_CUTS = 40  # that are made before the first map, at most,
_MORE_CUTS = 8  # and between two maps: what a map shows is worth more than what is foreseen
_PATIENCE = 5  # maps in a row that bring nothing, after which more cuts are of no use
_NOTHING = 0.05  # of what the energy lies above 1, that a map must bring at least
_ALMOST = 1.2  # times what the least energy lies above 1: a shorter cut with so much is better, if none is good enough
_ONE_MAP = 0.7  # of an island's work that is left after each map, by and large


@dataclass(frozen=True, eq=False)
class ChartSeams:
    """What has become of one of the islands that the mesh consists of before it is cut, or split into."""

    faces: np.ndarray = field(repr=False)
    """(f',), of the mesh."""
    energy: float
    """The mean symmetric Dirichlet energy of its map; NaN if it was not unwrapped."""
    length: float
    """Of the seams within it, in the mesh's unit."""
    certified: bool
    """It is certified that its map has no flips and no overlaps."""
    error: UnwrapError | None
    """Why it cannot be cut or unwrapped."""
    warnings: tuple[str, ...]
    result: Result | None = field(repr=False)
    """Its map, and the report on it."""


@dataclass(frozen=True, eq=False)
class _Found:
    """A cut, and the map of it."""

    state: tuple[np.ndarray, np.ndarray]
    length: float
    energy: float
    certified: bool
    result: Result | UnwrapError

    @property
    def rank(self) -> tuple[bool, float]:
        """By which the best comes first."""
        return not self.certified, self.energy


class Search:
    """The search for the seams of one island.

    Attributes
    ----------
    ended : there is nothing left to do
    done : the share that is done, from 0 to 1
    seams : the mesh's edges that are to be cut, as far as is known
    energy : that of the map of these, NaN if there is none
    area : of the island, in the mesh's unit
    """

    def __init__(
        self,
        mesh: Cuttable | UnwrapError,
        polygons: Polygons,
        settings: SeamSettings,
        wishes: Wishes,
        unwrapping: bool,
    ):
        self._goal = settings.distortion - 1
        self._error: UnwrapError | None = None
        self._result: Result | None = None
        self._growth: Growth | None = None
        self._warnings: tuple[str, ...] = ()
        self.energy, self.done, self.area = float("nan"), 0.0, 0.0
        self._maps, self._trims, self._aim = 0, 0, self._goal
        self._best: _Found | None = None  # the last good map,
        self._found: list[_Found] = []  # and all of them
        self.ended = True
        if isinstance(mesh, UnwrapError):
            self._error = mesh
            return
        self._mesh = mesh
        self.area = mesh.area
        cost = edge_costs(mesh, settings, wishes)
        mirror = None
        if settings.symmetry != "NONE":
            mirror = self._mirror(polygons, settings)
        try:
            cut, kept = self._opening(cost, mirror)
        except UnwrapError as error:
            self._error = error
            return
        if mirror is not None and not np.array_equal(cut, cut[mirror.edge]):
            mirror = None
            self._warnings += ("it cannot be opened symmetrically: its seams are not",)
        self._cost, self._is_mirrored = cost, mirror is not None
        self._growth, self.ended = Growth(mesh, cost, cut, kept, mirror), not unwrapping

    def _mirror(self, polygons, settings):
        mirror = Mirror.of(self._mesh, polygons.vertices, "XYZ".index(settings.symmetry))
        if mirror is None:
            self._warnings += ("it is not symmetric: nor are its seams",)
        return mirror

    def _opening(self, cost, mirror):
        if mirror is not None:
            try:
                return opening(self._mesh, np.maximum(cost, cost[mirror.edge]), mirror)
            except ClosedError:
                pass
        return opening(self._mesh, cost)

    @property
    def seams(self) -> np.ndarray:
        if self._growth is None:
            return np.zeros(0, int)
        return self._mesh.mesh_edge[self._growth.cut]

    @property
    def shape(self) -> Shape:
        """What is to be unwrapped next."""
        assert self._growth is not None
        opened = self._mesh.opened(self._growth.cut)
        return Shape(self._mesh.points[opened.origin], opened.triangles)

    def grow(self) -> Steps:
        """Go to the next map, or end; yields now and then."""
        growth = self._growth
        assert growth is not None
        most = _MORE_CUTS if self._maps else _CUTS
        cuts = 0
        while self._best is None and cuts < most and growth.excess > self._aim and growth.grow():
            cuts += 1
            yield
        if cuts:
            yield from growth.shorten()
        if self._best is None and self._found and np.array_equal(self._found[-1].state[0], growth.cut):
            self._end()  # there is nothing left to cut

    def take(self, result: Result | UnwrapError) -> Steps:
        """Go on after a map, or end; yields now and then."""
        self._maps += 1
        self.done = 1 - _ONE_MAP**self._maps
        growth, energy, certified = self._growth, float("inf"), False
        assert growth is not None
        if not isinstance(result, UnwrapError):
            self.energy = energy = result.report.after.symmetric_dirichlet
            certified = result.report.injective
            growth.learn(densities(result.report.after))
        length = float(self._mesh.lengths[growth.cut].sum())
        found = _Found(growth.state, length, energy, certified, result)
        self._found.append(found)
        if certified and energy - 1 <= self._goal:
            self._best = found
            if energy - 1 > _CLOSE * self._goal:
                self._end()
            else:
                yield from self._draw_back(_AIM * self._goal)
        elif self._best is not None:
            # Too much was drawn back: half of it may be right.
            growth.restore(self._best.state)
            yield from self._draw_back((growth.excess + _AIM * self._goal) / 2)
        elif self._maps >= _MAPS or self._is_in_vain:
            self._end()
        else:
            self._aim *= float(np.clip(self._goal / max(energy - 1, 1e-12), *_HARDER))

    @property
    def _is_in_vain(self):
        """Whether the latest cuts have brought nothing."""
        early, late = self._found[:-_PATIENCE], self._found[-_PATIENCE:]
        if not early:
            return False
        before, now = (min(each, key=lambda found: found.rank) for each in (early, late))
        return now.certified == before.certified and now.energy - 1 > (1 - _NOTHING) * (before.energy - 1)

    def _draw_back(self, most):
        """Draw back ends of the cut that bring little, for one more map; end where there are none."""
        growth, before = self._growth, self._growth.cut
        self._trims += 1
        if self._trims <= _TRIMS:
            yield from growth.trim(most)
        if np.array_equal(before, growth.cut):
            self._end()

    @property
    def _almost(self):
        """What comes near enough to the least energy with a short cut."""
        least = min(self._found, key=lambda found: found.rank)
        most = 1 + _ALMOST * (least.energy - 1)
        near = [found for found in self._found if found.certified == least.certified and found.energy <= most]
        return min(near, key=lambda found: found.length)

    def _end(self):
        found = self._best or self._almost
        if self._is_mirrored and not (found.certified and found.energy - 1 <= _LOPSIDED * self._goal):
            # Where symmetric cuts do not lead to the end, others may.
            self._growth, self._is_mirrored = Growth(self._mesh, self._cost, *found.state), False
            self._maps, self._found, self._aim = 0, [], self._goal
            self._warnings += ("symmetric seams alone leave it too much distorted: some are not symmetric",)
            return
        self._growth.restore(found.state)
        if isinstance(found.result, UnwrapError):
            self._error, self.energy = found.result, float("nan")
        else:
            self._result, self.energy = found.result, found.energy
            if not found.certified:
                self._warnings += ("no map of it without flips and overlaps was found",)
            elif self._best is None:
                self._warnings += (
                    f"its distortion stays at {self.energy:.5g}: more cuts do not help, more charts may",
                )
        self.ended, self.done = True, 1.0

    def put_map(self, corner_uv: np.ndarray) -> None:
        """Write the map, if there is one, to the mesh's corners in `corner_uv` (c, 2)."""
        if self._result is not None and self._growth is not None:
            corner_uv[self._mesh.mesh_corners] = self._result.uv[self._mesh.opened(self._growth.cut).triangles]

    def chart(self, faces: np.ndarray, polygons: Polygons) -> ChartSeams:
        """What has become of the island, whose `faces` (f',) these are."""
        result = self._result
        length = polygons.lengths[self.seams].sum()
        certified = result is not None and result.report.injective
        warnings = self._warnings + (result.report.warnings if result is not None else ())
        return ChartSeams(faces, self.energy, float(length), certified, self._error, warnings, result)
