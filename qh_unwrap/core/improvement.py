# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of a batch while they are improved: by iterations, by the refinement, or by both.

The pieces go together, and every step costs hardly more than that of one; but each takes its own way, and ends where it
would have ended alone.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from .batch import Batch
from .certificate import certified_pieces, orientation, wrong_pieces
from .chart import Surface
from .descent import Descent
from .domain import Domain
from .energy import ISOMETRIC, energies, map_scale
from .errors import UnwrapError
from .quasi_harmonic import Iteration
from .settings import Settings
from .stepping import PART, STEP
from .unfolding import unfolded

_HANDOVER = 0.9  # an iteration that lowers the energy by less, relative to it, gives way to the refinement;
_FAR = 200  # above this energy
_FAR_HANDOVER = 0.5  # one that lowers it by less than this
_FOLDED = 0.2  # of a surface's area, that flipped triangles may have for it to be worth unfolding
_FEW = 0.75  # once only this part of the vertices still moves, the others take part no longer

# They yield `STEP` after each step, and `PART` where one takes long for large islands.
Steps = Generator[str, None, None]


D = TypeVar("D", bound=Domain)


@dataclass(eq=False)
class Group(Generic[D]):
    """Some pieces of the batch on their way."""

    domain: D
    uv: np.ndarray  # (n, 2), the domain's map
    pieces: np.ndarray  # (p',), their numbers in the batch
    rows: np.ndarray  # (n',), their islands' vertices in the batch

    @property
    def island_uv(self) -> np.ndarray:
        return self.uv[: len(self.rows)]

    def of(self, chosen: np.ndarray) -> Group:
        """The chosen pieces (p',) bool alone."""
        if chosen.all():
            return self
        domain, uv = self.domain.of(chosen, self.uv)
        rows = self.rows[chosen[self.domain.island.vertex_piece]]
        return Group(domain, uv, self.pieces[chosen], rows)

    def shares(self, pieces: np.ndarray) -> float:
        """How much of the vertices belong to the chosen pieces (p',) bool."""
        return pieces[self.domain.vertex_piece].mean()

    def moved(self, after: np.ndarray, going: np.ndarray) -> None:
        """Take the map `after` in the pieces that are `going` (p',) bool."""
        self.uv = after if going.all() else np.where(going[self.domain.vertex_piece, None], after, self.uv)


