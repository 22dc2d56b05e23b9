# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear systems on the graph of a map's vertices, some of whose coordinates are held or move together.

The pattern of the matrices is found once; every new set of weights is only put in its place and factorized.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np

from .bands import Banded, IndefiniteError, are_narrow, widths
from .factors import Factorizer, superlu
from .patterns import Unknowns, places
from .sparse import Sparse


class Equations(Protocol):
    """Equations for some of the vertices' coordinates, all others of which stay."""

    def newton_direction(
        self,
        gradient: np.ndarray,
        beside: Sequence[np.ndarray],
        own: Sequence[np.ndarray],
        residual: np.ndarray | float,
    ) -> np.ndarray:
        """As that of `Constrained`."""
        ...

    def next_direction(self, gradient: np.ndarray, residual: np.ndarray | float) -> np.ndarray:
        """As that of `Constrained`."""
        ...

    def solver(
        self, forward: np.ndarray, backward: np.ndarray, own: np.ndarray, exactly: bool
    ) -> Callable[[np.ndarray, np.ndarray], None]:
        """Solves each coordinate's equations by themselves; the matrix has the entries (i, j) and (j, i), (k,) each,
        for the edges, and (i, i), (n,), for the vertices.

        Returns a function of right-hand sides (n, c) and values (n, c), to which it adds the solution: as exactly as
        positions need it, or as the factors have it.
        """
        ...


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
        self.held = np.column_stack([self.unknowns[0].held, self.unknowns[-1].held])
        self.values = values
        self.order, self._factorizer = order, factorizer
        self._group = None if group is None or not len(group) or (group == group[0]).all() else group
        self._partners = partners
        self._last: list[Equations] = []  # whose Hessian is known

    def refixed(self, held: np.ndarray, values: np.ndarray, partner: np.ndarray | None = None) -> Constrained:
        """The same with other things held: with the same pattern and factors, if only the values differ."""
        if partner is None and not any(one.tied for one in self.unknowns) and np.array_equal(held, self.held):
            self.values = values
            return self
        return Constrained(self.order, self.edges, held, values, partner, self._group, self._factorizer)

    @cached_property
    def _narrow(self) -> np.ndarray:
        """(p,) bool, the pieces that are bands: what suits each depends on it alone, and not on its company."""
        place, edges = places(self.order), self.edges
        if any(unknowns.tied for unknowns in self.unknowns):  # which brings together what is far apart
            u, v = self.unknowns[0].leader, self.unknowns[-1].leader
            pairs = [(one[edges[:, 0]], other[edges[:, 1]]) for one in (u, v) for other in (u, v)]
            edges = np.hstack([*pairs, (u, v)]).T
        return are_narrow(widths(place, edges, self._group), len(place), self._group)

    @cached_property
    def _equations(self) -> list[Equations]:
        """Those of all pieces, unless the matrices of narrow ones are indefinite."""
        return self._apart(self._narrow)

    @cached_property
    def _everything(self) -> Sparse:
        """Those of all pieces as sparse ones."""
        return self._sparse(np.ones(len(self.order), bool), self.alike)

    def _apart(self, narrow):
        """Those of the `narrow` pieces, (p,) bool, and those of the others that are free in U and V alike, or not."""
        alike = np.ones(len(narrow), bool)
        if not self.alike:
            u, v = self.unknowns
            differs = (u.held != v.held) | (u.leader != v.leader)
            alike[0 if self._group is None else self._group[differs]] = False
        found: list[Equations] = []
        if narrow.any():
            found.append(Banded(self._unknowns_of(self._at(narrow), self.alike), self.order, self.edges, self._group))
        for chosen, is_alike in ((~narrow & alike, True), (~narrow & ~alike, False)):
            if chosen.all() and is_alike == self.alike:
                found.append(self._everything)
            elif chosen.any():
                found.append(self._sparse(self._at(chosen), is_alike))
        return found

    def _asked(self, ask):
        """What each of the equations answers, and these; pieces that prove to be indefinite are asked another way."""
        narrow, equations = self._narrow, self._equations
        while True:
            try:
                return [ask(each) for each in equations], equations
            except IndefiniteError as fault:
                narrow = narrow & ~np.isin(np.arange(len(narrow)), fault.pieces)
                equations = self._apart(narrow)

    def _at(self, pieces):
        """The values (p,) of the pieces at their vertices, (n,)."""
        return np.full(len(self.order), pieces[0]) if self._group is None else pieces[self._group]

    def _sparse(self, chosen, alike):
        return Sparse(self._unknowns_of(chosen, alike), self.order, self.edges, self._group, self._factorizer)

    def _unknowns_of(self, chosen, alike):
        """The unknowns at the chosen vertices (n,) bool, those of whole pieces, of both coordinates if they are `alike`
        there, else of each."""
        if chosen.all() and alike == self.alike:
            return self.unknowns
        each = list(zip(self.unknowns, self._partners, strict=False))[: 1 if alike else 2]
        return [Unknowns(self.order, unknowns.held | ~chosen, partner) for unknowns, partner in each]

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
        solvers = self._solvers(-weights[0], -weights[1], diagonal, True)
        tied = any(unknowns.tied for unknowns in self.unknowns)

        def result(fixed, sources=0.0):
            flux = np.array(
                [np.bincount(i, weights[0] * x[j], n) + np.bincount(j, weights[1] * x[i], n) for x in fixed.T]
            ).T
            if tied:
                flux -= diagonal[:, None] * fixed
            flux = flux + sources
            values = fixed.copy()
            for solve in solvers:
                solve(flux, values)
            return values

        return result

    def _solvers(self, forward, backward, own, exactly):
        return self._asked(lambda each: each.solver(forward, backward, own, exactly))[0]

    def newton_direction(
        self,
        gradient: np.ndarray,
        beside: Sequence[np.ndarray],
        own: Sequence[np.ndarray],
        residual: np.ndarray | float,
    ) -> np.ndarray:
        """The direction (n, 2) of Newton's step, 0 where held, for a `gradient` (n, 2) and a positive definite Hessian
        of blocks as `Pattern.block_matrix` takes them, at most a `residual` away, relative to the gradient in every
        piece: one number, or (p,).
        """
        if self.held.all():
            return np.zeros(gradient.shape)
        given = gradient, beside, own, residual
        found, self._last = self._asked(lambda each: each.newton_direction(*given))
        return np.sum(found, axis=0)

    def next_direction(self, gradient: np.ndarray, residual: np.ndarray | float) -> np.ndarray:
        """The same for another gradient, with the Hessian that the last direction was for."""
        return sum((each.next_direction(gradient, residual) for each in self._last), np.zeros(gradient.shape))

    def direction(self, gradient: np.ndarray, beside: np.ndarray, own: np.ndarray) -> np.ndarray:
        """The same for a Hessian that is alike in both coordinates and does not mix them: `beside` (k,) is the mean
        part at the edges, `own` (n,) that at the vertices.
        """
        direction = np.zeros(gradient.shape)
        if not self.held.all():
            for solve in self._solvers(beside, beside, own, False):
                solve(-gradient, direction)
        return direction
