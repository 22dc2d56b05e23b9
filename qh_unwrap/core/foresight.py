# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a flat map of an island will stretch, and where, foreseen without making one.

A conformal map that scales nothing along the cuts scales the surface elsewhere by e^u, where u solves the Poisson
equation of the Gaussian curvature and is 0 on the cuts.  Where it is large, a cut is missing most: Ben-Chen, Gotsman
and Bunin (2008) place their cones so.  A hole is a single point of u, whose curvature is that of the hole's rim.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array

from .cuttable import Cuttable
from .factors import superlu
from .ordering import elimination_order
from .triangles import corner_angles, laid_flat

_LEAST, _LARGEST = 0.01, 20.0  # weights of edges, those of equilateral triangles being 0.58: cotangents can be negative
_HELD = 1e9  # how stiffly the cuts are held, relative to what acts on a vertex
_RINGS = 3  # over which values are smoothed
_FREE = 1e-10  # what keeps the equations solvable where nothing is held


class Foresight:
    """The Gaussian curvature of an island, and what follows from it.

    Attributes
    ----------
    area : (n,), of the surface around each vertex; their sum is 1
    """

    def __init__(self, mesh: Cuttable):
        self._mesh = mesh
        n, triangles = len(mesh.points), mesh.triangles
        rest, _ = laid_flat(mesh.points, triangles, np.sqrt(1 / len(triangles)))
        angle = corner_angles(rest)
        turn = np.bincount(triangles.ravel(), angle.ravel(), n)
        self._defect = np.where(mesh.on_rim, np.pi, 2 * np.pi) - turn
        self.area = np.bincount(triangles.ravel(), np.repeat(mesh.areas / 3, 3), n)
        opposite = np.clip(np.roll(angle, 1, axis=1).T.ravel(), 1e-3, np.pi - 1e-3)
        cotangents = np.bincount(mesh.half_edge_edges, 0.5 / np.tan(opposite), len(mesh.edges))
        self._weight = np.clip(cotangents, _LEAST, _LARGEST)
        # The loops of the rim before anything is cut, and the node of each vertex: all of a loop have the same one.
        whole = mesh.opened(np.zeros(len(mesh.edges), bool))
        loop = np.full(n, -1)
        loop[whole.origin] = whole.loop
        self._loop, count = loop, int(loop.max(initial=-1)) + 1
        self._loop_length = np.bincount(loop[mesh.edges[~mesh.is_whole, 0]], mesh.lengths[~mesh.is_whole], count)
        alone = loop < 0
        node = np.cumsum(alone) - 1
        self._node = np.where(alone, node, int(alone.sum()) + loop)
        self._nodes = nodes = int(alone.sum()) + count
        edges = self._node[mesh.edges]
        between = edges[:, 0] != edges[:, 1]
        edges, weight = edges[between], self._weight[between]
        middle = np.empty((nodes, 3))
        middle[self._node] = mesh.points
        self._order = elimination_order(middle, edges)
        place = np.empty(nodes, np.int64)
        place[self._order] = np.arange(nodes)
        self._place = place[self._node]
        i, j = place[edges.T]
        both = np.concatenate([i, j]), np.concatenate([j, i])
        self._own = np.bincount(both[0], np.concatenate([weight, weight]), nodes)
        self._beside = coo_array((-np.concatenate([weight, weight]), both), shape=(nodes, nodes)).tocsc()
        curvature = np.bincount(self._place, self._defect, nodes)
        curvature[place[int(alone.sum()) :]] += 2 * np.pi
        self._curvature = curvature

    def outline(self, cut: np.ndarray) -> np.ndarray:
        """The vertices (n,) bool of the outline of the island cut along `cut` (k,) bool: of the cut, which hangs
        together, or the longest loop, and of all loops that the cut touches."""
        mesh = self._mesh
        held = mesh.touched(cut)
        loops = self._loop[held]
        loops = np.unique(loops[loops >= 0])
        if not cut.any() and len(self._loop_length):
            loops = np.array([np.argmax(self._loop_length)])
        return held | np.isin(self._loop, loops)

    def scaling(self, held: np.ndarray) -> np.ndarray:
        """The logarithm u (n,) of the scale at each vertex, where it is 0 at the vertices `held` (n,) bool."""
        nodes = self._nodes
        stiff = np.zeros(nodes, bool)
        stiff[self._place[held]] = True
        diagonal = np.where(self._own > 0, self._own, 1) * np.where(stiff, _HELD, 1 + _FREE)
        matrix = (
            self._beside + coo_array((diagonal, (np.arange(nodes), np.arange(nodes))), shape=(nodes, nodes)).tocsc()
        )
        solution = superlu(matrix, single=False).solve(self._curvature[:, None])[:, 0]
        solution[stiff] = 0
        return solution[self._place]

    def smoothed(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) at the vertices, averaged over some rings around each."""
        mesh, n = self._mesh, len(self.area)
        one, other = mesh.edges.T
        for _ in range(_RINGS):
            weight = self.area.copy()
            total = self.area * values
            for here, there in ((one, other), (other, one)):
                weight += np.bincount(here, self.area[there], n)
                total += np.bincount(here, self.area[there] * values[there], n)
            values = total / np.maximum(weight, np.finfo(float).tiny)
        return values

    def at_vertices(self, values: np.ndarray) -> np.ndarray:
        """Values (m,) of the triangles averaged at the vertices, (n,)."""
        mesh = self._mesh
        sums = np.bincount(mesh.triangles.ravel(), np.repeat(mesh.areas / 3 * values, 3), len(self.area))
        return sums / np.maximum(self.area, np.finfo(float).tiny)
