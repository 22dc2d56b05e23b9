# SPDX-License-Identifier: GPL-3.0-or-later
"""The way of a batch from its first map to its best: which start, which domain, what of iterations and refinement."""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial

import numpy as np

from .air import Air, Triangulator
from .batch import Batch
from .boundary import held_outlines
from .certificate import certified_pieces, wrong_pieces
from .chart import Surface
from .domain import Fixed, loose, outlined, rigid
from .energy import ISOMETRIC, energies
from .errors import SingularError
from .improvement import D, Group, Improvement, Steps
from .pins import lead, way_of
from .plane import Plane, airs_around
from .settings import Settings
from .starts import before_pins, best_start, natural_start, start_within, with_pins
from .stepping import PART, STEP
from .untangling import untangled

PINS_CROSS = "the pins make the outline cross itself: unpin some, or move them"
PINS_FLIP = "no map without flips was found with these pins: unpin some, or move them"
_NEAR = 3.5  # the energy of a start from which the refinement alone soon arrives,
_SMALL_NEAR = 200.0  # and in a piece with few triangles and no long outline: some steps more take less time than air
_FEW = 5000  # triangles
_BY_ANGLES = 0.5  # the balance above which conformal maps are nearer to the best than rigid triangles lead
_BY_AREAS = 0.25  # the balance below which iterations within an outline seldom lead to where the best map is
_LONG = 1.5  # the squared outline from which on it may well cross itself, relative to that of a disk of the same area
_IN_AIR = 5000  # vertices of the pieces that are improved together with air around them
_LEADS = 12  # times that pins are moved on, before their island begins anew
_PATIENCE = 30.0  # with maps that go on, so that they end no higher than those that begin anew


