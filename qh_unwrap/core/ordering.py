# SPDX-License-Identifier: GPL-3.0-or-later
"""Orders in which sparse systems eliminate their unknowns with little fill."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_bipartite_matching
from scipy.sparse.linalg import spilu

from .bands import are_narrow, widths
from .patterns import places
from .pieces import components

_LEAF = 16  # vertices: so few are not divided any further
_MANY = 25_000  # vertices of the largest piece, beyond which dissection leaves less fill than minimum degree


def elimination_order(points: np.ndarray, edges: np.ndarray, group: np.ndarray | None = None) -> np.ndarray:
    """An order (n,) in which to eliminate vertices at `points` (n, d) with little fill.

    No edge may join vertices of two groups; `group` (n,) numbers that of each vertex, by default one for all.
    """
    if is_large(len(points), group):
        return Dissection.of(points, edges, group).order
    return local_order(len(points), edges, group)


def is_large(n: int, group: np.ndarray | None) -> bool:
    """Whether there is a group of so many vertices that a dissection suits them best."""
    return _largest(n, group) > _MANY


def local_order(n: int, edges: np.ndarray, group: np.ndarray | None = None) -> np.ndarray:
    """The same for groups that are not large, which needs no points."""
    if not len(edges):
        return np.arange(n)
    piece = np.zeros(n, np.int64) if group is None else group
    given = np.argsort(piece, kind="stable")  # one piece after the other
    near = _banded(n, edges, piece)
    one, other = (widths(places(order), edges, group) for order in (given, near))
    near = np.where((one < other)[piece[given]], given, near)  # as grids are often numbered row by row
    narrow = are_narrow(np.minimum(one, other), n, group)[piece]
    if narrow.all():
        return near
    near, wide = near[narrow[near]], near[~narrow[near]]
    place = np.full(n, -1, np.int32)
    place[wide] = np.arange(len(wide), dtype=np.int32)
    order = wide[_by_minimum_degree(len(wide), place[edges[~narrow[edges[:, 0]]]])]
    return np.concatenate([near, order[np.argsort(piece[order], kind="stable")]])


def _banded(n, edges, piece):
    """Neighbours soon after one another (Cuthill, McKee 1969), one piece after the other, each as if it were alone.

    Each begins with the vertex that is found last from one with the fewest neighbours.
    """
    by_degree = np.argsort(np.bincount(edges.ravel(), minlength=n), kind="stable")
    i, j = places(by_degree).astype(np.int32)[edges.T]
    both = np.concatenate([i, j]), np.concatenate([j, i])
    graph = coo_array((np.ones(2 * len(i), np.int8), both), shape=(n, n)).tocsr()
    graph.sort_indices()
    its = piece[by_degree]
    starts = np.unique(its, return_index=True)[1]
    for _ in range(2):
        # All pieces at once, from a root that is joined to one vertex of each
        columns = np.append(graph.indices, starts)
        rows = np.append(graph.indptr, len(columns))
        rooted = csr_array((np.ones(len(columns)), columns, rows), shape=(n + 1, n + 1))
        found = breadth_first_order(rooted, n, return_predecessors=False)[1:]
        if len(found) < n:  # some fall into parts
            order = _banded(n, edges, components(n, *edges.T)[1])
            return order[np.argsort(piece[order], kind="stable")]
        found = found[np.argsort(its[found], kind="stable")]
        starts = found[np.flatnonzero(np.diff(its[found], append=-1))]
    return by_degree[found]


def _by_minimum_degree(n, edges):
    """The vertex with the fewest neighbours next, as SuperLU finds it; of its factors nothing else is wanted.

    Where many have as few, as on regular meshes, it takes them as they are numbered, and some numberings leave five
    times the fill of others: neighbours should follow one another.
    """
    own = np.arange(n, dtype=np.int32)
    i, j = edges.T
    row, column = np.concatenate([i, j, own]), np.concatenate([j, i, own])
    values = np.zeros(len(row), np.float32)
    values[-n:] = 1
    matrix = coo_array((values, (row, column)), shape=(n, n)).tocsc()
    factors = spilu(matrix, drop_tol=1.0, fill_factor=1, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return places(factors.perm_c)


def _largest(n, group):
    return n if group is None or not len(group) else int(np.bincount(group).max())


class Dissection:
    """A graph taken apart, level by level, into halves and separators.

    Attributes
    ----------
    key : (n,), one base-3 digit a level, the highest first: 0 in the first half of its part, 1 in the second, 2 in the
        separator, and 0 from there on
    levels : how many digits
    """

    def __init__(self, key: np.ndarray, levels: int):
        self.key, self.levels = key, levels

    @property
    def order(self) -> np.ndarray:
        """The order (n,) in which to eliminate the vertices: halves first, separators after them."""
        return np.argsort(self.key, kind="stable")

    @classmethod
    def of(cls, points: np.ndarray, edges: np.ndarray, group: np.ndarray | None = None) -> Dissection:
        """The dissection of a graph with its vertices at `points` (n, d).

        All parts of one level are halved at once, each at the median of the coordinate that cuts the fewest edges; the
        smallest set of vertices that meets every cut edge (Koenig's theorem) separates the halves.
        """
        n, axes = points.shape
        several = group is not None and len(group) > 0 and (group != group[0]).any()
        levels = max(0, int(np.ceil(np.log2(max(_largest(n, group), 1) / _LEAF))))
        key = np.zeros(n, dtype=np.int64)
        part = np.zeros(n, np.int16)  # -1 once in a separator; short numbers are sorted faster
        if group is not None and several:
            part = group.astype(np.int32)
            key += group
        orders = [np.argsort(points[:, axis], kind="stable") for axis in range(axes)]
        i, j = edges.T.astype(np.intp, order="C")
        for level in range(levels):
            if several:  # those of different groups are not of one size
                part = _without_leaves(part)
                inside = part >= 0
                kept = inside[i] & inside[j]
                i, j = i[kept], j[kept]
            half, orders = _halves(part, orders, i, j)
            cut = half[i] != half[j]
            crossing = np.flatnonzero(cut)
            separator = _vertex_cover(np.column_stack([i[crossing], j[crossing]]), half)
            inside = part >= 0
            key *= 3
            key += np.where(inside, half, 0)
            key[separator] += 2 - half[separator]
            if level == 15:
                part = part.astype(np.int32)  # no longer short enough
            part = np.where(inside, 2 * part + half, part.dtype.type(-1))
            part[separator] = -1
            inside = part >= 0
            kept = np.flatnonzero(~cut & inside[i] & inside[j])
            i, j = i[kept], j[kept]
        return cls(key, levels)

    def separates(self, key: np.ndarray) -> np.ndarray:
        """(k,) bool, which of the vertices with these keys are in a separator."""
        found = np.zeros(len(key), bool)
        for level in range(self.levels):
            found |= key // 3**level % 3 == 2
        return found

    def extended(self, like: np.ndarray, edges: np.ndarray) -> Dissection:
        """The dissection of a graph with more vertices, each of which goes where an old one is that is `like` it, (a,).

        The old vertices stay where they are.  `edges` (k, 2) are those with a new vertex, or two.
        """
        n = len(self.key)
        key = np.concatenate([self.key, self.key[like]])
        i, j = edges.T
        for level in range(self.levels - 1, -1, -1):
            one, other = key[i] // 3**level, key[j] // 3**level
            # An edge is cut where its ends part, unless one of them is in the separator there, or was before.
            apart = (one // 3 == other // 3) & (one != other) & (one % 3 != 2) & (other % 3 != 2)
            crossing = np.flatnonzero(apart)
            if not len(crossing):
                continue
            a, b = i[crossing], j[crossing]
            with_old = (a < n) | (b < n)
            chosen = np.zeros(len(key), bool)
            chosen[np.maximum(a, b)[with_old]] = True
            rest = ~(chosen[a] | chosen[b])
            if rest.any():
                half = key // 3**level % 3
                chosen[_vertex_cover(np.column_stack([a[rest], b[rest]]), half)] = True
            key[chosen] = (key[chosen] // 3 ** (level + 1) * 3 + 2) * 3**level
        return Dissection(key, self.levels)


def _without_leaves(part):
    """The same parts (n,) numbered anew, with -1 for those that are small enough."""
    inside = part >= 0
    large = np.bincount(part[inside], minlength=1) > _LEAF
    number = np.where(large, np.cumsum(large) - 1, -1).astype(part.dtype)
    return np.where(inside, number[np.maximum(part, 0)], part.dtype.type(-1))


def _halves(part, orders, i, j):
    """Which half (0 or 1) of its part each vertex falls in; and `orders`, sorted by part as well."""
    size = np.bincount(part[part >= 0], minlength=1)
    place = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    second = (2 * place >= np.repeat(size, size)).astype(np.int8)
    candidates, cuts, grouped = [], [], []
    for order in orders:
        order = order[np.argsort(part[order], kind="stable")]
        order = order[len(order) - len(second) :]  # those in separators come first
        grouped.append(order)
        half = np.zeros(len(part), dtype=np.int8)
        half[order] = second
        candidates.append(half)
        crossing = np.flatnonzero(half[i] != half[j])
        cuts.append(np.bincount(part[i[crossing]], minlength=len(size)))
    best = np.argmin(cuts, axis=0)
    return np.choose(best[np.maximum(part, 0)], candidates), grouped


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
