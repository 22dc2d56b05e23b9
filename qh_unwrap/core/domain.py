# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a map lives: which charts take part, and what is held.

A domain's vertices are those of the island's surface and, after them, its own.  A map (n, 2) has a row for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

from .chart import Chart, Surface
from .ordering import elimination_order
from .settings import Settings
from .systems import Constrained


class Domain(Protocol):
    """What iteration and refinement need to know.  The driver needs no more of any domain.

    Attributes
    ----------
    island : the surface, of one or several pieces
    charts : the island first, then charts beside it
    triangles : the charts' triangles and edges as one
    vertex_piece : (n,), the piece of every vertex
    constrained : solves for what is free
    """

    @property
    def island(self) -> Surface: ...

    @property
    def charts(self) -> Sequence[Chart]: ...

    @property
    def triangles(self) -> Triangles: ...

    @property
    def vertex_piece(self) -> np.ndarray: ...

    @property
    def constrained(self) -> Constrained: ...

    def renewed(self, uv: np.ndarray, hindered: np.ndarray | bool = True) -> np.ndarray:
        """The map `uv` itself, or the same map of the island with other vertices beside it, and the domain adapted.

        hindered  (p,) bool, in which pieces steps are cut short
        """
        ...

    def start(self, uv: np.ndarray) -> np.ndarray:
        """A map (n', 2) of the island, completed by the domain's own vertices."""
        ...

    def recalled(self, uv: np.ndarray, earlier: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The map `uv`, but in the chosen `pieces` (p,) bool the `earlier` one (n', 2) of the island, and for which of
        them (p,) the domain could not be adapted to it."""
        ...

    def fix(self, fixed: Fixed, uv: np.ndarray) -> None:
        """Fix other things of the island, while the map is `uv`; patterns and factors are kept where they serve."""
        ...

    def weights(self, of_charts: Sequence[np.ndarray], uv: np.ndarray) -> np.ndarray:
        """The weights (2, k) made of those (2, k') of every chart."""
        ...

    def of(self, pieces: np.ndarray, uv: np.ndarray) -> tuple[Domain, np.ndarray]:
        """The domain of the chosen `pieces` (p,) bool alone, and their map."""
        ...


class Triangles:
    """The triangles and edges of several charts as one.

    Attributes
    ----------
    edges : (k, 2), those of all charts, each once; the first chart's come first and keep their numbers
    corners : (3, m), the charts' triangles one after the other
    half_edge_edges : (3 m,), the edge from each corner to the next
    """

    def __init__(self, charts: Sequence[Chart], n: int):
        self._charts = charts
        first, *others = charts
        known = first.edges @ np.array([n, 1])
        edges, self._places = [first.edges], [np.arange(len(known))]
        count = len(known)
        for chart in others:
            key = chart.edges @ np.array([n, 1])
            at = np.searchsorted(known, key)
            there = at < len(known)
            there[there] = known[at[there]] == key[there]
            # Others than the first have no edge in common: air lies around the island, plugs within.
            self._places.append(np.where(there, at, count + np.cumsum(~there) - 1))
            edges.append(chart.edges[~there])
            count += int((~there).sum())
        self.edges = np.concatenate(edges) if others else first.edges
        ends = np.cumsum([0, *(len(chart.triangles) for chart in charts)])
        self._parts = [slice(*both) for both in pairwise(ends)]

    def __iter__(self):
        """Every chart, and which of the triangles are its."""
        return zip(self._charts, self._parts, strict=True)

    @cached_property
    def corners(self) -> np.ndarray:
        if len(self._charts) == 1:
            return self._charts[0].triangles.T
        return np.hstack([chart.triangles.T for chart in self._charts])

    @cached_property
    def half_edge_edges(self) -> np.ndarray:
        if len(self._charts) == 1:
            return self._charts[0].half_edge_edges
        numbered = zip(self._charts, self._places, strict=True)
        return np.hstack([place[chart.triangle_edges.T] for chart, place in numbered]).ravel()

    def joined(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """Values (..., k') at the edges of every chart, added up at all edges, (..., k)."""
        if len(parts) == 1:
            return parts[0]
        total = np.zeros((*parts[0].shape[:-1], len(self.edges)))
        for part, place in zip(parts, self._places, strict=True):
            total[..., place] += part
        return total

    def at(self, values: np.ndarray) -> np.ndarray:
        """The values (p,) of the pieces at their triangles, (m,), or the one that there is."""
        return values[0] if len(values) == 1 else np.concatenate([values[chart.piece] for chart in self._charts])

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Of values (m,) at triangles over each piece, (p,)."""
        return sum(chart.sums(values[part]) for chart, part in self)

    def largest(self, values: np.ndarray) -> np.ndarray:
        """Of values (m,), not negative, over each piece, (p,)."""
        return np.stack([chart.largest(values[part]) for chart, part in self]).max(axis=0)


class Fixed(NamedTuple):
    """What keeps vertices from going where they like, for U and V."""

    held: np.ndarray
    """(n, 2) bool, the coordinates that are held"""
    values: np.ndarray
    """(n, 2), where these are"""
    partner: np.ndarray | None = None
    """(n, 2), the vertex that each keeps its distance from, itself for nobody"""

    def of(self, chosen: np.ndarray, number: np.ndarray) -> Fixed:
        """The same of the `chosen` vertices (n,) bool, numbered anew."""
        partner = None if self.partner is None else number[self.partner[chosen]]
        return Fixed(self.held[chosen], self.values[chosen], partner)

    def followed_by(self, held: np.ndarray, values: np.ndarray) -> Fixed:
        """The same with more vertices, held (a,) bool or not."""
        n = len(self.held)
        partner = self.partner
        if partner is not None:
            added = np.arange(n, n + len(held))
            partner = np.vstack([partner, np.column_stack([added, added])])
        both = np.column_stack([held, held])
        return Fixed(np.vstack([self.held, both]), np.vstack([self.values, values]), partner)


class Held:
    """A domain in which nothing but what is held keeps the map in place: the outline, some pins, or one vertex.

    Parameters
    ----------
    island : Surface
    fixed : of its vertices
    plugs : None, or as `Surface.plugs` returns them: what closes holes
    """

    def __init__(self, island: Surface, fixed: Fixed, plugs: tuple[Chart, np.ndarray] | None = None):
        self.island, self._fixed, self._plugs = island, fixed, plugs
        self.charts: Sequence[Chart] = [island]
        self.vertex_piece = island.vertex_piece
        points = island.vertices
        self.points = points
        if plugs is not None:
            chart, centres = plugs
            self.charts = [island, chart]
            self.points = points = np.vstack([points, centres])
            self.vertex_piece = np.concatenate([self.vertex_piece, island.hole_piece])
            fixed = fixed.followed_by(np.zeros(len(centres), bool), np.zeros((len(centres), 2)))
        self.triangles = Triangles(self.charts, len(points))
        order = island.order if plugs is None else elimination_order(points, self.triangles.edges, self.vertex_piece)
        self.constrained = Constrained(order, self.triangles.edges, *fixed, group=self.vertex_piece)

    @property
    def is_solid(self) -> bool:
        """Whether no air takes part."""
        return not any(chart.is_air for chart in self.charts)

    def fix(self, fixed: Fixed, uv: np.ndarray) -> None:
        self._fixed = fixed
        added = len(uv) - len(fixed.held)
        self.constrained = self.constrained.refixed(*fixed.followed_by(np.zeros(added, bool), np.zeros((added, 2))))

    def start(self, uv: np.ndarray) -> np.ndarray:
        """A map (n, 2) of the island with the plugs' centres in the middle of their holes."""
        if self._plugs is None:
            return uv
        return np.vstack([uv, *(uv[loop].mean(axis=0) for loop in self.island.holes)])

    def renewed(self, uv: np.ndarray, hindered: np.ndarray | bool = True) -> np.ndarray:
        return uv

    def recalled(self, uv: np.ndarray, earlier: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        chosen = pieces[self.island.vertex_piece][:, None]
        n = len(self.island.vertices)
        return self.start(np.where(chosen, earlier, uv[:n])), np.zeros(len(pieces), bool)

    def weights(self, of_charts: Sequence[np.ndarray], _uv: np.ndarray) -> np.ndarray:
        return self.triangles.joined(of_charts)

    def of(self, pieces: np.ndarray, uv: np.ndarray) -> tuple[Held, np.ndarray]:
        number = self.island.numbering(pieces)
        island = self.island.of(pieces, number)
        fixed = self._fixed.of(pieces[self.island.vertex_piece], number)
        plugs = None if self._plugs is None else island.plugs(solid=not self._plugs[0].is_air)
        return Held(island, fixed, plugs), uv[pieces[self.vertex_piece]]


def outlined(island: Surface, settings: Settings, fixed: Fixed) -> Held:
    """A domain in which the outlines are held, with what is in the holes, as the settings say."""
    if settings.boundary == "KEEP":  # whose holes are held as well
        return Held(island, fixed)
    return Held(island, fixed, island.plugs(solid=settings.fill_holes))


def loose(island: Surface, uv: np.ndarray, _fixed: Fixed) -> Held:
    """A domain in which every piece may go where it likes: one vertex of each stays, from which the rest follows."""
    held = np.zeros((len(uv), 2), bool)
    largest = np.flatnonzero(island.barrier == island.largest(island.barrier)[island.piece])
    held[island.triangles[largest[np.diff(island.piece[largest], prepend=-1) > 0], 0]] = True
    return Held(island, Fixed(held, uv))


def rigid(island: Surface, uv: np.ndarray, fixed: Fixed) -> Held:
    """A domain in which all loops stay where they are, beside what is fixed."""
    held = fixed.held.copy()
    held[np.concatenate(island.loops)] = True
    return Held(island, fixed._replace(held=held, values=uv))
