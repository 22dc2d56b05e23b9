# SPDX-License-Identifier: GPL-3.0-or-later
"""Equations of pieces so small that their matrices are narrow bands.

LAPACK factorizes both coordinates' equations at once and exactly, in less time than it takes to come near their
solution in any other way.  Matrices that are not symmetric, as those of mean value weights, are solved for each
coordinate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgbtrf, dgbtrs, dpbtrf, dpbtrs

from .patterns import Unknowns, places, solved_each
from .threads import is_known, one_thread

# Widths depend on how vertices are numbered, so that as little as may be should depend on them: which pieces are small
# does not.
_FEW = 1000  # vertices of a piece, up to which its band takes less time than other ways,
_WIDEST = 128  # unless neighbours are farther apart than so many places in the order of elimination
_UNBLOCKED = 15  # places, up to which LAPACK certainly uses one thread


class IndefiniteError(Exception):
    """The matrices of some `pieces`, (i,) int, are singular, or symmetric and not positive definite, at least not up to
    rounding."""

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
        self._single: dict[bool, list[_Bands]] = {}  # and of each coordinate's by themselves, symmetric or not
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
        self, forward: np.ndarray, backward: np.ndarray, own: np.ndarray, _exactly: bool
    ) -> Callable[[np.ndarray, np.ndarray], None]:
        symmetric = np.array_equal(forward, backward)
        if symmetric not in self._single:
            self._single[symmetric] = [self._alone(unknowns, symmetric) for unknowns in self._unknowns]
        entries = np.concatenate([forward, own] if symmetric else [forward, backward, own])
        return solved_each(self._unknowns, [bands.factorized(entries) for bands in self._single[symmetric]])

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
        return _Bands(row, column, piece, _SYMMETRIC, 4 * len(self._edges) if tied else 0)

    def _alone(self, unknowns, symmetric):
        own, (i, j) = unknowns.number, unknowns.number[self._edges.T]
        piece, twice = self._group[unknowns.sequence], len(self._edges) if unknowns.tied else 0
        if symmetric:
            return _Bands(np.concatenate([i, own]), np.concatenate([j, own]), piece, _SYMMETRIC, twice)
        return _Bands(np.concatenate([i, j, own]), np.concatenate([j, i, own]), piece, _WHOLE, twice)


class _Form(NamedTuple):
    """How LAPACK takes matrices."""

    symmetric: bool
    height: Callable[[np.ndarray], np.ndarray]
    """The rows of bands of a width (c,), (c,)."""
    place: Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    """The columns of a band and its rows, (e,), where the entries in rows (e,) and columns (e,) of the matrix go; the
    width, (size,), is that of the band in which each unknown is."""
    factorized: Callable[[np.ndarray], tuple[Callable[[np.ndarray], np.ndarray] | None, int]]
    """The function that solves with a band, which is overwritten, and the number of the first column that stands in the
    way, or 0; if it does, the function is of no use."""


def _by_cholesky(band):
    factor, failed = dpbtrf(band, lower=1, overwrite_ab=1)

    def solve(rhs):
        return dpbtrs(factor, rhs, lower=1)[0]

    return solve, failed or _first_not_finite(factor[0])


def _by_lu(band):
    width = (len(band) - 1) // 3
    failed = _first_not_finite(band.sum(axis=0))  # among which LAPACK might find no pivot
    if failed:
        return None, failed
    factor, pivots, failed = dgbtrf(band, width, width, overwrite_ab=1)

    def solve(rhs):
        return dgbtrs(factor, width, width, rhs, pivots, trans=1)[0]

    return solve, failed or _first_not_finite(factor[2 * width])


def _first_not_finite(diagonal):
    """The number of the first value that is not finite, counted from 1, or 0: LAPACK goes on where something is not a
    number."""
    return 0 if np.isfinite(diagonal.sum()) else int(np.argmin(np.isfinite(diagonal))) + 1


# Of symmetric matrices the lower half, column by column from the diagonal down
_SYMMETRIC = _Form(
    True,
    lambda width: width + 1,
    lambda row, column, _width: (np.minimum(row, column), np.abs(row - column)),
    _by_cholesky,
)
# Others are transposed, and have room for what pivots would fill in.  What is dominated by the diagonals of its rows
# needs none then: LAPACK, which looks for them down each column, stays on the diagonal.
_WHOLE = _Form(
    False,
    lambda width: 3 * width + 1,
    lambda row, column, width: (row, 2 * width[row] + column - row),
    _by_lu,
)


class _Bands:
    """Where the entries of matrices go in bands, of which there is one for all pieces of about one width.

    Parameters
    ----------
    row, column : (e,), the unknowns that every entry joins; -1 for what is no unknown
    piece : (size,), the piece that each unknown belongs to, one after the other
    form : how matrices are stored and factorized
    twice : so many first entries stand for a second one if the matrix is symmetric.  They are 0 unless some unknowns
        move together: only then several entries may have one place
    """

    def __init__(self, row: np.ndarray, column: np.ndarray, piece: np.ndarray, form: _Form, twice: int):
        self._form = form
        self._entry = entry = np.flatnonzero((row >= 0) & (column >= 0))
        row, column = row[entry], column[entry]
        gap = np.abs(row - column)
        self._twice = np.where((entry < twice) & (gap == 0) & form.symmetric, 2.0, 1.0) if twice else None
        width = _largest(gap, row, piece)
        kind = np.frexp(width)[1]  # of one kind are those up to the same power of two
        count = np.bincount(kind[piece], minlength=1)
        there = np.flatnonzero(count)
        self._order, self._piece = None, piece
        if len(there) > 1:
            self._order = np.argsort(kind[piece], kind="stable")
            self._piece = piece[self._order]
            place = places(self._order)
            row, column = place[row], place[column]
        ends = np.cumsum(count[there]).tolist()
        self._columns = [slice(*both) for both in pairwise([0, *ends])]
        widest = np.array([width[kind == each].max() for each in there.tolist()], np.int64)
        height = np.repeat(form.height(widest), count[there])
        self._rows = form.height(widest).tolist()
        at, below = form.place(row, column, np.repeat(widest, count[there]))
        self._length, self._place = int(height.sum()), (np.cumsum(height) - height)[at] + below

    def factorized(self, entries: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The function that solves for right-hand sides (size, ...) with the matrix of the `entries` (e,).

        Raises `IndefiniteError`.
        """
        entries = entries[self._entry]
        solves, indefinite = [], []
        with one_thread():
            for band, its in zip(self._filled(entries), self._columns, strict=True):
                solve_band, failed = self._form.factorized(band)
                if failed:
                    indefinite.append(self._piece[its][failed - 1])
                solves.append(solve_band)
            if indefinite:
                raise IndefiniteError(np.unique([*indefinite, *self._indefinite(entries)]))

        def solve(rhs):
            if self._order is None:
                return solves[0](rhs) if solves else rhs
            result = np.empty(rhs.shape)
            for solve_band, its in zip(solves, self._columns, strict=True):
                result[self._order[its]] = solve_band(rhs[self._order[its]])
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
        """The pieces whose matrices cannot be factorized by themselves."""
        for band, its in zip(self._filled(entries), self._columns, strict=True):
            piece = self._piece[its]
            ends = np.flatnonzero(np.diff(piece, append=-1)) + 1
            for start, end in pairwise([0, *ends.tolist()]):
                _, failed = self._form.factorized(np.asfortranarray(band[:, start:end]))
                if failed:
                    yield piece[start]
