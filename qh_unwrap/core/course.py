# SPDX-License-Identifier: GPL-3.0-or-later
"""The way of a batch from its first map to its best: start, iterations, refinement, in their order and alone.

The pieces go together, and every step costs hardly more than that of one; but each takes its own way, and ends where it
would have ended alone.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

import numpy as np

from .air import Air, Triangulator
from .batch import Batch
from .boundary import held_outlines
from .certificate import certified_pieces, orientation, wrong_pieces
from .chart import Surface
from .descent import newton_step
from .domain import Domain, Fixed, Plane, airs_around, loose, outlined, rigid
from .energy import energies, map_scale
from .errors import UnwrapError
from .quasi_harmonic import Iteration
from .settings import Settings
from .starts import best_start, natural_start, start_within, with_pins
from .weights import scheme

_HANDOVER = 0.9  # an iteration that lowers the energy by less, relative to it, gives way to the refinement
_ISOMETRIC = 1 + 1e-6  # the energy of a map that nothing could better visibly
_NEAR = 1.2  # the energy of a start from which the refinement alone soon arrives
_IN_AIR = 2000  # triangles of the pieces that are improved together with air around them
_LEADS = 12  # times that pins are moved on, before their island begins anew
_HALVINGS = 8  # of their way, each of these times
_FEW = 0.5  # once only this part of the vertices still moves, the others take part no longer

Steps = Generator[None, None, None]


D = TypeVar("D", bound=Domain)


@dataclass(eq=False)
class _Group(Generic[D]):
    """Some pieces of the batch on their way."""

    domain: D
    uv: np.ndarray  # (n, 2), the domain's map
    pieces: np.ndarray  # (p',), their numbers in the batch
    rows: np.ndarray  # (n',), their islands' vertices in the batch

    @property
    def island_uv(self) -> np.ndarray:
        return self.uv[: len(self.rows)]

    def of(self, chosen: np.ndarray) -> _Group:
        """The chosen pieces (p',) bool alone."""
        if chosen.all():
            return self
        domain, uv = self.domain.of(chosen, self.uv)
        rows = self.rows[chosen[self.domain.island.vertex_piece]]
        return _Group(domain, uv, self.pieces[chosen], rows)

    def shares(self, pieces: np.ndarray) -> float:
        """How much of the vertices belong to the chosen pieces (p',) bool."""
        return pieces[self.domain.vertex_piece].mean()

    def moved(self, after: np.ndarray, going: np.ndarray) -> None:
        """Take the map `after` in the pieces that are `going` (p',) bool."""
        self.uv = after if going.all() else np.where(going[self.domain.vertex_piece, None], after, self.uv)


class Course:
    """The maps of a batch on their way.

    Attributes, all for the batch's pieces or vertices
    ----------
    start, now, best : (n, 2), the initial map, the latest and the best so far
    changes : list of lists, for every step of a piece the largest movement of a vertex by the layout's diameter
    valid : (p,) bool, in the latest map nothing is flipped, air included
    converged : (p,) bool, another step would change nothing, or would not pay
    repaired : (p,) bool, weights had to be changed to turn flipped triangles back
    warnings : list of tuples
    faults : dictionary from pieces to the errors for which they have no map
    """

    def __init__(self, batch: Batch, settings: Settings, triangulate: Triangulator):
        self.batch, self.settings, self._triangulate = batch, settings, triangulate
        n, p = len(batch.uv), batch.surface.piece_count
        self.start, self.now, self.best = (np.zeros((n, 2)) for _ in range(3))
        self.changes: list[list[float]] = [[] for _ in range(p)]
        self.valid, self.converged, self.repaired = (np.zeros(p, bool) for _ in range(3))
        self.warnings: list[tuple[str, ...]] = [()] * p
        self.faults: dict[int, UnwrapError] = {}
        self._live: _Group | None = None  # what moves at the moment, if that is the whole batch

    @property
    def refining(self) -> bool:
        return self.settings.refine > 0 and self.settings.weights == "COTANGENT"

    def placed(self, uv: np.ndarray, pieces: np.ndarray | None = None, surface: Surface | None = None) -> np.ndarray:
        """Where the map `uv` (n', 2) of the chosen pieces is put in the end, (n', 2): each into the unit square, unless
        something holds it where it is.
        """
        surface = surface or self.batch.surface
        if self.settings.boundary != "FREE":
            return uv
        low, size = surface.boxes(uv)
        size = size.max(axis=1, keepdims=True)
        size[size == 0] = 1
        in_frame = self.batch.in_frame(self.settings)
        in_frame = in_frame if pieces is None else in_frame[pieces]
        low[in_frame], size[in_frame] = 0, 1
        if surface.piece_count == 1:
            return uv if in_frame[0] else (uv - low[0]) / size[0]
        return (uv - low[surface.vertex_piece]) / size[surface.vertex_piece]

    def run(self) -> Steps:
        """Take all steps; yields after the start and after each."""
        self.faults.clear()
        self.warnings = [()] * self.batch.surface.piece_count
        if self.settings.boundary == "FREE":
            yield from self._free()
        else:
            yield from self._outlined()

    def resume(self, settings: Settings) -> Steps:
        """Go on from the maps as they are with other settings, or with what the batch now fixes."""
        before, self.settings = self.settings, settings
        names = ("boundary", "aspect", "fill_holes")
        if any(getattr(before, name) != getattr(settings, name) for name in names):
            self._live = None
            yield from self.run()
            return
        self.converged[:] = False
        live, self._live = self._live, None
        if settings.boundary != "FREE":
            yield from self._outlined(self.best)
        elif (self.batch.has_pins | self.batch.has_partners).any():
            yield from self._led(live)
        elif live is not None:
            live.uv, _ = live.domain.recalled(live.uv, self.best, np.ones(len(live.pieces), bool))
            yield from self._improve(live)
        else:
            yield from self._freely(self.best.copy(), directly=True)

    # Starts

    def _begin(self, start):
        self.start[:] = self.now[:] = self.best[:] = start
        self.valid[:] = ~wrong_pieces([self.batch.surface], start)

    def _outlined(self, current: np.ndarray | None = None) -> Steps:
        """With outlines that are held; from the `current` map or an initial one."""
        batch, settings = self.batch, self.settings
        held, values, warnings, faults = held_outlines(batch.surface, settings, batch.uv, batch.has_uv, batch.pinned)
        self.faults.update(faults)
        self.warnings = warnings
        good = np.array([k not in faults for k in range(batch.surface.piece_count)])
        if not good.any():
            return

        fixed = Fixed(held, values, batch.partner)
        group = self._group(good, self.now, lambda surface, _uv, fixed: outlined(surface, settings, fixed), fixed)
        rows = group.rows
        if current is None:
            given = batch.uv[rows], batch.has_uv[group.pieces], values[rows]
            start = start_within(group.domain, settings, *given)
            self.start[rows] = self.now[rows] = self.best[rows] = start[: len(rows)]
        else:
            start = group.domain.start(np.where(held, values, current)[rows])
        group.uv = start
        yield from self._improve(group)

    def _free(self) -> Steps:
        """With outlines that are free."""
        batch, settings = self.batch, self.settings
        surface = batch.surface
        held = batch.has_pins
        start, certified = batch.uv, None
        if settings.initial == "AUTO":
            new = ~(held & ~wrong_pieces([surface], batch.uv))
            if new.any():
                start = batch.uv.copy()
                start[batch.rows(new)], known = best_start(surface if new.all() else surface.of(new), settings)
                certified = np.zeros(surface.piece_count, bool)
                certified[new] = known
        elif settings.initial != "CURRENT":
            start = natural_start(surface, settings, settings.initial)
        if held.any():
            start = with_pins(surface, start, batch.uv, batch.pinned)
            certified = None
        self._begin(start)
        yield from self._freely(start, settings.initial == "AUTO" or not settings.iterations, certified)

    def _freely(self, start: np.ndarray, directly: bool, certified: np.ndarray | None = None) -> Steps:
        """Improve free maps; if `directly`, without iterations and air where the refinement soon arrives.

        It may be known for which pieces (p,) the start is `certified`.
        """
        batch, settings = self.batch, self.settings
        surface, p = batch.surface, batch.surface.piece_count
        if not self.refining and not settings.iterations:
            yield
            return
        near = done = np.zeros(p, bool)
        if self.refining:
            value = energies(surface, start, settings.balance)
            if (value < _NEAR).any():
                certified = certified_pieces(surface, start) if certified is None else certified
                done = certified & (value <= _ISOMETRIC)
                near = certified & (value < _NEAR) & ~done & ~(batch.has_pins | batch.has_partners) & directly
        self.converged |= done
        if (done | near).any():
            yield
        if near.any():
            yield from self._refine(self._group(near, start, loose))
            part = surface if near.all() else surface.of(near)
            certain = np.zeros(p, bool)
            certain[near] = certified_pieces(part, self.placed(self.best[batch.rows(near)], near, part))
            # An outline that has come to cross itself needs air around it from the start.
            again = near & ~certain
            if again.any():
                rows = batch.rows(again)
                self.best[rows] = self.now[rows] = start[rows]
                self.converged &= ~again
                near = certain
                for k in np.flatnonzero(again):
                    self.changes[k] = []
        far = ~(done | near)
        if far.any():
            yield from self._in_air(far, start.copy())

    def _in_air(self, pieces: np.ndarray, start: np.ndarray) -> Steps:
        """Improve the maps of the chosen pieces with air around them, or with their outlines as they are."""
        batch = self.batch
        airs: dict[int, Air] = {}
        missing = pieces.copy()
        self._make_airs(missing, start, airs)
        # A valid map that pins hold stays, whether or not there is room for air; any other gives way to a circle.
        crossed = missing & ~(batch.has_pins & ~wrong_pieces([batch.surface], start))
        if crossed.any():
            part, rows = batch.surface.of(crossed), batch.rows(crossed)
            circle = natural_start(part, self.settings, "MEAN_VALUE")
            start[rows] = with_pins(part, circle, batch.uv[rows], batch.pinned[rows])
            self.start[rows] = self.now[rows] = self.best[rows] = start[rows]
            for k in np.flatnonzero(crossed):
                self.warnings[k] += ("the start overlaps itself: begun with a circle",)
            still = crossed.copy()
            self._make_airs(still, start, airs)
            missing &= ~crossed | still
        for within in self._portions(pieces & ~missing):
            its = [airs[k] for k in np.flatnonzero(within)]
            yield from self._improve(
                self._group(within, start, partial(Plane, airs=its, triangulate=self._triangulate))
            )
        if missing.any():
            for k in np.flatnonzero(missing):
                text = "the outline stays as it is: there is no room to free it"
                if crossed[k] and batch.has_pins[k]:
                    text = "the pins make the outline cross itself: unpin some, or move them"
                self.warnings[k] = (text,)
            yield from self._improve(self._group(missing, start, rigid))

    def _portions(self, pieces: np.ndarray) -> list[np.ndarray]:
        """The chosen pieces (p,) bool, a few at a time: new air around one makes new equations for all of them."""
        chosen = np.flatnonzero(pieces)
        sizes = np.bincount(self.batch.surface.piece, minlength=len(pieces))[chosen]
        portion = (np.cumsum(sizes) - sizes) // _IN_AIR
        return [np.isin(np.arange(len(pieces)), chosen[portion == k]) for k in np.unique(portion)]

    def _make_airs(self, missing: np.ndarray, start: np.ndarray, airs: dict[int, Air]) -> None:
        """Add the air of the pieces that miss it, (p,) bool, and tick these off where it can be made."""
        for k, air in enumerate(airs_around(self.batch.surface, start, self._triangulate, missing)):
            if air is not None:
                airs[k] = air
                missing[k] = False

    def _group(
        self,
        pieces: np.ndarray,
        uv: np.ndarray,
        make: Callable[[Surface, np.ndarray, Fixed], D],
        fixed: Fixed | None = None,
    ) -> _Group[D]:
        """The chosen pieces, (p,) bool, with the map `uv` (n, 2) of the batch in a domain of their own."""
        batch, fixed = self.batch, fixed or self.batch.fixed
        surface, rows = batch.surface, np.arange(len(uv))
        if not pieces.all():
            number = surface.numbering(pieces)
            surface = surface.of(pieces, number)
            chosen = batch.rows(pieces)
            rows, uv, fixed = np.flatnonzero(chosen), uv[chosen], fixed.of(chosen, number)
        domain = make(surface, uv, fixed)
        return _Group(domain, domain.start(uv), np.flatnonzero(pieces), rows)

    # Pins that moved

    def _led(self, group: _Group | None) -> Steps:
        """Lead the maps after pins that moved, and improve them; from the live `group`, or from the best maps."""
        batch, best = self.batch, self.best.copy()
        everything = np.ones(batch.surface.piece_count, bool)
        if group is None or not isinstance(group.domain, Plane):
            airs = [air for air in airs_around(batch.surface, best, self._triangulate) if air is not None]
            if len(airs) < len(everything):
                yield from self._in_air(everything, with_pins(batch.surface, best, batch.uv, batch.pinned))
                return
            group = self._group(everything, best, partial(Plane, airs=airs, triangulate=self._triangulate))
        else:
            group.uv, _ = group.domain.recalled(group.uv, best, everything)
            group.domain.fix(batch.fixed, group.uv)
        for _ in range(_LEADS):
            arrived = self._lead(group)
            if arrived.all():
                break
            group.uv = group.domain.renewed(group.uv)
        else:
            # What cannot be led there begins anew.
            start = best.copy()
            yield from self._in_air(everything, with_pins(batch.surface, start, batch.uv, batch.pinned))
            return
        self.best[group.rows] = group.island_uv
        if self.refining:
            yield from self._refine(group)
        else:
            yield from self._improve(group)

    def _lead(self, group: _Group) -> np.ndarray:
        """Move what is held nearer to where it is to be, and the rest with it, as far as nothing flips.

        Returns which pieces have arrived, (p',) bool.  What is in between follows by the equations of an iteration.
        """
        domain, uv = group.domain, group.uv
        constrained, piece = domain.constrained, domain.vertex_piece
        way = np.where(constrained.held, constrained.values - uv, 0)
        weights = domain.weights(scheme(self.settings)(domain.charts, uv), uv)
        way = constrained.factor(weights)(way)
        part = np.ones(len(group.pieces))
        for _ in range(_HALVINGS):
            led = uv + part[piece, None] * way
            led = np.where(constrained.held & (part[piece, None] == 1), constrained.values, led)
            wrong = wrong_pieces(domain.charts, led)
            if not wrong.any():
                break
            part[wrong] /= 2
        else:
            led = np.where(wrong[piece, None], uv, led)
        group.uv = led
        return part == 1

    # Iterations and refinement

    def _improve(self, group: _Group) -> Steps:
        """Iterate, and refine what has done with that."""
        settings = self.settings
        iteration = Iteration(group.domain, settings)
        p = len(group.pieces)
        best, least, found = group.island_uv.copy(), np.full(p, np.inf), np.zeros(p, bool)
        change, held_back = np.full(p, np.inf), np.zeros(p, bool)
        going = np.ones(p, bool)
        best_enough, stale = np.zeros(p, bool), np.zeros(p, bool)
        valid = ~wrong_pieces(group.domain.charts, group.uv)
        self._note(group, valid, iteration.repaired, None, going)
        number = 0
        while True:
            yield
            island = group.domain.island
            # Repairs and new air make the energy rise and fall: keep the best valid map from then on.
            uneven = iteration.repaired | self.refining | (settings.boundary == "FREE")
            fine = going & valid & ~wrong_pieces([island], self.placed(group.island_uv, group.pieces, island))
            value = np.where(fine, energies(island, group.island_uv, settings.balance), np.inf)
            isometric = fine & self.refining & (value <= _ISOMETRIC)
            enough = fine & self.refining & (number > 0) & (value > (1 - _HANDOVER) * least)
            better = fine & (~found | ~uneven | (value < least))
            best = np.where(better[island.vertex_piece, None], group.island_uv, best)
            least = np.where(better, np.where(uneven, value, np.inf), least)
            found |= better
            settled = (change <= settings.tolerance) & (not self.refining)  # else the energy tells
            best_enough |= isometric
            stale = np.where(going, found & uneven & ~better, stale)
            done = going & (isometric | enough | settled | (number >= settings.iterations))
            self.converged[group.pieces[done]] = (isometric | (settled & ~held_back))[done]
            going &= ~done
            if not going.any() or (iteration.divisible and group.shares(going) <= _FEW):
                ended = ~going
                recalled = stale[ended]
                yield from self._refine_best(
                    group.of(ended),
                    best[ended[island.vertex_piece]],
                    recalled,
                    (found | valid)[ended] & ~best_enough[ended],
                )
                if not going.any():
                    return
                best = best[going[island.vertex_piece]]
                least, found, change, held_back, valid, best_enough, stale = (
                    each[going] for each in (least, found, change, held_back, valid, best_enough, stale)
                )
                rest = _Group(group.domain, group.uv, group.pieces[going], group.rows[going[island.vertex_piece]])
                rest.uv = iteration.of(going, group.uv)
                rest.domain, group, going = iteration.domain, rest, np.ones(len(rest.pieces), bool)
            number += 1
            before, after, now_valid = iteration.step(group.uv)
            group.uv = before
            previous = group.island_uv.copy()
            group.moved(after, going)
            valid = np.where(going, now_valid, valid)
            held_back = np.where(going, iteration.shortened, held_back)
            change = np.where(going, _movement(group.domain.island, previous, group.island_uv), change)
            self._note(group, valid, iteration.repaired, change, going)

    def _refine_best(self, group, best, recalled, sound):
        """Refine the `best` maps (n', 2) of the group's pieces, which in those to be `recalled` (p',) bool are not the
        latest, and valid in those that are `sound` (p',) bool.
        """
        self.best[group.rows] = np.where(recalled[group.domain.island.vertex_piece, None], best, group.island_uv)
        if not self.refining:
            return
        if recalled.any():
            group.uv, failed = group.domain.recalled(group.uv, best, recalled)
            sound = sound & ~failed
        if sound.any():
            yield from self._refine(group.of(sound))

    def _refine(self, group: _Group) -> Steps:
        """Newton's steps, in every piece as long as they pay."""
        settings = self.settings
        size = map_scale(group.domain.island, group.island_uv)
        going = np.ones(len(group.pieces), bool)
        folded = _folded(group)
        for _ in range(settings.refine):
            domain = group.domain
            before, after, done = newton_step(domain, group.uv, settings.balance, size, going)
            if after is before:
                return
            group.uv = before
            previous = group.island_uv.copy()
            group.moved(after, going)
            island = domain.island
            fine = going & ~wrong_pieces([island], self.placed(group.island_uv, group.pieces, island))
            fine &= _folded(group) <= folded
            change = _movement(island, previous, group.island_uv)
            self._note(group, fine, self.repaired[group.pieces], change, going)
            rows = fine[island.vertex_piece]
            self.best[group.rows[rows]] = group.island_uv[rows]
            self.converged[group.pieces[fine]] = done[fine]
            going &= ~done
            yield
            if not going.any():
                return
            if group.shares(going) <= _FEW:
                group, size, folded = group.of(going), size[going], folded[going]
                going = np.ones(len(group.pieces), bool)

    def _note(self, group, valid, repaired, change, going):
        """Keep what the latest step has brought, for the pieces that are `going` (p',) bool."""
        pieces, rows = group.pieces[going], group.rows[going[group.domain.island.vertex_piece]]
        self.now[rows] = group.island_uv[going[group.domain.island.vertex_piece]]
        self.valid[pieces], self.repaired[pieces] = valid[going], repaired[going]
        if change is not None:
            for k, its in zip(pieces.tolist(), change[going].tolist(), strict=True):
                self.changes[k].append(its)
        self._live = group if len(group.pieces) == len(self.changes) else None


def _folded(group: _Group) -> np.ndarray:
    """How many of the faces without area lie folded in every piece, (p',)."""
    island = group.domain.island
    flat = island.degenerate
    if not flat.any():
        return np.zeros(island.piece_count, int)
    folded = orientation(group.island_uv, island.triangles[flat]) < 0
    return np.bincount(island.piece[flat], folded, island.piece_count)


def _movement(island: Surface, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The largest movement of a vertex of every piece by the diagonal of the box around it `after`, (p,)."""
    x, y = (after - before).T
    farthest = np.sqrt(np.maximum.reduceat(x * x + y * y, island.vertex_starts))
    diagonal = np.linalg.norm(island.boxes(after)[1], axis=1)
    return farthest / np.maximum(diagonal, np.finfo(float).tiny)
