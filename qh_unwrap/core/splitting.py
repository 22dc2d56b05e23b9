# SPDX-License-Identifier: GPL-3.0-or-later
"""Splitting an island into several charts: at closed lines of sharp edges, at necks, and where it is long and thin.

The cheapest line between two parts of the surface is a minimum cut of the graph of its faces.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from .cuttable import Cuttable
from .opening import far_vertices
from .paths import Paths
from .pieces import components

_PARTS = (0.05, 0.5), (0.2, 0.8), (0.5, 0.95)  # of the area from one end on, that a line must lie between
_NARROW = 1.0  # the length of such a line by the root of the smaller area beside it, up to which it is worth a split
_RESOLUTION = 1e5  # whole numbers that the largest cost is counted in
_TINY = 1e-3  # of an island's area, below which no chart is split any more


def splitting(mesh: Cuttable, cost: np.ndarray, sharp: np.ndarray, most: int) -> np.ndarray:
    """The edges (k,) bool between the charts, `most` or fewer, that an island is to be split into.

    cost   (k,), infinite for edges that may not be cut
    sharp  (k,) bool, the edges where it is split first
    """
    chart = mesh.opened(sharp & np.isfinite(cost)).charts[1]
    chart = _merged(mesh, chart, most)
    passed: set[int] = set()
    while chart.max() + 1 < most:
        areas = np.bincount(chart, mesh.areas)
        areas[[*passed]] = 0
        largest = int(np.argmax(areas))
        if areas[largest] < _TINY:
            break
        half = _narrowest(mesh, cost, chart == largest)
        if half is None:
            passed.add(largest)
        else:
            chart = np.where(half, chart.max() + 1, chart)
    return _borders(mesh, chart)


def _borders(mesh, chart):
    m = len(mesh.triangles)
    first, last = mesh.sides
    return mesh.inner & (chart[first % m] != chart[last % m])


def _merged(mesh, chart, most):
    """The charts (m,) joined until there are `most` at most: the smallest with that which it has the longest border
    with, again and again."""
    count = int(chart.max()) + 1
    m = len(mesh.triangles)
    border = np.flatnonzero(_borders(mesh, chart))
    beside: list[dict[int, float]] = [{} for _ in range(count)]
    sides = (chart[side[border] % m].tolist() for side in mesh.sides)
    for one, other, length in zip(*sides, mesh.lengths[border].tolist(), strict=True):
        beside[one][other] = beside[one].get(other, 0.0) + length
        beside[other][one] = beside[other].get(one, 0.0) + length
    areas = dict(enumerate(np.bincount(chart, mesh.areas).tolist()))
    into = np.arange(count)
    while len(areas) > most:
        small = min(areas, key=lambda each: (areas[each], each))
        large = max(beside[small], key=lambda each: (beside[small][each], -each))
        areas[large] += areas.pop(small)
        into[into == small] = large
        for other, length in beside[small].items():
            del beside[other][small]
            if other != large:
                beside[large][other] = beside[other][large] = beside[large].get(other, 0.0) + length
    return np.unique(into[chart], return_inverse=True)[1]


def _narrowest(mesh, cost, chosen):
    """The part, (m,) bool, of the `chosen` triangles beyond a narrow line across them, or None."""
    m = len(mesh.triangles)
    first, last = (side % m for side in mesh.sides)
    within = mesh.is_whole & chosen[first] & chosen[last]
    usable = np.zeros(len(mesh.edges), bool)
    usable[mesh.triangle_edges[chosen]] = True
    distance = Paths(
        len(mesh.points), mesh.edges, mesh.lengths, usable, np.array([far_vertices(mesh, usable)[0]])
    ).distance
    order = np.flatnonzero(chosen)
    order = order[np.argsort(distance[mesh.triangles[order]].mean(axis=1), kind="stable")]
    share = np.cumsum(mesh.areas[order]) / mesh.areas[order].sum()
    finite = np.isfinite(cost)
    unit = cost[within & finite].max(initial=0.0) / _RESOLUTION
    if not unit > 0:
        return None
    total = int(np.ceil(cost[within & finite] / unit).sum()) + 1  # more than any line costs
    total = min(total, 2**30)
    capacity = np.where(finite, np.ceil(np.where(finite, cost, 0) / unit), total)[within]
    best, least = None, _NARROW
    for low, high in _PARTS:
        source, sink = order[share <= low], order[share >= high]
        if not len(source) or not len(sink):
            continue
        half = _minimum_cut(m, first[within], last[within], capacity, source, sink, total)
        line = within & (half[first] != half[last])
        if not np.isfinite(cost[line]).all() or not line.any():
            continue
        width = mesh.lengths[line].sum() / np.sqrt(min(mesh.areas[half].sum(), mesh.areas[chosen & ~half].sum()))
        if width < least:
            best, least = half, width
    return best


def _minimum_cut(m, one, other, capacity, source, sink, total):
    """The triangles, (m,) bool, on the sources' side of the cheapest line to the sinks; both sides hang together."""
    start = np.concatenate([one, other, np.full(len(source), m), sink])
    end = np.concatenate([other, one, source, np.full(len(sink), m + 1)])
    size = np.concatenate([capacity, capacity, np.full(len(source) + len(sink), total)]).astype(np.int32)
    graph = csr_array((size, (start, end)), shape=(m + 2, m + 2))
    graph.sum_duplicates()
    rest = graph - maximum_flow(graph, m, m + 1).flow
    rest.data = np.maximum(rest.data, 0)
    rest.eliminate_zeros()
    half = np.zeros(m + 2, bool)
    half[breadth_first_order(rest, m, return_predecessors=False)] = True
    half = half[:m]
    # What is not connected with the sinks goes to the other side.
    same = half[one] == half[other]
    part = components(m, one[same], other[same])[1]
    rest_side = np.zeros(m, bool)
    rest_side[np.concatenate([one, other])] = True
    return rest_side & (part != part[sink[-1]])
