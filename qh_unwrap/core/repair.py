# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning flipped triangles back: by raising the weights around them, or by going only part of the way."""

import numpy as np

from .certificate import wrong_pieces, wrong_triangles
from .domain import Domain

_FLOOR = 0.1  # the least weight, relative to the mean of an edge's ends with six neighbours each
_ROUNDS = 8  # of raising weights
_HALVINGS = 10  # of the way


class Repair:
    """Solves for the next map so that nothing is flipped, where that can be had.

    With `remember`, raised weights stay so in later solves.  `active` (p,) tells in which pieces some had to be raised,
    `shortened` (p,) which pieces went only part of the way in the last solve.
    """

    def __init__(self, remember: bool, pieces: int):
        self.remember = remember
        self.active = np.zeros(pieces, bool)
        self.shortened = np.zeros(pieces, bool)
        self._marked = np.zeros(0, bool)

    def of(self, pieces: np.ndarray, vertices: np.ndarray) -> None:
        """Go on with the chosen `pieces` (p,) bool alone, whose islands have the chosen `vertices` (n,) bool."""
        self.active, self.shortened = self.active[pieces], self.shortened[pieces]
        if len(self._marked):
            self._marked = self._marked[: len(vertices)][vertices]

    def solve(self, domain: Domain, weights: np.ndarray, previous: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The map for symmetric `weights` (2, k) and which pieces (p,) are valid; where the island flips, with raised
        weights.

        If that does not help, or only air flips, go part of the way from the `previous` map, where that one is valid.
        """
        island = domain.island
        marked = np.zeros(len(previous), bool)
        kept = self._marked[: len(island.vertices)]  # not those of air, which may be other vertices now
        marked[: len(kept)] = kept
        uv = domain.constrained.solve(_raised(domain, weights, marked))
        wrong = wrong_pieces(domain.charts, uv)
        if wrong.any() and not wrong.all():
            return self._solve_some(domain, weights, previous, uv, wrong)
        for _ in range(_ROUNDS):
            in_island = np.zeros(len(wrong), bool)
            in_island[island.piece[wrong_triangles(island, uv)]] = True
            self.active |= wrong
            if not in_island.any():
                break
            for chart in domain.charts:
                flipped = wrong_triangles(chart, uv) & in_island[chart.piece]
                marked[chart.triangles[flipped]] = True
            edges = domain.triangles.edges[in_island[domain.vertex_piece[domain.triangles.edges[:, 0]]]]
            for _ in range(2):  # and two rings around them, but around none in pieces that are mended
                marked[edges[marked[edges].any(axis=1)]] = True
            again = domain.constrained.solve(_raised(domain, weights, marked))
            uv = np.where(in_island[domain.vertex_piece][:, None], again, uv)
            wrong = wrong_pieces(domain.charts, uv)
        if self.remember:
            self._marked = marked[: len(island.vertices)]
        self.active |= wrong
        self.shortened = wrong & ~wrong_pieces(domain.charts, previous) if wrong.any() else np.zeros(len(wrong), bool)
        if self.shortened.any():
            uv = _shortened(domain, previous, uv, self.shortened)
            wrong = wrong & ~self.shortened
        return uv, ~wrong

    def _solve_some(self, domain, weights, previous, uv, pieces):
        """The same for the chosen `pieces` (p,) bool alone; the others have their map `uv` already."""
        rows, at_edges = pieces[domain.vertex_piece], pieces[domain.vertex_piece[domain.triangles.edges[:, 0]]]
        in_island = rows[: len(domain.island.vertices)]
        some = Repair(self.remember, int(pieces.sum()))
        if len(self._marked):
            some._marked = self._marked[in_island]
        part, its_previous = domain.of(pieces, previous)
        uv = uv.copy()
        uv[rows], valid = some.solve(part, weights[:, at_edges], its_previous)
        self.active[pieces] |= some.active
        self.shortened = np.zeros(len(pieces), bool)
        self.shortened[pieces] = some.shortened
        if self.remember:
            marked = np.zeros(len(in_island), bool)
            marked[: len(self._marked)] = self._marked
            marked[in_island] = some._marked
            self._marked = marked
        everything = ~pieces
        everything[pieces] = valid
        return uv, everything


def _shortened(domain, previous, uv, pieces):
    """The map `uv`, but for the chosen pieces so much nearer to the `previous` one that nothing flips."""
    part = np.full(len(pieces), 0.5)
    for _ in range(_HALVINGS):
        shorter = np.where(
            pieces[domain.vertex_piece, None], previous + (uv - previous) * part[domain.vertex_piece, None], uv
        )
        wrong = pieces & wrong_pieces(domain.charts, shorter)
        if not wrong.any():
            return shorter
        part[wrong] /= 2
    return np.where(wrong[domain.vertex_piece, None], previous, shorter)


def _raised(domain, weights, marked):
    """The weights (2, k) with a floor for those of edges with a marked end."""
    near = marked[domain.triangles.edges].any(axis=1)
    if not near.any():
        return weights
    diagonal = np.abs(domain.constrained.diagonal(weights))
    i, j = domain.triangles.edges[near].T
    raised = weights.copy()
    raised[:, near] = np.maximum(weights[:, near], _FLOOR / 6 * np.sqrt(diagonal[i] * diagonal[j]))
    return raised
