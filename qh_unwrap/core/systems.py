# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear systems on the graph of a map's vertices, some of whose coordinates are held or move together.

The pattern of the matrices is found once; every new set of weights is only put in its place and factorized.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array

from .factors import Factorizer, Factors, superlu
from .triangles import parts

_STEPS = 100  # of conjugate gradients, at most
# Of one piece; islands that go together with others have fewer unknowns.
_LARGE = 30_000  # unknowns, from which on single precision pays, and old factors are tried first
_PATIENCE = 7  # steps of conjugate gradients that an old factorization may take


class Unknowns:
    """The unknowns of one coordinate, numbered in the order in which they are eliminated.

    Parameters
    ----------
    order : (n,), the vertices in that order
    held : (n,) bool, vertices whose coordinate is no unknown
    partner : (n,), for every vertex the one that it moves together with, itself if with none; None for nobody
    """

    def __init__(self, order: np.ndarray, held: np.ndarray, partner: np.ndarray | None = None):
        self.tied = partner is not None and bool((partner != np.arange(len(order))).any())
        if self.tied:
            leader = _leaders(partner)
            stuck = np.bincount(leader, held, len(order)) > 0  # who is tied to a held vertex is held as well
            held = held | stuck[leader]
            leads = leader == np.arange(len(order))
        else:
            leader, leads = np.arange(len(order)), True
        self.held = held
        self.sequence = order[(~held & leads)[order]]
        self.number = np.full(len(order), -1)
        self.number[self.sequence] = np.arange(len(self.sequence))
        self.number = self.number[leader]
        self.leader = leader

    def __len__(self):
        return len(self.sequence)

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) at the vertices, added up for every unknown."""
        if not self.tied:
            return values[self.sequence]
        result = np.zeros((len(self), *values.shape[1:]))
        free = ~self.held
        np.add.at(result, self.number[free], values[free])
        return result

    def spread(self, values: np.ndarray, out: np.ndarray) -> None:
        """Add the unknowns' values to those (n, ...) of their vertices."""
        if not self.tied:
            out[self.sequence] += values
        else:
            free = ~self.held
            out[free] += values[self.number[free]]


def _leaders(partner):
    """The first vertex of every set of vertices that are tied to one another, (n,)."""
    leader = np.minimum(partner, np.arange(len(partner)))
    while True:
        smaller = leader.copy()
        np.minimum.at(smaller, partner, leader)
        smaller = np.minimum(smaller, smaller[partner])
        smaller = smaller[smaller]
        if (smaller == leader).all():
            return leader
        leader = smaller