class Course(Improvement):
    """The maps of a batch from the start to the end.

    Parameters
    ----------
    batch : Batch
    settings : Settings
    triangulate : makes the air around islands whose outlines are free
    """

    def __init__(self, batch: Batch, settings: Settings, triangulate: Triangulator):
        super().__init__(batch, settings)
        self._triangulate = triangulate

    def run(self) -> Steps:
        """Take all steps; yields after the start and after each."""
        self.faults.clear()
        self.warnings = [()] * self.batch.surface.piece_count
        if self.settings.boundary == "FREE":
            yield from self._free()
        else:
            yield from self._outlined()
        self._keep_what_was_valid()

    def _keep_what_was_valid(self) -> None:
        """Where the map has flips and the given one has none, take that; but a start that is wanted as it is stays.

        What ends with flips and nothing else to say of it gets a word.
        """
        batch, settings = self.batch, self.settings
        if self.sure.all() or not (settings.repair and (settings.iterations or self.refining)):
            return
        surface = batch.surface
        flipped = wrong_pieces([surface], self.placed(self.best))
        if not flipped.any():
            return
        spoilt = flipped & batch.has_uv & ~wrong_pieces([surface], batch.uv)
        for k in np.flatnonzero(flipped & ~spoilt).tolist():
            if k not in self.faults and not self.warnings[k]:
                self.warnings[k] = (
                    PINS_FLIP if batch.has_pins[k] else "no map without flips was found: mark a seam along it",
                )
        for k in np.flatnonzero(spoilt).tolist():
            its = batch.rows_of(k)
            self.best[its] = self.now[its] = batch.uv[its]
            self.sure[k], self.valid[k] = False, True
            self.warnings[k] = ("its UVs stay as they were: no other map without flips was found",)

    def resume(self, settings: Settings) -> Steps:
        """Go on from the maps as they are with other settings, or with what the batch now fixes."""
        before, self.settings = self.settings, settings
        self.sure[:] = False
        names = ("boundary", "aspect", "fill_holes")
        if any(getattr(before, name) != getattr(settings, name) for name in names):
            self.live, self.patience = None, 1.0
            yield from self.run()
            return
        self.patience = 1.0 if settings == before else _PATIENCE
        self.converged[:] = False
        live, self.live = self.live, None
        if settings.boundary != "FREE":
            yield from self._outlined(self.best)
        elif (self.batch.has_pins | self.batch.has_partners).any():
            yield from self._after_pins(live)
        elif live is not None:
            live.uv, _ = live.domain.recalled(live.uv, self.best, np.ones(len(live.pieces), bool))
            yield from self.improve(live)
        else:
            everything = np.ones(self.batch.surface.piece_count, bool)
            yield from self._freely(self.best.copy(), everything, ~everything)

    # Starts

    def _begin(self, start):
        self.now[:] = self.best[:] = start
        self.valid[:] = ~wrong_pieces([self.batch.surface], start)

    def _outlined(self, current: np.ndarray | None = None) -> Steps:
        """With outlines that are held; from the `current` map or an initial one."""
        batch, settings = self.batch, self.settings
        surface, crossing = batch.surface, batch.crossing
        outlines = held_outlines(surface, settings, batch.uv, batch.has_uv, batch.pinned, crossing)
        held, values, warnings, faults = outlines
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
            self.now[rows] = self.best[rows] = start[: len(rows)]
        else:
            start = group.domain.start(np.where(held, values, current)[rows])
        group.uv = start
        if settings.repair and settings.initial == "AUTO":
            yield from self._untangled(group)
        yield from self.improve(group)

    def _forced(self, group: Group, arrived: np.ndarray) -> Generator[str, None, np.ndarray]:
        """Put pins in their places that did not arrive there, and turn back what that flips; returns which pieces have
        arrived now, (p',) bool."""
        domain = group.domain
        way = way_of(group, self.settings, together=self.batch.partner is not None)
        rows = arrived[domain.vertex_piece, None]
        held = domain.constrained.held & ~rows
        moved = np.where(held, domain.constrained.values, np.where(rows, group.uv, group.uv + way))
        moved, sound = yield from untangled(domain, moved, group.uv)
        group.uv = np.where(sound[domain.vertex_piece, None], moved, group.uv)
        return arrived | sound

    def _untangled(self, group: Group, before: np.ndarray | None = None) -> Steps:
        """Turn back what is flipped in a group's maps, as far as that can be had.

        before  (n, 2), the group's map in which air is at rest
        """
        if (self.refining or self.settings.iterations) and wrong_pieces(group.domain.charts, group.uv).any():
            group.uv, _ = yield from untangled(group.domain, group.uv, before)
            self.now[group.rows] = self.best[group.rows] = group.island_uv

    def _free(self) -> Steps:
        """With outlines that are free."""
        batch, settings = self.batch, self.settings
        surface, p = batch.surface, batch.surface.piece_count
        start, certified, to_lead, new = batch.start, None, np.zeros(p, bool), np.zeros(p, bool)
        directly = np.full(p, settings.initial == "AUTO" or not settings.iterations)
        if settings.initial == "AUTO":
            good = batch.has_pins & ~wrong_pieces([surface], start)
            start, to_lead = self._before_pins(batch.has_pins & ~good)
            to_lead |= good & batch.has_start
            new = ~(good | to_lead)
            if new.any():
                start = start.copy()
                found = yield from best_start(surface if new.all() else surface.of(new), settings)
                start[batch.rows(new)] = found.uv
                certified = np.zeros(p, bool)
                certified[new], directly[new] = found.certified, ~found.crossing
                self.sure[new] = found.in_square & ~batch.in_frame(settings)[new]
        elif settings.initial != "CURRENT":
            start = natural_start(surface, settings, settings.initial)
        if batch.has_pins.any():
            placed = with_pins(surface, start, batch.uv, batch.pinned)
            start, certified = np.where(batch.rows(to_lead)[:, None], start, placed), None
        yield PART
        self._begin(start)
        yield from self._freely(start, directly, new, certified)

    def _freely(
        self, start: np.ndarray, directly: np.ndarray, new: np.ndarray, certified: np.ndarray | None = None
    ) -> Steps:
        """Improve free maps; `directly`, (p,) bool, without iterations and air where the refinement soon arrives.

        Maps that are `new`, (p,) bool, have been nowhere near the end.  It may be known for which pieces (p,) the start
        is `certified`.
        """
        batch, settings = self.batch, self.settings
        surface, p = batch.surface, batch.surface.piece_count
        if not self.refining and not settings.iterations:
            yield STEP
            return
        near = done = rigidly = np.zeros(p, bool)
        value, winding = energies(surface, start, settings.balance), surface.outline_lengths**2 > _LONG * 4 * np.pi
        if self.refining:
            small = ~winding & (np.bincount(surface.piece, minlength=p) <= _FEW)
            bulging = small & new & directly & np.isfinite(value) & (value >= _SMALL_NEAR) & ~batch.has_hold
            if certified is not None:
                bulging &= certified
            # Holes would be held as well, and iterations fold faces without area over.
            bulging &= np.bincount(surface.loop_piece) == 1
            bulging[surface.piece[surface.degenerate]] = False
            if bulging.any() and settings.balance >= _BY_AREAS:
                yield from self._drawn_near(start, value, bulging)
            soon = value < np.where(small, _SMALL_NEAR, _NEAR)
            if soon.any():
                certified = certified_pieces(surface, start) if certified is None else certified
                done = certified & (value <= ISOMETRIC) & ~batch.apart(start)
                near = certified & soon & ~done & ~batch.has_hold
                rigidly = near & new & (settings.balance <= _BY_ANGLES)
                near &= directly
        self.converged |= done
        if (done | near).any():
            yield STEP
        if near.any():
            group = self._group(near, start, loose)
            yield from self.refine(group, watched=winding[near], rigidly=bool((rigidly & near).any()))
            part = surface if near.all() else surface.of(near)
            certain = np.zeros(p, bool)
            certain[near] = certified_pieces(part, self.placed(self.best[batch.rows(near)], near, part))
            self.sure |= certain
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
            yield from self._in_air(far, start.copy(), rigidly=far & rigidly & (value < _NEAR))

    def _drawn_near(self, start: np.ndarray, value: np.ndarray, pieces: np.ndarray) -> Steps:
        """Iterate from the maps `start` (n, 2) of the chosen pieces (p,) bool within their outlines, until the
        refinement will soon arrive, if that lowers their energies `value` (p,) much: both tell how far that led."""
        group = self._group(pieces, start, rigid)
        for part in self.iterate(group, value, _NEAR):
            start[group.rows] = group.uv
            yield part

    def _in_air(
        self, pieces: np.ndarray, start: np.ndarray, following: bool = False, rigidly: np.ndarray | None = None
    ) -> Steps:
        """Improve the maps of the chosen pieces with air around them, or with their outlines as they are.

        Where pins are elsewhere than in the `start`, it is led after them first, and if `following`, everywhere.  What
        is to begin `rigidly`, (p,) bool, is refined at once, unless it must begin with a circle.
        """
        batch = self.batch
        airs: dict[int, Air] = {}
        missing = pieces.copy()
        self._make_airs(missing, start, airs)
        apart = batch.apart(start) & pieces
        self._put_pins(start, apart & missing)
        # A valid map that is held stays, whether or not there is room for air; any other gives way to a circle.
        crossed = missing & ~((batch.has_pins | batch.has_walls) & ~wrong_pieces([batch.surface], start))
        if crossed.any():
            rows = batch.rows(crossed)
            start[rows] = natural_start(batch.surface.of(crossed), self.settings, "MEAN_VALUE")
            self._put_pins(start, crossed)
            self.now[rows] = self.best[rows] = start[rows]
            for k in np.flatnonzero(crossed):
                self.warnings[k] += ("the start overlaps itself: begun with a circle",)
            still = crossed.copy()
            self._make_airs(still, start, airs)
            missing &= ~crossed | still
        rigidly = np.zeros_like(pieces) if rigidly is None else rigidly & ~crossed
        ready = pieces & ~missing
        for within in self._portions(ready & rigidly) + self._portions(ready & ~rigidly):
            its = [airs[k] for k in np.flatnonzero(within).tolist()]
            walls = None if batch.walls is None else [batch.walls[k] for k in np.flatnonzero(within).tolist()]
            make = partial(Plane, airs=its, triangulate=self._triangulate, walls=walls)
            group = self._group(within, start, make)
            if following or (apart & within).any():
                yield from self._led(group)
            elif rigidly[within].all():
                yield from self.refine(group, rigidly=True)
            else:
                yield from self.improve(group)
        if missing.any():
            for k in np.flatnonzero(missing):
                text = "the outline stays as it is: there is no room to free it"
                if crossed[k] and batch.has_pins[k]:
                    text = PINS_CROSS
                self.warnings[k] = (text,)
            yield from self.improve(self._group(missing, start, rigid))

    def _portions(self, pieces: np.ndarray) -> list[np.ndarray]:
        """The chosen pieces (p,) bool, a few at a time: new air around one makes new equations for all of them."""
        chosen = np.flatnonzero(pieces)
        sizes = np.bincount(self.batch.surface.piece, minlength=len(pieces))[chosen]
        portion = (np.cumsum(sizes) - sizes) // _IN_AIR
        return [np.isin(np.arange(len(pieces)), chosen[portion == k]) for k in np.unique(portion)]

    def _make_airs(self, missing: np.ndarray, start: np.ndarray, airs: dict[int, Air]) -> None:
        """Add the air of the pieces that miss it, (p,) bool, and tick these off where it can be made."""
        given = self.batch.surface, start, self._triangulate
        for k, air in enumerate(airs_around(*given, missing, self.batch.walls)):
            if air is not None:
                airs[k] = air
                missing[k] = False

    def _group(
        self,
        pieces: np.ndarray,
        uv: np.ndarray,
        make: Callable[[Surface, np.ndarray, Fixed], D],
        fixed: Fixed | None = None,
    ) -> Group[D]:
        """The chosen pieces, (p,) bool, with the map `uv` (n, 2) of the batch in a domain of their own."""
        batch, fixed = self.batch, fixed or self.batch.fixed
        surface, rows = batch.surface, np.arange(len(uv))
        if not pieces.all():
            number = surface.numbering(pieces)
            surface = surface.of(pieces, number)
            chosen = batch.rows(pieces)
            rows, uv, fixed = np.flatnonzero(chosen), uv[chosen], fixed.of(chosen, number)
        domain = make(surface, uv, fixed)
        return Group(domain, domain.start(uv), np.flatnonzero(pieces), rows)

    # Pins that moved

    def _before_pins(self, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The given maps, of the chosen pieces as they may have been before pins were moved; and in which pieces, (p,)
        bool, that is a map without flips from which these can be led."""
        batch = self.batch
        start, found = batch.start.copy(), np.zeros(len(pieces), bool)
        for k in np.flatnonzero(pieces):  # each by itself, since equations may have no solution
            its, one = batch.rows_of(int(k)), batch.surface.one(int(k))
            try:
                before = before_pins(one, batch.uv[its], batch.pinned[its])
            except SingularError:
                continue
            if not wrong_pieces([one], before).any():
                start[its], found[k] = before, True
        return start, found

    def _put_pins(self, uv: np.ndarray, pieces: np.ndarray) -> None:
        """Put the pins of the chosen pieces, (p,) bool, in their places in the map `uv` (n, 2)."""
        if pieces.any():
            batch, rows = self.batch, self.batch.rows(pieces)
            uv[rows] = with_pins(batch.surface.of(pieces), uv[rows], batch.uv[rows], batch.pinned[rows])

    def _after_pins(self, live: Group | None) -> Steps:
        """Go on from the best maps with pins that were moved; with the `live` group, if there is one."""
        everything = np.ones(self.batch.surface.piece_count, bool)
        if live is None or not isinstance(live.domain, Plane):
            yield from self._in_air(everything, self.best.copy(), following=True)
            return
        live.uv, _ = live.domain.recalled(live.uv, self.best, everything)
        live.domain.fix(self.batch.fixed, live.uv)
        yield from self._led(live)

    def _led(self, group: Group) -> Steps:
        """Lead the maps of a group with air after its pins, and improve them; what cannot be led there begins anew."""
        batch, arrived = self.batch, np.zeros(len(group.pieces), bool)
        for _ in range(_LEADS):
            arrived = lead(group, self.settings, together=batch.partner is not None)
            if arrived.all():
                break
            group.uv = group.domain.renewed(group.uv)
        if not arrived.all():
            arrived = yield from self._forced(group, arrived)
        late = np.zeros(batch.surface.piece_count, bool)
        late[group.pieces[~arrived]] = True
        if late.any():
            start = self.best.copy()
            if self.settings.initial == "AUTO":
                found = yield from best_start(batch.surface.of(late), self.settings)
                start[batch.rows(late)] = found.uv
            self._put_pins(start, late)
            yield from self._in_air(late, start)
        if not arrived.any():
            return
        group = group.of(arrived)
        self.best[group.rows] = self.now[group.rows] = group.island_uv
        if self.refining:
            yield from self.refine(group)
        else:
            yield from self.improve(group)
