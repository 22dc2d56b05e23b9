# SPDX-License-Identifier: GPL-3.0-or-later
"""Seams for a mesh: what is closed is opened, and cut where it stretches, until it unwraps with little distortion.

Cut, unwrap, look where it stretches, cut there (Gu, Gortler, Hoppe 2002; Sheffer, Hart 2002): but what a cut brings is
foreseen, so that few maps have to be made.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np

from .air import Triangulator
from .cuttable import Cuttable, Polygons, cuttables
from .distortion import densities
from .edge_costs import Wishes, edge_costs
from .errors import ClosedError, UnwrapError
from .growing import Growth
from .mirroring import Mirror
from .opening import opening
from .report import Result, Shape
from .seam_settings import SeamSettings
from .settings import Settings
from .splitting import splitting
from .unwrapping import unwrap_islands

_MAPS = 12  # that are made of an island, at most, until its distortion is small enough
_TRIMS = 5  # that are made at most to see which ends of its cut it does not need
_CLOSE = 0.94  # of the distortion that is allowed, from which on no end is drawn back any more
_AIM = 0.97  # of it, that drawing back aims at
_HARDER = 0.9  # times that is aimed at after each map that was not good enough
_CUTS = 40  # that are made between two maps, at most
_ONE_MAP = 0.7  # of an island's work that is left after each map, by and large


@dataclass(frozen=True, eq=False)
class SeamState:
    """How far the search for seams is."""

    done: float
    """The share that is done, from 0 to 1."""
    seams: np.ndarray = field(repr=False)
    """(e,) bool, those found so far, and those that stay."""
    energy: float
    """The mean energy of the charts that have a map so far, at one scale; 1 is isometric, NaN if there is none."""


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
class SeamResult:
    """The seams of a mesh."""

    seams: np.ndarray = field(repr=False)
    """(e,) bool, the new ones, and those that stay."""
    charts: list[ChartSeams] = field(repr=False)
    energy: float
    """The mean energy of all charts that have a map, weighted by their areas at one scale; NaN if there is none."""
    length: float
    """Of the seams between two selected faces, each edge once, by the root of these faces' area."""


def cut_open(polygons: Polygons, settings: SeamSettings | None = None, wishes: Wishes | None = None) -> SeamResult:
    """The seams that a mesh needs for each piece to be a disk, maybe with holes: nothing is unwrapped.

    A piece with handles gets the loops that cut them, a closed one a path between two far vertices.  What cannot be
    opened has its error among the `charts`.  Raises `ShapeError` where the wishes do not fit the mesh.
    """
    (result,) = (each for each in _search(polygons, settings, wishes, None, None, False) if isinstance(each, SeamResult))
    return result


def cut_to(
    polygons: Polygons,
    settings: SeamSettings | None = None,
    wishes: Wishes | None = None,
    unwrap_settings: Settings | None = None,
    triangulate: Triangulator | None = None,
) -> Generator[SeamState, None, SeamResult]:
    """Cut a mesh until every piece of it unwraps with a distortion of `settings.distortion` or less.

    A generator: yields a `SeamState` now and then, returns the `SeamResult`, and can be closed at any time.  What
    becomes of one island does not depend on the others.

    Parameters
    ----------
    polygons : Polygons, its seams stay if `settings.keep`
    settings : SeamSettings
    wishes : Wishes, where seams are welcome
    unwrap_settings : Settings, those that the mesh is to be unwrapped with
    triangulate : as in `unwrap`

    Raises `ShapeError` where the wishes do not fit the mesh, `SettingsError` where settings exclude each other.
    """
    for each in _search(polygons, settings, wishes, unwrap_settings, triangulate, True):
        if isinstance(each, SeamResult):
            return each
        yield each
    raise AssertionError


