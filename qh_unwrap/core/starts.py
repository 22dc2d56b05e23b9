# SPDX-License-Identifier: GPL-3.0-or-later
"""Which map to begin with."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .boundary import held_outlines
from .certificate import certified_pieces, wrong_pieces
from .chart import Surface
from .domain import Fixed, Held
from .energy import ISOMETRIC, energies
from .flattening import Flattening, conformal
from .initial import fit, led, project, weighted_map
from .loops import followers
from .rings import ring_map
from .settings import Settings
from .stepping import PART
from .strips import strip_outlines
from .triangles import corners_of, signed_areas
from .unfolding import unfolded

# The starts to choose from, the cheapest or best first, and the energy that needs no further one
_CANDIDATES = {
    "PROJECTION": 1 + 1e-3,
    "CONFORMAL": 2,
    "OPENED": 2,
    "STRIP": 2,
    "SHADOW": 2,
    "MEAN_VALUE": 1e6,
    "RINGS": np.inf,
}
# A surface bulges if its outline is so short: then neither its projection nor its conformal map is any good.
_BULGING = 0.45  # of the squared outline, relative to that of a disk of the surface's area
_FLAT = 0.95  # of a surface's area, that its largest shadow has, if its projection is to be nearly isometric
_TRACE = 1e-4  # of a surface's area, that flipped triangles may have for it to be as good as valid


def natural_start(surface: Surface, settings: Settings, initial: str) -> np.ndarray:
    """The map `initial` (n, 2) of every piece as it is, or within a circle where it needs a boundary."""
    if initial == "CONFORMAL":
        return conformal(surface)
    if initial == "PROJECTION":
        return project(surface)
    n = len(surface.vertices)
    nothing = np.zeros(surface.piece_count, bool)
    circle = replace(settings, boundary="CIRCLE", weights="COTANGENT")
    _, values, _, faults = held_outlines(surface, circle, np.zeros((n, 2)), nothing, np.zeros((n, 2), bool))
    for fault in faults.values():
        raise fault
    return _within_outlines(surface, values, initial)


def _within_outlines(surface, values, initial):
    """The map `initial` (n, 2) with the pieces' outlines where `values` (n, 2) has them."""
    held = np.zeros(values.shape, bool)
    held[np.concatenate(surface.outlines)] = True
    domain = Held(surface, Fixed(held, values), surface.plugs(solid=True))
    return _weighted_or_ring_map(domain, initial)[: len(values)]


def _weighted_or_ring_map(domain, initial):
    return ring_map(domain) if initial == "RINGS" else weighted_map(domain, initial)


def _largest_shadows(surface):
    """The area of every piece's largest shadow on a plane, less what lies there face down, (p,): the loops tell it."""
    start, end = surface.vertices[np.concatenate(surface.loops)], surface.vertices[followers(surface.loops)]
    piece = np.repeat(surface.loop_piece, [len(loop) for loop in surface.loops])
    sums = [np.bincount(piece, along, surface.piece_count) for along in np.cross(start, end).T]
    return np.linalg.norm(sums, axis=0) / 2


class _Candidates:
    """The natural maps of a surface's pieces, of which some suit only some of them."""

    def __init__(self, surface: Surface, settings: Settings):
        self._surface, self._settings = surface, settings
        self._bulging = surface.outline_lengths**2 < _BULGING * 4 * np.pi
        self._flat = _largest_shadows(surface) > _FLAT
        self.crossing = np.zeros(surface.piece_count, bool)
        """(p,), the pieces whose conformal maps would be good if they did not cross themselves"""

    def suited(self, initial: str, pieces: np.ndarray) -> np.ndarray:
        """For which of the chosen `pieces` (p,) bool a map of that kind is worth trying, (p,) bool."""
        if initial == "PROJECTION":
            return pieces & self._flat
        if initial == "SHADOW":  # as good as another where these fail
            return pieces & ~self._flat & ~self._bulging
        if initial == "CONFORMAL":
            return pieces & ~self._bulging
        if initial == "OPENED":
            return pieces & self.crossing
        if initial == "STRIP":
            found, self._straight = strip_outlines(self._surface, pieces)
            return found
        return pieces

    def map(self, initial: str, pieces: np.ndarray, part: Surface) -> np.ndarray:
        """The map (n', 2) of the `part` of the surface that consists of the chosen `pieces` (p,) bool."""
        rows = pieces[self._surface.vertex_piece]
        if initial == "CONFORMAL":
            self._flattening, self._flat_pieces, self._flat_rows = Flattening(part), pieces, rows
            return self._flattening.map()
        if initial == "OPENED":
            return self._flattening.opened(pieces[self._flat_pieces])[rows[self._flat_rows]]
        if initial == "STRIP":
            return _within_outlines(part, self._straight[rows], "MEAN_VALUE")
        return natural_start(part, self._settings, "PROJECTION" if initial == "SHADOW" else initial)


class Start(NamedTuple):
    """A map to begin with."""

    uv: np.ndarray
    """(n, 2)"""
    certified: np.ndarray
    """(p,) bool, the pieces for which it is certified,"""
    in_square: np.ndarray
    """and those of them for which it is so in the unit square"""
    crossing: np.ndarray
    """(p,) bool, the pieces that would cross themselves on the way if nothing kept them from it"""