class Improvement:
    """The maps of a batch on their way.

    Attributes, all for the batch's pieces or vertices
    ----------
    now, best : (n, 2), the latest map and the best so far
    changes : list of lists, for every step of a piece the largest movement of a vertex by the layout's diameter
    valid : (p,) bool, in the latest map nothing is flipped, air included
    converged : (p,) bool, another step would change nothing, or would not pay
    unfinished : (p,) bool, the refinement came to the limit of its steps
    repaired : (p,) bool, weights had to be changed to turn flipped triangles back
    sure : (p,) bool, the best map is known to be certified where it is put in the end
    warnings : list of tuples
    faults : dictionary from pieces to the errors for which they have no map
    live : what moves at the moment, if that is the whole batch
    patience : how much smaller gains than usual are worth a step of the refinement
    """

    def __init__(self, batch: Batch, settings: Settings):
        self.batch, self.settings = batch, settings
        n, p = len(batch.uv), batch.surface.piece_count
        self.now, self.best = np.zeros((2, n, 2))
        self.changes: list[list[float]] = [[] for _ in range(p)]
        self.valid, self.converged, self.unfinished, self.repaired, self.sure = (np.zeros(p, bool) for _ in range(5))
        self.warnings: list[tuple[str, ...]] = [()] * p
        self.faults: dict[int, UnwrapError] = {}
        self.live: Group | None = None
        self.patience = 1.0

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
        in_frame = self.batch.in_frame(self.settings)
        in_frame = in_frame if pieces is None else in_frame[pieces]
        if in_frame.all():
            return uv
        moved = surface.in_unit_square(uv)
        return np.where(in_frame[surface.vertex_piece, None], uv, moved) if in_frame.any() else moved

    def improve(self, group: Group) -> Steps:
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
            yield STEP
            island = group.domain.island
            # Repairs and new air make the energy rise and fall: keep the best valid map from then on.
            uneven = iteration.repaired | self.refining | (settings.boundary == "FREE")
            fine = going & valid & ~wrong_pieces([island], self.placed(group.island_uv, group.pieces, island))
            value = np.where(fine, energies(island, group.island_uv, settings.balance), np.inf)
            isometric = fine & self.refining & (value <= ISOMETRIC)
            handover = np.where((value > _FAR) & ~self.batch.has_hold[group.pieces], _FAR_HANDOVER, _HANDOVER)
            enough = fine & self.refining & (number > 0) & (value > (1 - handover) * least)
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
                rest = Group(group.domain, group.uv, group.pieces[going], group.rows[going[island.vertex_piece]])
                rest.uv = iteration.of(going, group.uv)
                rest.domain, group, going = iteration.domain, rest, np.ones(len(rest.pieces), bool)
            number += 1
            yield PART
            before, after, now_valid = iteration.step(group.uv)
            group.uv = before
            previous = group.island_uv.copy()
            group.moved(after, going)
            valid = np.where(going, now_valid, valid)
            held_back = np.where(going, iteration.shortened, held_back)
            change = np.where(going, _movement(group.domain.island, previous, group.island_uv), change)
            self._note(group, valid, iteration.repaired, change, going)

    def iterate(self, group: Group, value: np.ndarray, enough: float) -> Steps:
        """Iterate alone, in every piece as long as that halves its energy and leaves it above `enough`; `value` (p,),
        of all the batch's pieces, is kept up with that.  Whoever goes on from there does so in another domain."""
        iteration, going = Iteration(group.domain, self.settings), np.ones(len(group.pieces), bool)
        for _ in range(self.settings.iterations):
            yield PART
            _, after, valid = iteration.step(group.uv)
            before, now = value[group.pieces], energies(group.domain.island, after, self.settings.balance)
            going &= valid & (now < _FAR_HANDOVER * before)
            if not going.any():
                break
            change = _movement(group.domain.island, group.uv, after)
            group.moved(after, going)
            self.best[group.rows] = group.island_uv
            value[group.pieces] = np.where(going, now, before)
            self.sure[group.pieces] = False
            self._note(group, valid, iteration.repaired, change, going)
            self.live = None
            yield STEP
            going = going & (now >= enough)
            if not going.any():
                break

    def _refine_best(self, group, best, recalled, sound):
        """Refine the `best` maps (n', 2) of the group's pieces, which in those to be `recalled` (p',) bool are not the
        latest, and valid in those that are `sound` (p',) bool.
        """
        self.sure[group.pieces] = False
        island = group.domain.island
        best = np.where(recalled[island.vertex_piece, None], best, group.island_uv)
        if self.settings.repair:
            best, opened = unfolded(island, best, group.domain.constrained.held[: len(best)], _FOLDED)
            recalled, sound = recalled | opened, sound | opened
        self.best[group.rows] = best
        if not self.refining:
            return
        if recalled.any():
            group.uv, failed = group.domain.recalled(group.uv, best, recalled)
            sound = sound & ~failed
        if sound.any():
            yield from self.refine(group.of(sound))

    def refine(self, group: Group, watched: np.ndarray | None = None, rigidly: bool = False) -> Steps:
        """Newton's steps, in every piece as long as they pay; `rigidly` with one before them that lays triangles out.

        Pieces that are `watched`, (p',) bool, stop where their outlines come to cross themselves in the first step, as
        most that do.
        """
        settings = self.settings
        yield PART
        descent = Descent(settings.balance, map_scale(group.domain.island, group.island_uv), self.patience, rigidly)
        going = np.ones(len(group.pieces), bool)
        self.unfinished[group.pieces] = False
        folded = _folded(group)
        for number in range(settings.refine):
            domain = group.domain
            before, after, done = yield from descent.step(domain, group.uv, going)
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
            self.sure[group.pieces[fine]] = False
            self.converged[group.pieces[fine]] = done[fine]
            going &= ~done
            if number == 0 and watched is not None and (watched & going).any():
                going &= ~watched | certified_pieces(island, group.island_uv)
            yield STEP
            if not going.any():
                return
            if not going.all() and group.shares(going) <= _FEW:
                group, descent, folded = group.of(going), descent.of(going), folded[going]
                going = np.ones(len(group.pieces), bool)
        self.unfinished[group.pieces[going]] = True

    def _note(self, group, valid, repaired, change, going):
        """Keep what the latest step has brought, for the pieces that are `going` (p',) bool."""
        pieces, chosen = group.pieces[going], going[group.domain.island.vertex_piece]
        self.now[group.rows[chosen]] = group.island_uv[chosen]
        self.valid[pieces], self.repaired[pieces] = valid[going], repaired[going]
        if change is not None:
            for k, its in zip(pieces.tolist(), change[going].tolist(), strict=True):
                self.changes[k].append(its)
        self.live = group if len(group.pieces) == len(self.changes) else None


def _folded(group: Group) -> np.ndarray:
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
