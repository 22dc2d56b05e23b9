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

from .branches import pruned, shortened
from .cuttable import Cuttable
from .errors import ClosedError
from .mirroring import Mirror
from .paths import Paths, beside_rims

_FORBIDDEN = 1e6  # the cost of an edge that may not be cut, relative to the dearest other


def opening(mesh: Cuttable, cost: np.ndarray, mirror: Mirror | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The edges (k,) bool to cut so that an island is a disk, maybe with holes.

    cost    (k,), positive; infinite for edges that may not be cut
    mirror  None, or what a closed island is to be cut symmetrically to, if it is one without handles

    Returns also the vertices (n,) bool that the cut has to reach: the ends of that of a sphere.  Raises `ClosedError`
    where too few edges may be cut.
    """
    cut, kept = np.zeros(len(mesh.edges), bool), np.zeros(len(mesh.points), bool)
    if mesh.topology.excess[0] > 0:
        cut = _handles(mesh, cost)
    elif mesh.topology.is_closed[0]:
        cut = _slit(mesh, cost, None if mirror is None else mirror.on_plane)
        kept = mesh.degrees(cut) == 1
    if np.isinf(cost[cut]).any():
        raise ClosedError("too few of its edges may be cut to open it: spare fewer of its vertices, or mark a seam")
    return cut if mirror is not None else shortened(mesh, cost, cut, kept), kept


def far_vertices(mesh: Cuttable, usable: np.ndarray) -> tuple[int, int]:
    """Two vertices that lie far apart along `usable` edges, (k,) bool: each is the farthest from the other, or nearly.

    Both are the same where no edge is usable.
    """
    far = before = int(mesh.edges[usable].min(initial=len(mesh.points)) % len(mesh.points))
    for _ in range(3):
        reach = Paths(len(mesh.points), mesh.edges, mesh.lengths, usable, np.array([far])).distance
        before, far = far, int(np.argmax(np.where(np.isfinite(reach), reach, -1)))
    return before, far


def _handles(mesh, cost):
    m, k = len(mesh.triangles), len(mesh.edges)
    rim, finite = ~mesh.is_whole, np.isfinite(cost)
    price = beside_rims(mesh, np.where(finite, cost, _FORBIDDEN * cost[finite].max(initial=1.0)))
    tiny = price.min()
    root = int(mesh.edges[rim].min()) if rim.any() else far_vertices(mesh, mesh.inner)[0]
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
    ends = np.array([low[kept], high[kept]], dtype=np.int32)  # SciPy 1.15 takes no others
    graph = coo_array((weight[kept] + tiny, tuple(ends)), shape=(m + loops, m + loops))
    tree = minimum_spanning_tree(graph.tocsr()).tocoo()
    chosen = np.isin(key[kept], tree.row.astype(np.int64) * (m + loops) + tree.col)
    left = ~in_tree
    left[links[kept[chosen]]] = False
    cut = left.copy()
    cut[paths.union(np.unique(mesh.edges[left]))] = True
    return pruned(mesh, cut & mesh.inner, np.zeros(len(mesh.points), bool))


def _slit(mesh, cost, plane):
    """A cheap path between two vertices of a sphere that are far from each other, of two edges at least; on the `plane`
    (n,) bool if there is one."""
    usable = np.isfinite(cost)
    if plane is not None:
        usable &= plane[mesh.edges].all(axis=1)
    one, other = far_vertices(mesh, usable)
    path = Paths(len(mesh.points), mesh.edges, cost, usable, np.array([one])).to(other)
    cut = np.zeros(len(mesh.edges), bool)
    cut[path] = True
    if len(path) == 1:
        more = np.flatnonzero(np.isfinite(cost) & (mesh.edges == other).any(axis=1) & ~cut)
        cut[more[np.argmin(cost[more])] if len(more) else slice(0)] = True
    if cut.sum() < mesh.fewest:
        raise ClosedError("too few of its edges may be cut to open it: spare fewer of its vertices, or mark a seam")
    return cut
