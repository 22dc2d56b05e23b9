# SPDX-License-Identifier: GPL-3.0-or-later
"""The branches that a cut consists of: what dangles is taken away, and what goes a long way is laid anew."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import NamedTuple

import numpy as np

from .cuttable import Cuttable
from .paths import Paths, beside_rims

_ROUNDS = 2  # how often every branch is laid anew
_GAIN = 0.01  # relative to what a branch costs, by which another path must be cheaper to take its place


class Branch(NamedTuple):
    """A path of a cut between vertices where it forks, ends, or meets the rim."""

    edges: np.ndarray  # (l,)
    vertices: np.ndarray  # (l + 1,), in the same order

    @property
    def reversed(self) -> Branch:
        return Branch(self.edges[::-1], self.vertices[::-1])


def branches(mesh: Cuttable, cut: np.ndarray, kept: np.ndarray) -> list[Branch]:
    """The branches of a cut (k,) bool; they end at vertices that are `kept` (n,) bool as well.

    A loop that meets nothing is one branch, from one of its vertices round to it.
    """
    number = mesh.degrees(cut)
    node = (number > 0) & ((number != 2) | kept | mesh.on_rim)
    beside = _beside(mesh, cut)
    found: list[Branch] = []
    seen: set[int] = set()
    for first in [*np.flatnonzero(node).tolist(), *np.flatnonzero((number > 0) & ~node).tolist()]:
        for edge in beside[first]:
            if edge in seen:
                continue
            way, vertices, here = [], [first], first
            while True:
                way.append(edge)
                seen.add(edge)
                here = int(mesh.edges[edge].sum()) - here
                vertices.append(here)
                if node[here] or here == first:
                    break
                edge = next(each for each in beside[here] if each != edge)
            found.append(Branch(np.array(way), np.array(vertices)))
    return found


def pruned(mesh: Cuttable, cut: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The cut (k,) bool without what dangles: every branch ends at a fork, the rim, or a `kept` vertex, (n,) bool."""
    number = mesh.degrees(cut)
    held = kept | mesh.on_rim
    waiting = np.flatnonzero((number == 1) & ~held).tolist()
    if not waiting:
        return cut
    cut = cut.copy()
    beside = _beside(mesh, cut)
    while waiting:
        vertex = waiting.pop()
        for edge in beside[vertex]:
            if cut[edge]:
                cut[edge] = False
                other = int(mesh.edges[edge].sum()) - vertex
                number[other] -= 1
                if number[other] == 1 and not held[other]:
                    waiting.append(other)
    return cut


def _beside(mesh, cut):
    beside: dict[int, list[int]] = {}
    for edge in np.flatnonzero(cut).tolist():
        for vertex in mesh.edges[edge].tolist():
            beside.setdefault(vertex, []).append(edge)
    return beside


def shortened(mesh: Cuttable, cost: np.ndarray, cut: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """What `shortening` returns where every cheaper way is welcome."""
    steps = shortening(mesh, cost, cut, kept, lambda cut, other: True)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def shortening(
    mesh: Cuttable,
    cost: np.ndarray,
    cut: np.ndarray,
    kept: np.ndarray,
    is_better: Callable[[np.ndarray, np.ndarray], bool],
) -> Generator[None, None, np.ndarray]:
    """A cut (k,) bool that opens the same and costs less: nothing dangles but at `kept` vertices (n,) bool, and each
    branch is laid anew where there is a cheaper way for it, unless `is_better(other_cut, cut)` says no.

    A generator: yields after each branch, and returns the cut.
    """
    cut = pruned(mesh, cut, kept)
    for _ in range(_ROUNDS):
        changed = False
        for branch in sorted(branches(mesh, cut, kept), key=lambda branch: -cost[branch.edges].sum()):
            yield
            # Those laid anew before may have taken its place, or fork from it.
            if not cut[branch.edges].all() or (mesh.degrees(cut)[branch.vertices[1:-1]] != 2).any():
                continue
            without = cut.copy()
            without[branch.edges] = False
            path = _other_way(mesh, cost, without, branch)
            if path is not None:
                without[path] = True
                without = pruned(mesh, without, kept)
                if without.sum() >= mesh.fewest and is_better(without, cut):
                    cut, changed = without, True
        if not changed:
            break
    return cut


def _other_way(mesh, cost, cut, branch):
    """A cheaper path that joins again what the branch joined, or None: there is none, or it would part the surface."""
    opened = mesh.opened(cut)
    ends = []
    for edge, vertex in ((branch.edges[0], branch.vertices[0]), (branch.edges[-1], branch.vertices[-1])):
        pair = opened.ends[edge]
        ends.append(int(pair[np.argmax(opened.origin[pair] == vertex)]))
    loops = opened.loop[ends].tolist()
    if ends[0] == ends[1] or loops[0] == loops[1] >= 0:
        return None
    its, others = (
        np.flatnonzero(opened.loop == loop) if loop >= 0 else np.array([end])
        for end, loop in zip(ends, loops, strict=True)
    )
    limit = (1 - _GAIN) * cost[branch.edges].sum()
    price = beside_rims(mesh, cost)
    paths = Paths(opened.vertex_count, opened.ends, price, np.isfinite(price) & ~cut, its, limit)
    goal = others[np.argmin(paths.distance[others])]
    path = paths.to(goal) if np.isfinite(paths.distance[goal]) else None
    return None if path is None else path[mesh.inner[path]]
