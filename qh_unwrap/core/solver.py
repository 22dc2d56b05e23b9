# SPDX-License-Identifier: GPL-3.0-or-later
"""Sparse direct solves: a nested-dissection ordering made once, and factorizations that reuse it."""

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array
from scipy.sparse.csgraph import maximum_bipartite_matching, reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, cg, splu

from .triangles import parts

_STEPS = 100  # of conjugate gradients
_LARGE = 1000  # unknowns, for which an old factorization is tried first, and new ones are in single precision
_PATIENCE = 12  # steps with an earlier factorization
_HUGE = 30_000  # unknowns, for which it pays to solve in single precision and to correct the solutions,
_CORRECTIONS = 6  # at most so many times,
_EXACT = 1e-6  # until the next correction would be by this part of them
_LEAF = 16
_FEW = 300  # vertices whose order hardly matters


class System:
    """Sparse matrices on one graph, factorized for every new set of entries.

    Parameters
    ----------
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    chosen : (2 k + n,), which of the entries that will be given belong to the matrix: by default, all

    A matrix is given by its entries (i, j), (j, i) and (i, i): arrays (k,), (k,) and (n,).
    """

    def __init__(self, order, edges, chosen=None):
        n = len(order)
        place = np.empty(n, dtype=np.int32)
        place[order] = np.arange(n, dtype=np.int32)
        i, j = place[edges.T]
        where = np.concatenate([i, j, place]), np.concatenate([j, i, place])
        chosen = np.arange(2 * len(edges) + n) if chosen is None else chosen
        pattern = coo_array((chosen, where), shape=(n, n)).tocsc()
        self._order = order
        self._entry, self._indices, self._indptr = pattern.data, pattern.indices, pattern.indptr
        self._mean = self._blocks = None

    def factor(self, forward, backward, diagonal):
        """A solver of right-hand sides (n, ...) for the matrix; of a huge one until six digits stand."""
        entries = np.concatenate([forward, backward, diagonal])[self._entry]
        factors = self._factors(entries, single=len(self._order) >= _HUGE)

        def solve(rhs):
            result = np.empty_like(rhs)
            result[self._order] = factors.solve_exactly(rhs[self._order])
            return result

        return solve

    def block_matrix(self, beside, own):
        """The symmetric matrix for `solve_blocks` of 2 by 2 blocks [[m + d, s - a], [s + a, m - d]].

        `beside` is (m, d, s, a), (k,) each, of the blocks (i, j), and `own` (m, d, s), (n,) each, of the blocks (i, i),
        which are symmetric.  Holds until the next one is made.
        """
        n, k = len(self._order), len(beside[0])
        rows = [np.concatenate(both) for both in zip(beside, (*own, np.zeros(len(own[0]))), strict=True)]
        if self._blocks is None:
            self._blocks = np.empty((len(self._entry), 2, 2))
        for part in parts(len(self._entry)):
            entry, blocks = self._entry[part], self._blocks[part]
            ahead = entry < k
            place = np.where(ahead, entry, entry - k)
            m, d, s, a = (row[place] for row in rows)
            # The pattern is by columns, and what stands there is taken for rows: transpose.
            a = np.where(ahead, -a, a)
            blocks[:, 0, 0], blocks[:, 1, 1] = m + d, m - d
            blocks[:, 0, 1], blocks[:, 1, 0] = s - a, s + a
        return bsr_array((self._blocks, self._indices, self._indptr), shape=(2 * n, 2 * n))

    def solve_blocks(self, matrix, rhs, residual):
        """Solve a positive definite system of blocks until a `residual` by that part of `rhs` (n, 2).

        Conjugate gradients, with the mean of both coordinates' own matrices as preconditioner.
        """
        n = len(self._order)
        rhs = rhs[self._order]
        solution = np.zeros(2 * n)
        tried, missed = self._mean is not None, True
        if tried:  # that of an earlier matrix may still do
            solution, missed = self._conjugate_gradients(matrix, rhs, residual, solution, _PATIENCE)
        if missed:
            self._mean = None  # before there is another: both would take twice the memory
            self._mean = self._factors((matrix.data[:, 0, 0] + matrix.data[:, 1, 1]) / 2, single=n >= _LARGE)
            solution, missed = self._conjugate_gradients(matrix, rhs, residual, solution, _STEPS)
            if missed and self._mean.sharpened():
                solution, _ = self._conjugate_gradients(matrix, rhs, residual, np.zeros(2 * n), _STEPS)
            if tried or n < _LARGE:
                self._mean = None
        result = np.empty_like(rhs)
        result[self._order] = solution.reshape(-1, 2)
        return result

    def _conjugate_gradients(self, matrix, rhs, residual, start, steps):
        mean = LinearOperator(matrix.shape, lambda rest: self._mean.solve(rest.reshape(-1, 2)).ravel(), dtype=float)
        return cg(matrix, rhs.ravel(), start, rtol=residual, maxiter=steps, M=mean)

    def _factors(self, entries, single):
        n = len(self._order)
        return _Factors(csc_array((entries, self._indices, self._indptr), shape=(n, n)), single)


