# SPDX-License-Identifier: GPL-3.0-or-later
"""Cheapest paths along the edges of a mesh (Dijkstra 1959)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from .cuttable import Cuttable

_FREE = 1e-9  # the cost of going along a boundary, relative to that of the cheapest edge


class Paths:
    """The cheapest paths from some vertices to all others.

    Parameters
    ----------
    n : number of vertices
    ends : (k, 2), the vertices of each edge; no two edges have the same ones
    cost : (k,), positive
    usable : (k,) bool, the edges that paths may use
    sources : vertices, (s,)
    limit : paths that cost more are not looked for
    plane : (n,) bool, vertices that paths, seen from their sources, reach over other such vertices alone; none if None

    Attributes
    ----------
    distance : (n,), what the path to each vertex costs, infinite where there is none
    source : (n,), where it begins; negative where there is none
    """

    def __init__(
        self,
        n: int,
        ends: np.ndarray,
        cost: np.ndarray,
        usable: np.ndarray,
        sources: np.ndarray,
        limit: float = np.inf,
        plane: np.ndarray | None = None,
    ):
        self._edges = np.flatnonzero(usable)
        low, high = np.sort(ends[self._edges], axis=1).T
        self._n = n
        keys = low * np.int64(n) + high
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]
        weight = np.maximum(cost[self._edges], np.finfo(float).tiny)
        start, end, directed = low, high, plane is not None
        if plane is not None:
            start, end, weight = np.append(low, high), np.append(high, low), np.append(weight, weight)
            allowed = plane[start] | ~plane[end]
            start, end, weight = start[allowed], end[allowed], weight[allowed]
        graph = csr_array((weight, (start, end)), shape=(n, n))
        self.distance, self._before, self.source = dijkstra(
            graph, directed=directed, indices=np.asarray(sources), return_predecessors=True, min_only=True, limit=limit
        )

    def to(self, vertex: int) -> np.ndarray:
        """The edges of the path to a vertex, (l,), from there on; none if there is no path or it is a source."""
        way = [int(vertex)]
        while (before := int(self._before[way[-1]])) >= 0:
            way.append(before)
        return self._between(np.array(way[:-1], np.int64), np.array(way[1:], np.int64))

    @property
    def tree(self) -> np.ndarray:
        """The edges that paths use, (t,)."""
        reached = np.flatnonzero(self._before >= 0)
        return self._between(reached, self._before[reached].astype(np.int64))

    def union(self, vertices: np.ndarray) -> np.ndarray:
        """The edges that the paths to the vertices (v,) use, each once."""
        wanted = np.zeros(self._n, bool)
        while len(vertices):
            wanted[vertices] = True
            vertices = np.unique(self._before[vertices])
            vertices = vertices[vertices >= 0]
            vertices = vertices[~wanted[vertices]]
        used = np.flatnonzero(wanted & (self._before >= 0))
        return self._between(used, self._before[used].astype(np.int64))

    def _between(self, one, other):
        keys = np.minimum(one, other) * np.int64(self._n) + np.maximum(one, other)
        return self._edges[self._order[np.searchsorted(self._keys, keys)]]


def beside_rims(mesh: Cuttable, cost: np.ndarray) -> np.ndarray:
    """The cost (k,) of edges with that of going along a boundary, which is next to nothing.

    So a cheapest path that comes to a hole leaves it once: one that met it twice would cut off what lies between.
    """
    finite = cost[np.isfinite(cost)]
    return np.where(mesh.is_whole, cost, _FREE * finite.min(initial=1.0))
