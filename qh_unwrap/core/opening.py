# SPDX-License-Identifier: GPL-3.0-or-later
"""Cutting open what is closed or has handles, along cheap edges.

Handles are cut by a tree and a cotree (Eppstein 2003; Erickson, Whittlesey 2005): the cheapest paths from one vertex
make a tree of edges; a spanning tree of the faces over the other edges, those first whose loops are the dearest, leaves
two edges for every handle.  Their loops are the cut.  Boundary loops are closed by faces of their own meanwhile: a
disk with holes needs no cut.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from .branches import shortened
from .cuttable import Cuttable
from .paths import Paths

_FREE = 1e-9  # the cost of going along a boundary, relative to the cheapest edge


def opening(mesh: Cuttable, cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges (k,) bool to cut so that an island is a disk, maybe with holes.

    cost  (k,), positive

    Returns also the vertices (n,) bool that the cut has to reach: the ends of that of a sphere.
    """
    cut, kept = np.zeros(len(mesh.edges), bool), np.zeros(len(mesh.points), bool)
    if mesh.topology.excess[0] > 0:
        cut = _handles(mesh, cost)
    elif mesh.topology.is_closed[0]:
        cut = _slit(mesh, cost)
        kept = mesh.degrees(cut) == 1
    return shortened(mesh, cost, cut, kept), kept


def far_vertices(mesh: Cuttable) -> tuple[int, int]:
    """Two vertices that lie far apart: each is the farthest from the other, or nearly."""
    far = before = 0
    for _ in range(3):
        reach = Paths(len(mesh.points), mesh.edges, mesh.lengths, mesh.mesh_edge >= 0, np.array([far])).distance
        before, far = far, int(np.argmax(np.where(np.isfinite(reach), reach, -1)))
    return before, far


def _handles(mesh, cost):
    m, k = len(mesh.triangles), len(mesh.edges)
    rim = ~mesh.is_whole
    tiny = _FREE * cost[mesh.inner].min()
    price = np.where(rim, tiny, cost)
    root = int(mesh.edges[rim].min()) if rim.any() else far_vertices(mesh)[0]
    paths = Paths(len(mesh.points), mesh.edges, price, rim | mesh.inner, np.array([root]))
    in_tree = np.zeros(k, bool)
    in_tree[paths.tree] = True
    around = paths.distance[mesh.edges].sum(axis=1) + price
    around[mesh.mesh_edge < 0] = 2 * around[mesh.mesh_edge >= 0].max()

    first, last = mesh.sides
    face, other = first % m, last % m
    loops = 0
    if rim.any():
        whole = mesh.opened(np.zeros(k, bool))
        loop = whole.loop[whole.triangles.T.ravel()[first[rim]]]
        other[rim] = m + loop
        loops = int(loop.max()) + 1
    links = np.flatnonzero(~in_tree)
    weight = around[links].max() + tiny - around[links]
    low, high = np.minimum(face, other)[links], np.maximum(face, other)[links]
    # Of several links between the same two faces the dearest can be in the tree; the others are loops of their own.
    key = low * np.int64(m + loops) + high
    order = np.lexsort((weight, key))
    kept = order[np.diff(key[order], prepend=-1) > 0]
    graph = coo_array((weight[kept] + tiny, (low[kept], high[kept])), shape=(m + loops, m + loops))
    tree = minimum_spanning_tree(graph.tocsr()).tocoo()
    chosen = np.isin(key[kept], tree.row.astype(np.int64) * (m + loops) + tree.col)
    left = ~in_tree
    left[links[kept[chosen]]] = False
    cut = left.copy()
    cut[paths.union(np.unique(mesh.edges[left]))] = True
    return cut & mesh.inner


def _slit(mesh, cost):
    """A cheap path between two vertices of a sphere that are far from each other, of two edges at least."""
    one, other = far_vertices(mesh)
    path = Paths(len(mesh.points), mesh.edges, cost, mesh.inner, np.array([one])).to(other)
    cut = np.zeros(len(mesh.edges), bool)
    cut[path] = True
    if len(path) == 1:  # which would leave an outline of two edges between the same two vertices
        more = np.flatnonzero(mesh.inner & (mesh.edges == other).any(axis=1) & ~cut)
        cut[more[np.argmin(cost[more])]] = True
    return cut
