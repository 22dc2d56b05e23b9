# SPDX-License-Identifier: GPL-3.0-or-later
"""Distances along the edges of a surface (Dijkstra 1959)."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra


class EdgeDistances:
    """Distances along `edges` (k, 2) between `points` (n, d).

    Attributes
    ----------
    length : (k,), of every edge, positive even where two points coincide: SciPy would not store it
    """

    def __init__(self, points: np.ndarray, edges: np.ndarray):
        i, j = edges.T
        length = np.linalg.norm(points[i] - points[j], axis=1)
        self.length = np.maximum(length, 1e-9 * length.max())
        self._graph = coo_array((self.length, (i, j)), shape=(len(points), len(points))).tocsr()

    def to(self, vertices: np.ndarray) -> np.ndarray:
        """The distance of every vertex from the nearest of these, (n,)."""
        return dijkstra(self._graph, directed=False, indices=vertices, min_only=True)