def _search(polygons, settings, wishes, unwrap_settings, triangulate, unwrapping):
    """Yields states, and the result at last."""
    settings, wishes = settings or SeamSettings(), wishes or Wishes()
    wishes.check(len(polygons.vertices), len(polygons.seam))
    if not settings.keep:
        polygons = polygons.with_seams(np.zeros(len(polygons.seam), bool))
    if settings.charts > 1:
        polygons = polygons.with_seams(polygons.seam | _splits(polygons, settings, wishes))
    islands = polygons.islands()
    searches = [
        _Search(each, polygons, settings, wishes, unwrapping) for each in cuttables(polygons, islands)
    ]
    seam = polygons.seam | _one_sided(polygons, islands)

    def found():
        seams = seam.copy()
        for each in searches:
            seams[each.seams] = True
        return seams

    sizes = np.array([len(island.triangles) for island in islands], dtype=float)
    share = sizes / max(sizes.sum(), 1)

    def state():
        done = float(sum(part * each.done for part, each in zip(share, searches, strict=True)))
        return SeamState(done, found(), _mean(searches))

    while going := [each for each in searches if not each.ended]:
        for each in going:
            while each.grow():
                yield state()
        waiting = [each for each in going if not each.ended]
        steps = unwrap_islands([each.shape for each in waiting], unwrap_settings, triangulate)
        while True:
            try:
                next(steps)
            except StopIteration as stop:
                results = stop.value
                break
            yield state()
        for each, result in zip(waiting, results, strict=True):
            each.take(result)
        if waiting:
            yield state()
    yield _result(polygons, islands, searches, found())


def _result(polygons, islands, searches, seams):
    charts = [each.chart(island.faces, polygons) for island, each in zip(islands, searches, strict=True)]
    uses = np.bincount(polygons.corner_edge[_chosen_corners(polygons)], minlength=len(seams))
    area = sum(each.area for each in searches)
    length = polygons.lengths[seams & (uses > 1)].sum()
    return SeamResult(seams, charts, _mean(searches), float(length / np.sqrt(area)) if area > 0 else 0.0)


def _mean(searches):
    """The mean energy of what has a map, by area."""
    known = [each for each in searches if each.energy == each.energy]
    area = sum(each.area for each in known)
    return float(sum(each.area * each.energy for each in known) / area) if area > 0 else float("nan")


def _chosen_corners(polygons):
    sizes = np.diff(polygons.face_start, append=len(polygons.corner_vertex))
    return np.repeat(polygons.selected, sizes)


def _one_sided(polygons, islands):
    """The edges (e,) bool at which one-sided islands are cut, so that they are cut there again."""
    found = np.zeros(len(polygons.seam), bool)
    if any(island.one_sided_edges for island in islands):
        uses = np.bincount(polygons.corner_edge[_chosen_corners(polygons)], minlength=len(found))
        for island in islands:
            if island.one_sided_edges:
                found |= _cut_within(polygons, island) & (uses == 2) & ~polygons.seam
    return found


def _cut_within(polygons, island):
    """The edges (e,) bool that are twice on the boundary of an island."""
    try:
        mesh = Cuttable(polygons, island)
    except UnwrapError:
        return np.zeros(len(polygons.seam), bool)
    edge = mesh.mesh_edge[~mesh.is_whole]
    return np.bincount(edge[edge >= 0], minlength=len(polygons.seam)) == 2


def _splits(polygons, settings, wishes):
    """The edges (e,) bool at which pieces are split into charts."""
    found = np.zeros(len(polygons.seam), bool)
    for mesh in cuttables(polygons, polygons.islands()):
        if isinstance(mesh, Cuttable):
            sharp = np.abs(mesh.dihedral) >= np.deg2rad(settings.split_angle)
            if wishes.marked is not None:
                sharp |= mesh.of_mesh(np.asarray(wishes.marked, dtype=float)) >= 1
            split = splitting(mesh, edge_costs(mesh, settings, wishes), sharp & mesh.inner, settings.charts)
            found[mesh.mesh_edge[split]] = True
    return found