class _Factors:
    """L and U of a matrix in its own order, if wanted in single precision, which takes less time and memory."""

    def __init__(self, matrix, single):
        self._matrix = matrix
        self._kind = np.float32 if single else np.float64
        self._factorize()

    def _factorize(self):
        # The order is ours, and the matrices are dominated by their diagonals: no column ordering, no pivoting.
        options = {"SymmetricMode": True}
        try:
            with np.errstate(over="ignore"):
                matrix = self._matrix.astype(self._kind, copy=False)
            self._factors = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)
        except RuntimeError:  # singular
            if not self.sharpened():
                raise

    def sharpened(self):
        """Factorize in double precision, unless that is done: then it returns False."""
        if self._kind == np.float64:
            return False
        self._kind, self._factors = np.float64, None
        self._factorize()
        return True

    def solve(self, rhs):
        """To the factors' precision."""
        with np.errstate(over="ignore"):
            solution = self._factors.solve(rhs.astype(self._kind, order="F", copy=False))  # as SuperLU has it
        return solution.astype(np.float64, order="C", copy=False)

    def solve_exactly(self, rhs):
        """As exactly as positions need it, by corrections (Wilkinson's iterative refinement) in single precision."""
        solution = self.solve(rhs)
        if self._kind == np.float64:
            return solution
        size = np.linalg.norm(solution)
        for _ in range(_CORRECTIONS):
            correction = self.solve(rhs - self._matrix @ solution)
            solution += correction
            before, size = size, np.linalg.norm(correction)
            if size == 0 or size * (size / before) <= _EXACT * np.linalg.norm(solution):
                return solution
        self.sharpened()
        return self.solve(rhs)


class Dirichlet:
    """Solves `sum_j w_ij (f_i - f_j) = g_i` (eq. 2, with a source g) for the free vertices while the others are held.

    Parameters
    ----------
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    held : (n,) bool
    values : (n, 2), used where `held`

    Its `system` is that of the `free` vertices, and chooses their entries from those of all.
    """

    def __init__(self, order, edges, held, values):
        self.held = held
        self.values = np.where(held[:, None], values, 0.0)
        self.free = np.flatnonzero(~held)
        self._edges = edges
        k = len(edges)
        inner = np.flatnonzero(~held[edges.T].any(axis=0))
        local = np.cumsum(~held) - 1
        order, edges = local[order[~held[order]]], local[edges[inner]]
        self.system = System(order, edges, np.concatenate([inner, k + inner, 2 * k + self.free]))

    def diagonal(self, weights):
        """The sum of the weights around every vertex, (n,)."""
        i, j = self._edges.T
        n = len(self.held)
        return np.bincount(i, weights[0], n) + np.bincount(j, weights[1], n)

    def solve(self, weights):
        """All vertices (n, 2), for the weights (2, k) and no source."""
        return self.factor(weights)(self.values)

    def factor(self, weights):
        """A function of values (n, c), used where held, and sources (n, c) that solves for all vertices (n, c)."""
        i, j = self._edges.T
        n = len(self.held)
        if len(self.free):
            solve = self.system.factor(-weights[0], -weights[1], self.diagonal(weights))

        def result(values, sources=0.0):
            values = np.where(self.held[:, None], values, 0.0)
            if len(self.free):
                flux = [
                    np.bincount(i, weights[0] * known[j], n) + np.bincount(j, weights[1] * known[i], n)
                    for known in values.T
                ]
                values[self.free] = solve((np.array(flux).T + sources)[self.free])
            return values

        return result


