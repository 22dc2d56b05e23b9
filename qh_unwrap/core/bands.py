# SPDX-License-Identifier: GPL-3.0-or-later
"""Equations of pieces so small that their matrices are narrow bands.

LAPACK factorizes both coordinates' equations at once and exactly, in less time than it takes to come near their
solution in any other way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs

from .patterns import Unknowns, places, solved_each
from .threads import is_known, one_thread

# Widths depend on how vertices are numbered, so that as little as may be should depend on them: which pieces are small
# does not.
_FEW = 1000  # vertices of a piece, up to which its band takes less time than other ways,
_WIDEST = 128  # unless neighbours are farther apart than so many places in the order of elimination
_UNBLOCKED = 15  # places, up to which LAPACK certainly uses one thread


class IndefiniteError(Exception):
    """The matrices of some `pieces`, (i,) int, are not positive definite, at least not up to rounding."""

    def __init__(self, pieces: np.ndarray):
        super().__init__()
        self.pieces = pieces


def widths(place: np.ndarray, edges: np.ndarray, group: np.ndarray | None = None) -> np.ndarray:
    """By how many places the ends of edges (k, 2) are apart at most, in every piece, (p,).

    place  (n,), that of each vertex
    group  (n,), the piece of each vertex, None where there is one
    """
    i, j = edges.T
    apart = np.abs(place[i] - place[j])
    return np.array([apart.max(initial=0)]) if group is None else _largest(apart, i, group)


def _largest(values, at, group):
    """The largest of values (k,), not negative, in every group, (g,): they stand `at` such members, (k,), and `group`
    (n,) is that of each member."""
    result = np.zeros(int(group.max(initial=0)) + 1, np.int64)
    np.maximum.at(result, group[at], values)
    return result


def are_small(n: int, group: np.ndarray | None = None) -> np.ndarray:
    """Which pieces have few vertices, (p,) bool, of n in all."""
    return (np.array([n]) if group is None else np.bincount(group)) <= _FEW


def are_narrow(width: np.ndarray, n: int, group: np.ndarray | None = None) -> np.ndarray:
    """Which pieces of such widths, (p,), are to be taken for bands, (p,) bool, of n vertices in all."""
    return are_small(n, group) & (width <= (_WIDEST if is_known() else min(_WIDEST, _UNBLOCKED)))


class Banded:
    """Equations on a graph whose pieces are bands.  They raise `IndefiniteError`.

    Parameters
    ----------
    unknowns : of each coordinate, or of both
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    group : (n,), the piece that each vertex belongs to, or None
    """

    def __init__(
        self, unknowns: Sequence[Unknowns], order: np.ndarray, edges: np.ndarray, group: np.ndarray | None = None
    ):
        self._unknowns, self._order, self._edges = unknowns, order, edges
        self._group = np.zeros(len(order), np.int64) if group is None else group
        self._coupled: _Bands | None = None  # of both coordinates' equations,
        self._single: list[_Bands] = []  # and of each coordinate's by themselves
        self._solve: Callable[[np.ndarray], np.ndarray] | None = None

    def newton_direction(
        self,
        gradient: np.ndarray,
        beside: Sequence[np.ndarray],
        own: Sequence[np.ndarray],
        residual: np.ndarray | float,
    ) -> np.ndarray:
        if self._coupled is None:
            self._coupled = self._both_coupled()
        (m, d, s, a), (own_m, own_d, own_s) = beside, own
        entries = np.concatenate([m + d, s - a, s + a, m - d, own_m + own_d, own_s, own_m - own_d])
        self._solve = self._coupled.factorized(entries)
        return self.next_direction(gradient, residual)

    def next_direction(self, gradient: np.ndarray, _residual: np.ndarray | float) -> np.ndarray:
        assert self._solve is not None
        direction, rest = np.zeros(gradient.shape), np.empty(sum(len(one) for one in self._of_both))
        for which, unknowns, values in zip(self._which, self._of_both, gradient.T, strict=True):
            rest[which] = unknowns.gathered(-values)
        solution = self._solve(rest)
        for which, unknowns, values in zip(self._which, self._of_both, direction.T, strict=True):
            unknowns.spread(solution[which], values)
        return direction

    def solver(
        self, forward: np.ndarray, _backward: np.ndarray, own: np.ndarray, _exactly: bool
    ) -> Callable[[np.ndarray, np.ndarray], None]:
        if not self._single:
            self._single = [self._alone(unknowns) for unknowns in self._unknowns]
        entries = np.concatenate([forward, own])
        return solved_each(self._unknowns, [bands.factorized(entries) for bands in self._single])

    @property
    def _of_both(self):
        return self._unknowns[0], self._unknowns[-1]

    def _both_coupled(self):
        """The bands in which every vertex's U is followed by its V."""
        if len(self._unknowns) == 1:
            self._which = slice(0, None, 2), slice(1, None, 2)
            size = 2 * len(self._unknowns[0])
        else:
            place = places(self._order)
            at = [2 * place[unknowns.sequence] + c for c, unknowns in enumerate(self._unknowns)]
            there = np.zeros(2 * len(place), bool)
            there[np.concatenate(at)] = True
            number, size = np.cumsum(there) - 1, int(there.sum())
            self._which = tuple(number[each] for each in at)
        everything, piece = np.arange(size), np.empty(size, np.int64)
        at_vertices = []
        for which, unknowns in zip(self._which, self._of_both, strict=True):
            piece[which] = self._group[unknowns.sequence]
            at_vertices.append(np.append(everything[which], -1)[unknowns.number])
        (ui, uj), (vi, vj) = (number[self._edges.T] for number in at_vertices)
        u, v = at_vertices
        row, column = np.concatenate([ui, ui, vi, vi, u, u, v]), np.concatenate([uj, vj, uj, vj, u, v, v])
        tied = any(unknowns.tied for unknowns in self._unknowns)
        return _Bands(row, column, piece, 4 * len(self._edges) if tied else 0)

    def _alone(self, unknowns):
        i, j = unknowns.number[self._edges.T]
        row, column = np.concatenate([i, unknowns.number]), np.concatenate([j, unknowns.number])
        return _Bands(row, column, self._group[unknowns.sequence], len(self._edges) if unknowns.tied else 0)


