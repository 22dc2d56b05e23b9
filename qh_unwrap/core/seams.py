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
from .edge_costs import Wishes, edge_costs
from .errors import UnwrapError
from .seam_settings import SeamSettings
from .searching import ChartSeams, Search
from .settings import Settings
from .splitting import splitting
from .unwrapping import unwrap_islands


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
class SeamResult:
    """The seams of a mesh."""

    seams: np.ndarray = field(repr=False)
    """(e,) bool, the new ones, and those that stay."""
    charts: list[ChartSeams] = field(repr=False)
    energy: float
    """The mean energy of all charts that have a map, weighted by their areas at one scale; NaN if there is none."""
    length: float
    """Of the seams between two selected faces, each edge once, by the root of these faces' area."""
    corner_uv: np.ndarray = field(repr=False)
    """(c, 2), the maps of the charts at the mesh's corners, each in its own unit square; NaN where there is none."""


def cut_open(polygons: Polygons, settings: SeamSettings | None = None, wishes: Wishes | None = None) -> SeamResult:
    """The seams that a mesh needs for each piece to be a disk, maybe with holes: nothing is unwrapped.

    A piece with handles gets the loops that cut them, a closed one a path between two far vertices.  What cannot be
    opened has its error among the `charts`.  Raises `ShapeError` where the wishes do not fit the mesh.
    """
    (result,) = (
        each for each in _search(polygons, settings, wishes, None, None, False) if isinstance(each, SeamResult)
    )
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
    polygons : Polygons, its seams stay
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
    if not polygons.selected.any():
        yield SeamResult(polygons.seam.copy(), [], float("nan"), 0.0, _nowhere(polygons))
        return
    if settings.charts > 1:
        polygons = polygons.with_seams(polygons.seam | _splits(polygons, settings, wishes))
    islands = polygons.islands()
    progress = _Progress(polygons.seam | _one_sided(polygons, islands), islands)
    searches = progress.searches
    for mesh in cuttables(polygons, islands):
        searches.append(Search(mesh, polygons, settings, wishes, unwrapping))
        yield progress.state(len(searches) - 1)

    while going := [k for k, each in enumerate(searches) if not each.ended]:
        for k in going:
            for _ in searches[k].grow():
                yield progress.state(k)
            progress.note(k)
        waiting = [k for k in going if not searches[k].ended]
        steps = unwrap_islands([searches[k].shape for k in waiting], unwrap_settings, triangulate)
        while True:
            try:
                next(steps)
            except StopIteration as stop:
                results = stop.value
                break
            yield progress.state()
        for k, result in zip(waiting, results, strict=True):
            for _ in searches[k].take(result):
                yield progress.state(k)
            yield progress.state(k)
    yield _result(polygons, islands, searches, progress.seams)


class _Progress:
    """How far the searches of all islands are, brought up to date for one of them at a time."""

    def __init__(self, seams, islands):
        self.seams, self.searches = seams, []
        sizes = np.array([len(island.triangles) for island in islands], dtype=float)
        self._share = sizes / max(sizes.sum(), 1)
        self._cut = [np.zeros(0, int)] * len(islands)
        self._done, self._area, self._energy = np.zeros((3, len(islands)))

    def note(self, k):
        """Take over what the search of island k has come to."""
        its = self.searches[k]
        self.seams[self._cut[k]] = False
        self._cut[k] = its.seams
        self.seams[self._cut[k]] = True
        self._done[k] = max(self._done[k], its.done)
        if its.energy == its.energy:
            self._area[k], self._energy[k] = its.area, its.energy

    def state(self, k=None):
        """The `SeamState` now, when nothing has changed but the search of island k."""
        if k is not None:
            self.note(k)
        area = self._area.sum()
        energy = float((self._area * self._energy).sum() / area) if area > 0 else float("nan")
        return SeamState(float((self._share * self._done).sum()), self.seams.copy(), energy)


def _result(polygons, islands, searches, seams):
    charts = [each.chart(island.faces, polygons) for island, each in zip(islands, searches, strict=True)]
    uses = np.bincount(polygons.corner_edge[_chosen_corners(polygons)], minlength=len(seams))
    area = sum(each.area for each in searches)
    length = polygons.lengths[seams & (uses > 1)].sum()
    corner_uv = _nowhere(polygons)
    for each in searches:
        each.put_map(corner_uv)
    length = float(length / np.sqrt(area)) if area > 0 else 0.0
    return SeamResult(seams, charts, _mean(searches), length, corner_uv)


def _nowhere(polygons):
    return np.full((len(polygons.corner_vertex), 2), np.nan)


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