def banded(n, edges):
    """An elimination order (n,) that suits a small graph, or many of them: neighbours come soon after one another."""
    graph = coo_array((np.ones(len(edges), np.int8), tuple(edges.T)), shape=(n, n))
    return reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True).astype(np.int64)


def nested_dissection(points, edges):
    """An elimination order (n,) with little fill, by recursive bisection of `points` (n, d).

    All pieces of one level are halved at once, each at the median of the coordinate that cuts the fewest edges; the
    smallest set of vertices that meets every cut edge (Koenig's theorem) separates the halves and is ordered last.
    """
    n, axes = points.shape
    if len(edges) and n <= _FEW:
        return banded(n, edges)
    levels = max(0, int(np.ceil(np.log2(max(n, 1) / _LEAF))))
    piece = np.zeros(n, np.int16)  # -1 once in a separator; short numbers are sorted faster
    key = np.zeros(n, dtype=np.int64)  # one base-3 digit a level: first half 0, second half 1, separator 2
    orders = [np.argsort(points[:, axis], kind="stable") for axis in range(axes)]
    i, j = edges.T.astype(np.intp, order="C")
    for level in range(levels):
        half, orders = _halves(piece, orders, i, j)
        cut = half[i] != half[j]
        crossing = np.flatnonzero(cut)
        separator = _vertex_cover(np.column_stack([i[crossing], j[crossing]]), half)
        inside = piece >= 0
        key *= 3
        key += np.where(inside, half, 0)
        key[separator] += 2 - half[separator]
        if level == 15:
            piece = piece.astype(np.int32)  # no longer short enough
        piece = np.where(inside, 2 * piece + half, piece.dtype.type(-1))
        piece[separator] = -1
        inside = piece >= 0
        kept = np.flatnonzero(~cut & inside[i] & inside[j])
        i, j = i[kept], j[kept]
    return np.argsort(key, kind="stable")


def _halves(piece, orders, i, j):
    """Which half (0 or 1) of its piece each vertex falls in; and `orders`, sorted by piece as well."""
    size = np.bincount(piece[piece >= 0], minlength=1)
    place = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    second = (2 * place >= np.repeat(size, size)).astype(np.int8)
    candidates, cuts, grouped = [], [], []
    for order in orders:
        order = order[np.argsort(piece[order], kind="stable")]
        order = order[len(order) - len(second) :]  # those in separators come first
        grouped.append(order)
        half = np.zeros(len(piece), dtype=np.int8)
        half[order] = second
        candidates.append(half)
        crossing = np.flatnonzero(half[i] != half[j])
        cuts.append(np.bincount(piece[i[crossing]], minlength=len(size)))
    best = np.argmin(cuts, axis=0)
    return np.choose(best[np.maximum(piece, 0)], candidates), grouped


def _vertex_cover(edges, half):
    """The fewest vertices that touch all `edges`, each of which joins half 0 to half 1."""
    edges = np.where((half[edges[:, 0]] == 0)[:, None], edges, edges[:, ::-1])
    left, row = np.unique(edges[:, 0], return_inverse=True)
    right, column = np.unique(edges[:, 1], return_inverse=True)
    graph = coo_array((np.ones(len(row), np.int8), (row, column)), shape=(len(left), len(right))).tocsr()
    partner = maximum_bipartite_matching(graph, perm_type="row")  # of each right vertex
    matched = np.zeros(len(left), bool)
    matched[partner[partner >= 0]] = True
    # Everything on alternating paths from the unmatched left vertices
    left_reached, right_reached = ~matched, np.zeros(len(right), bool)
    new = left_reached
    while new.any():
        on_path = new[row]
        fresh = np.zeros(len(right), bool)
        fresh[column[on_path]] = True
        fresh &= ~right_reached
        right_reached |= fresh
        new = np.zeros(len(left), bool)
        new[partner[fresh]] = True
        new &= ~left_reached
        left_reached |= new
    return np.concatenate([left[~left_reached], right[right_reached]])