class _Search:
    """The search for the seams of one island.

    Attributes
    ----------
    ended : there is nothing left to do
    done : the share that is done, from 0 to 1
    seams : the mesh's edges that are to be cut, as far as is known
    energy : that of the map of these, NaN if there is none
    area : of the island, in the mesh's unit
    """

    def __init__(self, mesh, polygons, settings, wishes, unwrapping):
        self._mesh, self._goal = mesh, settings.distortion - 1
        self._error, self._result, self._growth = None, None, None
        self._warnings = ()
        self.energy, self.done, self.area = float("nan"), 0.0, 0.0
        self._maps, self._cuts, self._trims, self._aim = 0, 0, 0, self._goal
        self._best = self._least = None  # (state, energy, result) of the last good map, and of that of least energy
        self.ended = True
        if isinstance(mesh, Exception):
            self._error = mesh
            return
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
        if mirror is not None and not self._is_symmetric(cut, mirror):
            mirror = None
            self._warnings += ("it cannot be opened symmetrically: its seams are not",)
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

    @staticmethod
    def _is_symmetric(cut, mirror):
        return np.array_equal(cut, cut[mirror.edge])

    @property
    def seams(self) -> np.ndarray:
        if self._growth is None:
            return np.zeros(0, int)
        return self._mesh.mesh_edge[self._growth.cut]

    @property
    def shape(self) -> Shape:
        """What is to be unwrapped."""
        opened = self._mesh.opened(self._growth.cut)
        return Shape(self._mesh.points[opened.origin], opened.triangles)

    def grow(self) -> bool:
        """Go one step towards the next map; returns whether there was any."""
        growth = self._growth
        if self._best is not None or self._cuts >= _CUTS or growth.excess <= self._aim:
            self._cuts = 0
            return False
        self._cuts += 1
        if growth.grow() and growth.excess > self._aim and self._cuts < _CUTS:
            return True
        growth.shorten()
        self._cuts = _CUTS
        return True

    def take(self, result: Result | UnwrapError) -> None:
        """Go on after a map, or end."""
        self._maps += 1
        self.done = 1 - _ONE_MAP**self._maps
        growth, failed = self._growth, isinstance(result, UnwrapError)
        energy = float("inf") if failed else result.report.after.symmetric_dirichlet
        certified = not failed and result.report.injective
        if not failed:
            growth.learn(densities(result.report.after))
            self.energy = energy
        found = growth.state, energy, result
        if self._least is None or (not certified, energy) < (self._is_worse(self._least), self._least[1]):
            self._least = found
        if certified and energy - 1 <= self._goal:
            self._best = found
            if energy - 1 > _CLOSE * self._goal or not self._drawn_back(_AIM * self._goal):
                self._end()
        elif self._best is not None:
            # Too much was drawn back: half of it may be right.
            growth.restore(self._best[0])
            if not self._drawn_back((growth.excess + _AIM * self._goal) / 2):
                self._end()
        elif self._maps >= _MAPS:
            self._end()
        else:
            self._aim *= _HARDER

    @staticmethod
    def _is_worse(found):
        return isinstance(found[2], UnwrapError) or not found[2].report.injective

    def _drawn_back(self, most):
        """Whether some ends of the cut can be drawn back for one more map."""
        self._trims += 1
        before = self._growth.cut
        if self._trims <= _TRIMS:
            self._growth.trim(most)
        return not np.array_equal(before, self._growth.cut)

    def _end(self):
        state, self.energy, result = self._best or self._least
        self._growth.restore(state)
        self._result = result
        if isinstance(result, UnwrapError):
            self._error, self._result, self.energy = result, None, float("nan")
        elif self._best is None:
            self._warnings += (
                f"its distortion stays at {self.energy:.4g}: cuts do not lower it any further"
                if result.report.injective
                else "no map without flips and overlaps was found",
            )
        self.ended, self.done = True, 1.0

    def chart(self, faces: np.ndarray, polygons: Polygons) -> ChartSeams:
        result = self._result
        length = polygons.lengths[self.seams].sum()
        certified = result is not None and result.report.injective
        warnings = self._warnings + (result.report.warnings if result is not None else ())
        return ChartSeams(faces, self.energy, float(length), certified, self._error, warnings, result)