class _Bands:
    """Where the entries of symmetric matrices go in bands, of which there is one for all pieces of about one width.

    Parameters
    ----------
    row, column : (e,), the unknowns that every entry joins, in either order; -1 for what is no unknown
    piece : (size,), the piece that each unknown belongs to, one after the other
    twice : so many first entries stand for a second one, in the same place if they join an unknown to itself, which
        they do only where some move together
    """

    def __init__(self, row: np.ndarray, column: np.ndarray, piece: np.ndarray, twice: int):
        self._entry = entry = np.flatnonzero((row >= 0) & (column >= 0))
        low, gap = np.minimum(row[entry], column[entry]), np.abs(row[entry] - column[entry])
        self._twice = np.where((entry < twice) & (gap == 0), 2.0, 1.0) if twice else None
        width = _largest(gap, low, piece)
        kind = np.frexp(width)[1]  # of one kind are those up to the same power of two
        count = np.bincount(kind[piece], minlength=1)
        there = np.flatnonzero(count)
        self._order, self._piece = None, piece
        if len(there) > 1:
            self._order = np.argsort(kind[piece], kind="stable")
            self._piece = piece[self._order]
            low = places(self._order)[low]
        ends = np.cumsum(count[there]).tolist()
        self._columns = [slice(*both) for both in pairwise([0, *ends])]
        self._rows = [int(width[kind == each].max()) + 1 for each in there.tolist()]
        height = np.repeat(np.array(self._rows, np.int64), count[there])
        self._length, self._place = int(height.sum()), (np.cumsum(height) - height)[low] + gap

    def factorized(self, entries: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The function that solves for right-hand sides (size, ...) with the matrix of the `entries` (e,).

        Raises `IndefiniteError`.
        """
        entries = entries[self._entry]
        factors, indefinite = [], []
        with one_thread():
            for band, its in zip(self._filled(entries), self._columns, strict=True):
                factor, failed = _factorized(band)
                if failed:
                    indefinite.append(self._piece[its][failed - 1])
                factors.append(factor)
            if indefinite:
                raise IndefiniteError(np.unique([*indefinite, *self._indefinite(entries)]))

        def solve(rhs):
            if self._order is None:
                return _solved(factors[0], rhs) if factors else rhs
            result = np.empty(rhs.shape)
            for factor, its in zip(factors, self._columns, strict=True):
                result[self._order[its]] = _solved(factor, rhs[self._order[its]])
            return result

        return solve

    def _filled(self, entries):
        """The bands, (w, k) each, as LAPACK has them."""
        bands = np.zeros(self._length)
        if self._twice is None:
            bands[self._place] = entries
        else:
            np.add.at(bands, self._place, self._twice * entries)
        lengths = [rows * (its.stop - its.start) for rows, its in zip(self._rows, self._columns, strict=True)]
        ends = pairwise([0, *np.cumsum(lengths).tolist()])
        return [bands[slice(*both)].reshape(-1, rows).T for both, rows in zip(ends, self._rows, strict=True)]

    def _indefinite(self, entries):
        """The pieces whose matrices are not positive definite by themselves."""
        for band, its in zip(self._filled(entries), self._columns, strict=True):
            piece = self._piece[its]
            ends = np.flatnonzero(np.diff(piece, append=-1)) + 1
            for start, end in pairwise([0, *ends.tolist()]):
                _, failed = _factorized(np.asfortranarray(band[:, start:end]))
                if failed:
                    yield piece[start]


def _factorized(band):
    """The factor of a band, which is overwritten, and the number of the first column that stands in the way, or 0."""
    factor, failed = dpbtrf(band, lower=1, overwrite_ab=1)
    if not failed and not np.isfinite(factor[0].sum()):  # LAPACK goes on where something is not a number
        failed = int(np.argmin(np.isfinite(factor[0]))) + 1
    return factor, failed


def _solved(factor, rhs):
    return dpbtrs(factor, rhs, lower=1)[0]
