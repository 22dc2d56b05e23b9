# SPDX-License-Identifier: GPL-3.0-or-later
"""Equations of pieces of any form: sparse factors of each coordinate's own matrix, and conjugate gradients for both."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import bsr_array

from .factors import Factorizer, Factors
from .patterns import Pattern, Unknowns, solved_each

_STEPS = 100  # of conjugate gradients, at most
# Of one piece; islands that go together with others have fewer unknowns.
_LARGE = 30_000  # unknowns, from which on single precision pays, and old factors are tried first
_PATIENCE = 7  # steps of conjugate gradients that an old factorization may take


class Sparse:
    """Equations on any graph.

    Parameters
    ----------
    unknowns : of each coordinate, or of both
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    group : (n,), the piece that each vertex belongs to, or None
    factorizer : for each coordinate's own matrix
    """

    def __init__(
        self,
        unknowns: Sequence[Unknowns],
        order: np.ndarray,
        edges: np.ndarray,
        group: np.ndarray | None,
        factorizer: Factorizer,
    ):
        self._unknowns, self._order, self._edges, self._group = unknowns, order, edges, group
        self._factorizer, self._alike = factorizer, len(unknowns) == 1
        self._patterns = [Pattern(each, edges) for each in unknowns]
        self._mean: list[Factors] | None = None  # those of the last equations,
        self._serves_on = False  # and whether they may do for the next,
        self._product: Callable[[np.ndarray], np.ndarray] | None = None  # and their Hessian
        self._matrix: bsr_array | None = None
        self._all: Pattern | None = None

    def _is_alone(self, size):
        """Whether there is one piece only, of that many unknowns: what suits large ones must not depend on company."""
        return self._group is None and self._patterns[0].size >= size

    def solver(
        self, forward: np.ndarray, backward: np.ndarray, own: np.ndarray, exactly: bool
    ) -> Callable[[np.ndarray, np.ndarray], None]:
        factors = [self._factorized(c, forward, backward, own) for c in range(len(self._unknowns))]
        return solved_each(self._unknowns, [each.solve_exactly if exactly else each.solve for each in factors])

    def newton_direction(
        self,
        gradient: np.ndarray,
        beside: Sequence[np.ndarray],
        own: Sequence[np.ndarray],
        residual: np.ndarray | float,
    ) -> np.ndarray:
        """By conjugate gradients, with both coordinates' own matrices as preconditioner: their mean, where the same
        vertices are free in both."""
        direction = np.zeros(gradient.shape)
        hessian = self._product = self._hessian(beside, own)
        rhs = self._downhill(gradient)
        solution, missed = np.zeros_like(rhs), True
        tried = self._serves_on
        if tried:
            solution, missed = self._conjugate_gradients(hessian, rhs, solution, residual, _PATIENCE)
        if missed:
            self._mean = None  # before there is another: both would take twice the memory
            self._mean = [self._preconditioner(c, beside, own) for c in range(len(self._unknowns))]
            solution, missed = self._conjugate_gradients(hessian, rhs, solution, residual, _STEPS)
            sharper = [factors.sharpened() for factors in self._mean] if missed else []
            if any(sharper):
                solution, _ = self._conjugate_gradients(hessian, rhs, np.zeros_like(rhs), residual, _STEPS)
            self._serves_on = self._is_alone(_LARGE) and not tried
        self._scattered(solution, direction)
        return direction

    def next_direction(self, gradient: np.ndarray, residual: np.ndarray | float) -> np.ndarray:
        direction = np.zeros(gradient.shape)
        if self._product is not None:
            rhs = self._downhill(gradient)
            solution, _ = self._conjugate_gradients(self._product, rhs, np.zeros_like(rhs), residual, _STEPS)
            self._scattered(solution, direction)
        return direction

    def _downhill(self, gradient):
        """Against the gradient (n, 2), for the unknowns, as conjugate gradients take them."""
        if self._alike:
            return -self._unknowns[0].gathered(gradient)
        return -np.concatenate([self._unknowns[c].gathered(gradient[:, c]) for c in (0, 1)])[:, None]

    def _scattered(self, solution, out):
        if self._alike:
            self._unknowns[0].spread(solution, out)
        else:
            first = len(self._unknowns[0])
            for c, values in enumerate((solution[:first, 0], solution[first:, 0])):
                self._unknowns[c].spread(values, out[:, c])

    def _preconditioner(self, c, beside, own):
        """The factors of one coordinate's own matrix; of both, if they are alike, the mean's."""
        sign = 0 if self._alike else 1 - 2 * c
        m, d = beside[0] + sign * beside[1], own[0] + sign * own[1]
        return self._factorized(c, m, m, d)

    def _factorized(self, c, forward, backward, own):
        return self._factorizer(self._patterns[c].matrix(forward, backward, own), self._is_alone(_LARGE))

    def _hessian(self, beside: Sequence[np.ndarray], own: Sequence[np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        """The product of the Hessian with values of the unknowns, shaped as these."""
        if self._alike and not self._unknowns[0].tied:
            matrix = self._matrix = self._patterns[0].block_matrix(beside, own, self._matrix)
            return lambda values: (matrix @ values.ravel()).reshape(values.shape)
        # What is not free in both coordinates alike has no blocks: multiply with those of all vertices.
        if self._all is None:
            self._all = Pattern(Unknowns(self._order, np.zeros(len(self._order), bool)), self._edges)
        matrix = self._matrix = self._all.block_matrix(beside, own, self._matrix)

        def product(values):
            moved = np.zeros((len(self._order), 2))
            self._scattered(values, moved)
            force = np.empty_like(moved)
            force[self._order] = (matrix @ moved[self._order].ravel()).reshape(-1, 2)
            if self._alike:
                return self._unknowns[0].gathered(force)
            return np.concatenate([self._unknowns[c].gathered(force[:, c]) for c in (0, 1)])[:, None]

        return product

    def _solved(self, factors, rest):
        if self._alike:
            return factors[0].solve(rest)
        first = len(self._unknowns[0])
        halves = zip(factors, (rest[:first], rest[first:]), strict=True)
        return np.concatenate([each.solve(half) for each, half in halves])

    def _conjugate_gradients(self, product, rhs, solution, residual, steps):
        """A solution and whether it misses the `residual` somewhere; every piece takes steps of its own length."""
        if self._group is None:
            dot, at_unknowns, ratio = np.vdot, float, _ratio_of_numbers
            residual = float(np.max(residual))
        else:
            group = np.concatenate([self._group[unknowns.sequence] for unknowns in self._unknowns])
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