def best_start(surface: Surface, settings: Settings) -> Generator[str, None, Start]:
    """Of the certified natural maps of every piece a good one, or that of least energy; of all, if none is certified.

    Yields `PART` now and then.
    """
    start, least = np.zeros((len(surface.vertices), 2)), np.full(surface.piece_count, np.inf)
    certified, in_square, undecided = (np.full(surface.piece_count, value) for value in (False, False, True))
    untried, candidates = undecided.copy(), _Candidates(surface, settings)
    for initial, enough in _CANDIDATES.items():
        trying = candidates.suited(initial, undecided)
        if not trying.any():
            continue
        pieces = np.flatnonzero(trying)
        part = surface if trying.all() else surface.of(trying)
        if initial == "CONFORMAL":
            yield PART
            part.order  # noqa: B018 (it is kept)
            yield PART
        uv = candidates.map(initial, trying, part)
        uv, _ = unfolded(part, uv, np.zeros((len(part.vertices), 2), bool), _TRACE)
        value = energies(part, uv, settings.balance)
        # What could be better is worth the certificate.
        promising = (value < least[pieces]) | ~certified[pieces]
        if initial == "OPENED":  # else it leads nowhere good
            promising &= value < enough
        sure = square = promising
        if promising.any():
            # In the unit square it must be certified in the end.  But in maps that are to stay cuts are closed, and
            # their sides may well lie on each other there: rounding is another elsewhere.
            sure = square = promising & certified_pieces(part, part.in_unit_square(uv))
            closed = promising & ~square & (value <= ISOMETRIC)
            if closed.any():
                sure = square | (closed & certified_pieces(part, uv))
        if initial == "CONFORMAL":
            candidates.crossing[pieces] = promising & ~sure & (value < enough)
        better = np.where(sure == certified[pieces], value < least[pieces], sure)
        better |= untried[pieces]
        untried &= ~trying
        taken = pieces[better]
        least[taken], certified[taken], in_square[taken] = value[better], sure[better], square[better]
        its = better[part.vertex_piece]
        start[np.flatnonzero(trying[surface.vertex_piece])[its]] = uv[its]
        undecided &= ~(certified & (least < enough))
        if not undecided.any():
            break
    return Start(start, certified, in_square, candidates.crossing)


def with_pins(surface: Surface, start: np.ndarray, uv: np.ndarray, pinned: np.ndarray) -> np.ndarray:
    """The map `start` (n, 2) moved, turned and scaled so that the pins lie as near as can be to where `uv` has them,
    and then put there, and the rest with them.

    pinned  (n, 2) bool, for U and V
    """
    result = start.copy()
    ends = np.append(surface.vertex_starts, len(uv))
    some = pinned.any(axis=1)
    for k in np.unique(surface.vertex_piece[some]):
        its = slice(ends[k], ends[k + 1])
        chosen = some[its]
        if (uv[its][chosen] == uv[its][chosen][0]).all():  # one place tells neither size nor turn
            fitted = fit(start[its], np.ones(len(chosen), bool), uv[its])
            triangles = surface.triangles[surface.piece == k] - ends[k]
            area, old = (float(np.abs(signed_areas(corners_of(each, triangles))).sum()) for each in (fitted, uv[its]))
            if area > 0 and old > 0:
                fitted *= np.sqrt(old / area)
            fitted += (uv[its] - fitted)[chosen].mean(axis=0)
        else:
            fitted = fit(start[its], chosen, uv[its])
        result[its] = led(fitted, pinned[its], uv[its])
    return result


def before_pins(surface: Surface, uv: np.ndarray, pinned: np.ndarray) -> np.ndarray:
    """The map `uv` (n, 2), of which only the pins were moved, with these back among their neighbours.

    pinned  (n, 2) bool, for U and V
    """
    return weighted_map(Held(surface, Fixed(~pinned, uv)), "MEAN_VALUE")


def start_within(
    domain: Held, settings: Settings, uv: np.ndarray, has_uv: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """The initial map (n, 2) of a domain whose outlines are held, with what is held in its place.

    uv      (n', 2), the island's, of the pieces that have some, (p,) bool in `has_uv`
    values  (n', 2), where the held ones are
    """
    surface, initial = domain.island, settings.initial
    current = np.full(surface.piece_count, initial == "CURRENT")
    if initial == "AUTO":
        initial = "MEAN_VALUE"
        if settings.boundary == "KEEP":
            current = has_uv & ~wrong_pieces([surface], uv)
    if initial in ("CURRENT", "PROJECTION", "CONFORMAL"):
        start = uv if initial == "CURRENT" else natural_start(surface, settings, initial)
        held = domain.constrained.held[: len(uv)]
        start = domain.start(_fitted(surface, start, held, values))
    else:
        # Holes are closed meanwhile, so that nothing folds over them.
        fixed = Fixed(domain.constrained.held[: len(uv)], values)
        solid = domain if domain.is_solid else Held(surface, fixed, surface.plugs(solid=True))
        start = _weighted_or_ring_map(solid, initial)
        if settings.initial == "AUTO":
            collapsed = wrong_pieces([surface], start[: len(uv)])
            if collapsed.any():
                start = np.where(collapsed[domain.vertex_piece][:, None], ring_map(solid), start)
    if current.any() and initial != "CURRENT":
        start = np.where(current[domain.vertex_piece][:, None], domain.start(uv), start)
    return start


def _fitted(surface, uv, held, values):
    """Every piece's map brought by a similarity, maybe mirrored, near to where what is held is, and that put there."""
    result = np.empty_like(uv)
    ends = np.append(surface.vertex_starts, len(uv))
    for first, end in pairwise(ends):
        its = slice(first, end)
        fitted = fit(uv[its], held[its].all(axis=1), values[its], mirror=True)
        result[its] = np.where(held[its], values[its], fitted)
    return result
