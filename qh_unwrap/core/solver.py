# SPDX-License-Identifier: GPL-3.0-or-later
"""Sparse direct solves: a nested-dissection ordering made once, and factorizations that reuse it."""

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import maximum_bipartite_matching, reverse_cuthill_mckee
from scipy.sparse.linalg import splu

_LEAF = 4
_FEW = 300  # vertices whose order hardly matters


class System:
    """Sparse matrices on one graph, factorized for every new set of entries.

    Parameters
    ----------
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    width : unknowns of each vertex; entries are blocks (width, width)
    """

    def __init__(self, order, edges, width=1):
        n = len(order)
        place = np.empty(n, dtype=np.int64)
        place[order] = np.arange(n)
        i, j = place[edges].T
        part = np.arange(width)
        row = width * np.concatenate([i, j, place])[:, None, None] + part[:, None]
        column = width * np.concatenate([j, i, place])[:, None, None] + part
        row, column = (each.ravel() for each in np.broadcast_arrays(row, column))
        self._order = (width * order[:, None] + part).ravel()
        self._entry = np.lexsort((row, column))
        self._indices = row[self._entry].astype(np.int32)
        self._indptr = np.searchsorted(column[self._entry], np.arange(width * n + 1)).astype(np.int32)

    def factor(self, forward, backward, diagonal):
        """A solver of right-hand sides (width * n, ...) for the matrix with the entries (i, j), (j, i) and (i, i).

        Entries are (k, ...), (k, ...) and (n, ...), with blocks where `width` is not 1.
        """
        size = len(self._order)
        entries = np.concatenate([forward, backward, diagonal]).ravel()[self._entry]
        matrix = csc_array((entries, self._indices, self._indptr), shape=(size, size))
        # The order is ours, and the matrices are dominated by their diagonals: no column ordering, no pivoting.
        options = {"SymmetricMode": True}
        factors = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)

        def solve(rhs):
            result = np.empty_like(rhs)
            result[self._order] = factors.solve(rhs[self._order])
            return result

        return solve


class Dirichlet:
    """Solves `sum_j w_ij (f_i - f_j) = 0` (eq. 2) for the free vertices while the others are held.

    Parameters
    ----------
    order : (n,), in which the vertices are eliminated
    edges : (k, 2)
    held : (n,) bool
    values : (n, 2), used where `held`
    """

    def __init__(self, order, edges, held, values):
        self.held = held
        self.values = np.where(held[:, None], values, 0.0)
        self.free = np.flatnonzero(~held)
        self.inner = np.flatnonzero(~held[edges].any(axis=1))
        self._edges = edges
        self._order = order
        self._system = self.system()

    def system(self, width=1):
        """A `System` of the free vertices, in their order, and of the edges `inner` between them."""
        local = np.cumsum(~self.held) - 1
        return System(local[self._order[~self.held[self._order]]], local[self._edges[self.inner]], width)

    def diagonal(self, weights):
        """The sum of the weights around every vertex, (n,)."""
        i, j = self._edges.T
        n = len(self.held)
        return np.bincount(i, weights[0], n) + np.bincount(j, weights[1], n)

    def solve(self, weights):
        """All vertices (n, 2), for the weights (2, k)."""
        if not len(self.free):
            return self.values.copy()
        i, j = self._edges.T
        n = len(self.held)
        rhs = [
            np.bincount(i, weights[0] * known[j], n) + np.bincount(j, weights[1] * known[i], n)
            for known in self.values.T
        ]
        forward, backward = -weights[:, self.inner]
        solve = self._system.factor(forward, backward, self.diagonal(weights)[self.free])
        result = self.values.copy()
        result[self.free] = solve(np.column_stack(rhs)[self.free])
        return result


def nested_dissection(points, edges):
    """An elimination order (n,) with little fill, by recursive bisection of `points` (n, d).

    All pieces of one level are halved at once, each at the median of the coordinate that cuts the fewest edges; the
    smallest set of vertices that meets every cut edge (Koenig's theorem) separates the halves and is ordered last.
    """
    n, axes = points.shape
    if len(edges) and n <= _FEW:
        graph = coo_array((np.ones(len(edges), np.int8), tuple(edges.T)), shape=(n, n))
        return reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True).astype(np.int64)
    piece = np.zeros(n, dtype=np.int64)  # -1 once in a separator
    key = np.zeros(n, dtype=np.int64)  # one base-3 digit a level: first half 0, second half 1, separator 2
    orders = [np.argsort(points[:, axis], kind="stable") for axis in range(axes)]
    for _ in range(max(0, int(np.ceil(np.log2(max(n, 1) / _LEAF))))):
        half, orders = _halves(piece, orders, edges)
        i, j = edges.T
        cut = half[i] != half[j]
        separator = _vertex_cover(edges[cut], half)
        key *= 3
        inside = piece >= 0
        key[inside] += half[inside]
        key[separator] += 2 - half[separator]
        piece = np.where(inside, 2 * piece + half, -1)
        piece[separator] = -1
        edges = edges[~cut & (piece[i] >= 0) & (piece[j] >= 0)]
    return np.argsort(key, kind="stable")


def _halves(piece, orders, edges):
    """Which half (0 or 1) of its piece each vertex falls in; and `orders`, sorted by piece as well."""
    count = piece.max(initial=0) + 1
    edge_piece = piece[edges[:, 0]]
    candidates, cuts = [], []
    grouped = []
    for order in orders:
        order = order[piece[order] >= 0]
        order = order[np.argsort(piece[order], kind="stable")]
        grouped.append(order)
        own = piece[order]
        size = np.bincount(own, minlength=count)
        first = np.cumsum(size) - size
        half = np.zeros(len(piece), dtype=np.int64)
        half[order] = 2 * (np.arange(len(order)) - first[own]) >= size[own]
        crossing = half[edges[:, 0]] != half[edges[:, 1]]
        candidates.append(half)
        cuts.append(np.bincount(edge_piece[crossing], minlength=count))
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