class Pattern:
    """Where the entries of matrices on one graph go.

    A matrix is given by its entries (i, j), (j, i) for the edges, (k,) each, and (i, i) for the vertices, (n,).
    """

    def __init__(self, unknowns: Unknowns, edges: np.ndarray):
        self.size = size = len(unknowns)
        k = len(edges)
        i, j = unknowns.number[edges.T]
        inner = np.flatnonzero((i >= 0) & (j >= 0))
        free = np.flatnonzero(unknowns.number >= 0)
        i, j, own = i[inner], j[inner], unknowns.number[free]
        entry = np.concatenate([inner, k + inner, 2 * k + free])
        row, column = np.concatenate([i, j, own]), np.concatenate([j, i, own])
        self._slot = None
        if unknowns.tied:  # several entries may fall into one place
            key, self._slot = np.unique(column * np.int64(size) + row, return_inverse=True)
            self._entry = entry
            self.indices = (key % max(size, 1)).astype(np.int32)
            count = np.bincount(key // max(size, 1), minlength=size)
            self.indptr = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        else:
            where = row.astype(np.int32), column.astype(np.int32)
            pattern = coo_array((entry, where), shape=(size, size)).tocsc()
            self._entry, self.indices, self.indptr = pattern.data, pattern.indices, pattern.indptr
        nothing = np.empty(len(self.indices))
        self._places: tuple[np.ndarray, np.ndarray] | None = None  # of entries in blocks, and which are to be turned
        self._empty = csc_array((nothing, self.indices, self.indptr), shape=(self.size, self.size))

    def matrix(self, forward: np.ndarray, backward: np.ndarray, diagonal: np.ndarray) -> csc_array:
        entries = np.concatenate([forward, backward, diagonal])[self._entry]
        if self._slot is not None:
            entries = np.bincount(self._slot, entries, len(self.indices))
        matrix = copy(self._empty)  # checked once
        matrix.data = entries
        return matrix

    def block_matrix(
        self, beside: Sequence[np.ndarray], own: Sequence[np.ndarray], earlier: bsr_array | None = None
    ) -> bsr_array:
        """The symmetric matrix of 2 by 2 blocks [[m + d, s - a], [s + a, m - d]], where no vertices are tied.

        `beside` is (m, d, s, a), (k,) each, of the blocks (i, j), and `own` (m, d, s), (n,) each, of the blocks (i, i),
        which are symmetric.  An `earlier` matrix is overwritten: fresh memory takes longer.
        """
        k = len(beside[0])
        rows = [np.concatenate(both) for both in zip(beside, (*own, np.zeros(len(own[0]))), strict=True)]
        if earlier is None:
            blocks, shape = np.empty((len(self._entry), 2, 2)), (2 * self.size, 2 * self.size)
            earlier = bsr_array((blocks, self.indices, self.indptr), shape=shape)
        blocks = earlier.data
        if self._places is None:
            ahead = self._entry < k
            self._places = np.where(ahead, self._entry, self._entry - k), ahead
        for part in parts(len(self._entry)):
            place, ahead, block = *(each[part] for each in self._places), blocks[part]
            m, d, s, a = (row[place] for row in rows)
            # The pattern is by columns, and what stands there is taken for rows: transpose.
            np.negative(a, out=a, where=ahead)
            block[:, 0, 0], block[:, 1, 1] = m + d, m - d
            block[:, 0, 1], block[:, 1, 0] = s - a, s + a
        return earlier


class Constrained:
    """Solves for the free coordinates of vertices while others are held, or move together.

    Parameters
    ----------
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    held : (n,) bool, or (n, 2) for each coordinate
    values : (n, 2), where the held coordinates are
    partner : (n, 2), for each vertex's coordinate the vertex that it keeps its distance from in `values`; None for
        nobody
    group : (n,), the piece that each vertex belongs to; no edge joins two of them
    """

    def __init__(
        self,
        order: np.ndarray,
        edges: np.ndarray,
        held: np.ndarray,
        values: np.ndarray,
        partner: np.ndarray | None = None,
        group: np.ndarray | None = None,
        factorizer: Factorizer = superlu,
    ):
        held = np.broadcast_to(held[:, None] if held.ndim == 1 else held, (len(order), 2))
        partners = (None, None) if partner is None else partner.T
        alike = (held[:, 0] == held[:, 1]).all() and (partner is None or (partner[:, 0] == partner[:, 1]).all())
        self.edges = edges
        self.unknowns = [Unknowns(order, *one) for one in list(zip(held.T, partners, strict=True))[: 1 if alike else 2]]
        self.alike = len(self.unknowns) == 1
        self.patterns = [Pattern(unknowns, edges) for unknowns in self.unknowns]
        self.held = np.column_stack([self.unknowns[0].held, self.unknowns[-1].held])
        self.values = values
        self.order, self._factorizer = order, factorizer
        self._group = None if group is None or not len(group) or (group == group[0]).all() else group
        self._mean: list[Factors] | None = None  # those of the last equations,
        self._serves_on = False  # and whether they may do for the next,
        self._product: Callable[[np.ndarray], np.ndarray] | None = None  # and their Hessian
        self._matrix: bsr_array | None = None
        self._all: Pattern | None = None

    def refixed(self, held: np.ndarray, values: np.ndarray, partner: np.ndarray | None = None) -> Constrained:
        """The same with other things held: with the same pattern and factors, if only the values differ."""
        if partner is None and not any(one.tied for one in self.unknowns) and np.array_equal(held, self.held):
            self.values = values
            return self
        return Constrained(self.order, self.edges, held, values, partner, self._group, self._factorizer)

    def _is_alone(self, size):
        """Whether there is one piece only, of that many unknowns: what suits large ones must not depend on company."""
        return self._group is None and self.patterns[0].size >= size

    @property
    def fixed(self) -> np.ndarray:
        """(n, 2): the value where a coordinate is held, the distance to its partner where it has one, else 0."""
        fixed = np.where(self.held, self.values, 0.0)
        for c, unknowns in enumerate((self.unknowns[0], self.unknowns[-1])):
            if unknowns.tied:
                apart = self.values[:, c] - self.values[unknowns.leader, c]
                fixed[:, c] = np.where(unknowns.held, self.values[:, c], apart)
        return fixed

    def diagonal(self, weights: np.ndarray) -> np.ndarray:
        """The sum of the weights (2, k) around every vertex, (n,)."""
        i, j = self.edges.T
        n = len(self.order)
        return np.bincount(i, weights[0], n) + np.bincount(j, weights[1], n)

    def solve(self, weights: np.ndarray) -> np.ndarray:
        """All vertices (n, 2) for which `sum_j w_ij (f_i - f_j) = 0` (eq. 2), for the weights (2, k)."""
        return self.factor(weights)(self.fixed)

    def factor(self, weights: np.ndarray) -> Callable[..., np.ndarray]:
        """A function of fixed values (n, c), as `fixed` has them, and sources (n, c) that solves
        `sum_j w_ij (f_i - f_j) = g_i` for all vertices (n, c).
        """
        i, j = self.edges.T
        n = len(self.order)
        diagonal = self.diagonal(weights)
        solvers = [
            self._factorizer(pattern.matrix(-weights[0], -weights[1], diagonal), self._is_alone(_LARGE))
            if pattern.size
            else None
            for pattern in self.patterns
        ]
        tied = any(unknowns.tied for unknowns in self.unknowns)

        def result(fixed, sources=0.0):
            flux = np.array(
                [np.bincount(i, weights[0] * x[j], n) + np.bincount(j, weights[1] * x[i], n) for x in fixed.T]
            ).T
            if tied:
                flux -= diagonal[:, None] * fixed
            flux = flux + sources
            values = fixed.copy()
            each = [slice(None)] if self.alike else [slice(0, 1), slice(1, 2)]
            for columns, unknowns, factors in zip(each, self.unknowns, solvers, strict=True):
                if factors is not None:
                    unknowns.spread(factors.solve_exactly(unknowns.gathered(flux[:, columns])), values[:, columns])
            return values

        return result

    def newton_direction(
        self,
        gradient: np.ndarray,
        beside: Sequence[np.ndarray],
        own: Sequence[np.ndarray],
        residual: np.ndarray | float,
    ) -> np.ndarray:
        """The direction (n, 2) of Newton's step, 0 where held, for a `gradient` (n, 2) and a positive definite Hessian
        of blocks as `Pattern.block_matrix` takes them, up to a `residual` relative to the gradient in every piece: one
        number, or (p,).

        By conjugate gradients, with both coordinates' own matrices as preconditioner: their mean, where the same
        vertices are free in both.
        """
        direction = np.zeros(gradient.shape)
        if self.held.all():
            return direction
        hessian = self._product = self._hessian(beside, own)
        rhs = self._downhill(gradient)
        solution, missed = np.zeros_like(rhs), True
        tried = self._serves_on
        if tried:
            solution, missed = self._conjugate_gradients(hessian, rhs, solution, residual, _PATIENCE)
        if missed:
            self._mean = None  # before there is another: both would take twice the memory
            self._mean = [self._preconditioner(c, beside, own) for c in range(len(self.unknowns))]
            solution, missed = self._conjugate_gradients(hessian, rhs, solution, residual, _STEPS)
            sharper = [factors.sharpened() for factors in self._mean] if missed else []
            if any(sharper):
                solution, _ = self._conjugate_gradients(hessian, rhs, np.zeros_like(rhs), residual, _STEPS)
            self._serves_on = self._is_alone(_LARGE) and not tried
        self._scattered(solution, direction)
        return direction

    def next_direction(self, gradient: np.ndarray, residual: np.ndarray | float) -> np.ndarray:
        """The same for another gradient, with the Hessian that the last direction was for."""
        direction = np.zeros(gradient.shape)
        if self._product is not None:
            rhs = self._downhill(gradient)
            solution, _ = self._conjugate_gradients(self._product, rhs, np.zeros_like(rhs), residual, _STEPS)
            self._scattered(solution, direction)
        return direction

    def direction(self, gradient: np.ndarray, beside: np.ndarray, own: np.ndarray) -> np.ndarray:
        """The same for a Hessian that is alike in both coordinates and does not mix them: `beside` (k,) is the mean
        part at the edges, `own` (n,) that at the vertices.
        """
        direction = np.zeros(gradient.shape)
        if self.held.all():
            return direction
        factors = [self._factors(c, beside, own) for c in range(len(self.unknowns))]
        self._scattered(self._solved(factors, self._downhill(gradient)), direction)
        return direction

    def _downhill(self, gradient):
        """Against the gradient (n, 2), for the unknowns, as conjugate gradients take them."""
        if self.alike:
            return -self.unknowns[0].gathered(gradient)
        return -np.concatenate([self.unknowns[c].gathered(gradient[:, c]) for c in (0, 1)])[:, None]

    def _scattered(self, solution, out):
        if self.alike:
            self.unknowns[0].spread(solution, out)
        else:
            first = len(self.unknowns[0])
            for c, values in enumerate((solution[:first, 0], solution[first:, 0])):
                self.unknowns[c].spread(values, out[:, c])

    def _preconditioner(self, c, beside, own):
        """The factors of one coordinate's own matrix; of both, if they are alike, the mean's."""
        m, d = (beside[0], own[0]), (beside[1], own[1])
        if not self.alike:
            sign = 1 - 2 * c
            m = m[0] + sign * d[0], m[1] + sign * d[1]
        return self._factors(c, *m)

    def _factors(self, c, beside, own):
        pattern = self.patterns[c]
        return self._factorizer(pattern.matrix(beside, beside, own), self._is_alone(_LARGE))

    def _hessian(self, beside: Sequence[np.ndarray], own: Sequence[np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        """The product of the Hessian with values of the unknowns, shaped as these."""
        if self.alike and not self.unknowns[0].tied:
            matrix = self._matrix = self.patterns[0].block_matrix(beside, own, self._matrix)
            return lambda values: (matrix @ values.ravel()).reshape(values.shape)
        # What is not free in both coordinates alike has no blocks: multiply with those of all vertices.
        if self._all is None:
            self._all = Pattern(Unknowns(self.order, np.zeros(len(self.order), bool)), self.edges)
        matrix = self._matrix = self._all.block_matrix(beside, own, self._matrix)

        def product(values):
            moved = np.zeros((len(self.order), 2))
            self._scattered(values, moved)
            force = np.empty_like(moved)
            force[self.order] = (matrix @ moved[self.order].ravel()).reshape(-1, 2)
            if self.alike:
                return self.unknowns[0].gathered(force)
            return np.concatenate([self.unknowns[c].gathered(force[:, c]) for c in (0, 1)])[:, None]

        return product

    def _solved(self, factors, rest):
        if self.alike:
            return factors[0].solve(rest)
        first = len(self.unknowns[0])
        halves = zip(factors, (rest[:first], rest[first:]), strict=True)
        return np.concatenate([each.solve(half) for each, half in halves])

    def _conjugate_gradients(self, product, rhs, solution, residual, steps):
        """A solution and whether it misses the `residual` somewhere; every piece takes steps of its own length."""
        if self._group is None:
            dot, at_unknowns, ratio = np.vdot, float, _ratio_of_numbers
            residual = float(np.max(residual))
        else:
            group = np.concatenate([self._group[unknowns.sequence] for unknowns in self.unknowns])
            count = int(self._group.max()) + 1
            ratio = _ratio

            def dot(one, other):
                return np.bincount(group, np.einsum("nc,nc->n", one, other), count)

            def at_unknowns(values):
                return values[group, None]

        rest = rhs - product(solution) if solution.any() else rhs.copy()
        enough = residual**2 * dot(rhs, rhs)
        unfinished = dot(rest, rest) > enough
        search, old = None, 1.0
        for _ in range(steps):
            if not np.any(unfinished):
                break
            improved = self._solved(self._mean, rest)
            new = dot(rest, improved)
            if search is None:
                search = improved
            else:
                search *= at_unknowns(ratio(new, old))
                search += improved
            force = product(search)
            length = at_unknowns(unfinished * ratio(new, dot(search, force)))
            solution = solution + length * search
            force *= length
            rest -= force
            unfinished = dot(rest, rest) > enough
            old = new
        return solution, bool(np.any(unfinished))


def _ratio_of_numbers(one, other):
    return one / other if other else 0.0


def _ratio(one, other):
    # 0 where a piece is finished exactly
    return np.where(other != 0, one / np.where(other != 0, other, 1.0), 0.0)
