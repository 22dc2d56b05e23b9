# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles as the operators see them: a chart has shapes at rest and weights, whatever they belong to."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from . import errors
from .loops import sorted_loops
from .ordering import Dissection, is_large, local_order
from .pieces import parts_of, starts_of
from .topology import HalfEdges, Topology, checked_arrays, edge_keys
from .triangles import areas_in_space, corner_angles, corners_of, hat_gradients, laid_flat, signed_areas

_UNSEEN = 1e-2  # of its made-up area, the weight in the energy of a face without area, so that it cannot flip either


class Chart(HalfEdges):
    """Triangles of one or several pieces, with the fields that operators read.  No operator asks whose they are.

    Attributes
    ----------
    triangles : (m, 3)
    edges : (k, 2), each edge once, smaller vertex first, sorted
    triangle_edges : (m, 3), the edge from corner c to corner c + 1
    rest : (m, 3, 2), the corners of every triangle in its shape at rest, counter-clockwise; None for air, which is at
        rest as it lies
    area : (m,), positive, that of `rest`
    measure : (m,), how much a triangle counts in measures and means: its area, or 0 if the surface has none there
    barrier : (m,), how much it counts in the energy that keeps triangles from flipping
    piece : (m,), the piece that each belongs to, ascending
    piece_count : p
    """

    def __init__(self, triangles, edges, triangle_edges, rest, measure, barrier, piece, piece_count):
        self.triangles, self.edges, self.triangle_edges = triangles, edges, triangle_edges
        self.rest, self.measure, self.barrier = rest, measure, barrier
        self.piece, self.piece_count = piece, piece_count

    @property
    def in_space(self) -> Chart:
        """The chart with its true shapes, for measures, where those at rest are others."""
        return self

    @property
    def is_air(self) -> bool:
        return self.rest is None

    @cached_property
    def area(self) -> np.ndarray:
        return signed_areas(self.rest)

    @cached_property
    def has_void(self) -> bool:
        """Whether the surface has no area in some triangle."""
        return bool((self.measure == 0).any())

    @cached_property
    def hats(self) -> np.ndarray:
        """Gradients, in `rest`, of the hat functions of every triangle's second and third corners, (2, 2, m)."""
        return hat_gradients(self.rest)

    def shapes(self, uv: np.ndarray) -> np.ndarray:
        """The corners (m, 3, 2) of its shapes at rest while the layout is `uv` (n, 2)."""
        return corners_of(uv, self.triangles) if self.is_air else self.rest

    @cached_property
    def _segments(self):
        # The pieces that have triangles here, and where these begin
        starts = np.flatnonzero(np.diff(self.piece, prepend=-1))
        return self.piece[starts], starts

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Of values (m,) at triangles over each piece, (p,)."""
        return self._reduced(np.add, values, 0)

    def largest(self, values: np.ndarray) -> np.ndarray:
        """Of values (m,), not negative, over each piece, (p,)."""
        return self._reduced(np.maximum, values, 0)

    def _reduced(self, function, values, empty):
        present, starts = self._segments
        if len(present) == self.piece_count:
            return function.reduceat(values, starts)
        result = np.full(self.piece_count, empty, values.dtype)
        if len(present):
            result[present] = function.reduceat(values, starts)
        return result

    def angle_sums(self, n: int) -> np.ndarray:
        """The sum of the triangles' angles at each of n vertices, (n,), in radians."""
        return np.bincount(self.triangles.T.ravel(), corner_angles(self.rest).T.ravel(), n)

    def _fields_of(self, chosen: np.ndarray, vertex_number: np.ndarray) -> dict[str, Any]:
        """The attributes of a chart of the `chosen` triangles (m,), all of their pieces."""
        kept = np.zeros(len(self.edges), bool)
        kept[self.triangle_edges[chosen]] = True
        edge_number = np.cumsum(kept) - 1
        return dict(
            triangles=np.asfortranarray(vertex_number[self.triangles[chosen]]),
            edges=vertex_number[self.edges[kept]],
            triangle_edges=np.asfortranarray(edge_number[self.triangle_edges[chosen]]),
            rest=None if self.is_air else np.asfortranarray(self.rest.T[..., chosen].T),
            measure=self.measure[chosen],
            barrier=self.barrier[chosen],
        )

    def of(self, pieces: np.ndarray, vertex_number: np.ndarray) -> Chart:
        """The chart of the chosen `pieces` (p,) bool alone, with vertices numbered anew, (n,)."""
        new_piece = np.cumsum(pieces) - 1
        chosen = pieces[self.piece]
        fields = self._fields_of(chosen, vertex_number)
        return Chart(**fields, piece=new_piece[self.piece[chosen]], piece_count=int(pieces.sum()))


class Surface(Chart):
    """A connected, orientable, manifold triangle surface of genus 0 with at least one boundary loop; or several.

    It is checked once, when it is made; everything after it trusts it.  As a chart its shapes at rest are those in
    space, laid flat; where triangles have an importance, they are scaled by its root, so that the map gives them more
    room.

    Parameters
    ----------
    vertices : (n, 3) floats, any unit
    triangles : (m, 3) integers, consistently wound
    vertex_starts, triangle_starts : (p,), where the vertices and the triangles of each piece begin

    Attributes, beside those of a `Chart`
    ----------
    vertices : (n, 3), the input, every piece moved and scaled so that its area is 1
    vertex_piece : (n,), the piece of every vertex
    vertex_starts, triangle_starts : (p,)
    on_boundary : (3 m,) bool, the half-edges without a neighbour
    loops : list of boundary loops, each in the direction of its triangles' winding: first one for each piece, its
        outline, then all holes
    loop_piece : (l,), the piece of every loop
    scaled : (m,), by what the shapes at rest were multiplied, or None

    Raises a subclass of `SurfaceError`, one for each cause.
    """

    def __init__(self, vertices, triangles, vertex_starts=(0,), triangle_starts=(0,)):
        vertices, triangles = checked_arrays(vertices, triangles)
        topology = Topology(triangles, len(vertices), vertex_starts, triangle_starts)
        faults = topology.faults()
        normalised, flat = normalised_pieces(vertices, topology)
        for fault in (*faults.values(), *flat.values()):
            raise fault
        self._fill(normalised, topology)

    @classmethod
    def of_topology(cls, vertices: np.ndarray, topology: Topology, importance: np.ndarray | None = None) -> Surface:
        """The same from vertices as `normalised_pieces` returns them and a topology without faults.

        `importance` (m,) says how many times as large a triangle shall be in the map.
        """
        made = cls.__new__(cls)
        made._fill(vertices, topology, importance)
        return made

    def _fill(self, vertices, topology, importance=None):
        triangles = topology.triangles
        self.vertices = vertices
        self.vertex_piece = topology.vertex_piece
        self.vertex_starts, self.triangle_starts = topology.vertex_starts, topology.triangle_starts
        self.on_boundary = topology.on_boundary
        self.loops, self.loop_piece = sorted_loops(vertices, topology)
        p = topology.piece_count
        size = np.sqrt(p / len(triangles))  # every piece has the area 1
        rest, degenerate = laid_flat(vertices, triangles, size)
        self.scaled = None
        if importance is not None:
            self.scaled = _scales(importance, signed_areas(rest), topology.triangle_starts, topology.triangle_piece)
            rest = np.asfortranarray((rest.T * self.scaled).T)
        area = signed_areas(rest)
        measure, barrier = np.where(degenerate, 0.0, area), np.where(degenerate, _UNSEEN * area, area)
        super().__init__(
            triangles, topology.edges, topology.triangle_edges, rest, measure, barrier, topology.triangle_piece, p
        )
        self.area = area

    @cached_property
    def in_space(self) -> Chart:
        """The chart with the shapes that triangles have in space, for measures, where those at rest are scaled."""
        if self.scaled is None:
            return self
        rest, measure = (self.rest.T / self.scaled).T, self.measure / self.scaled**2
        return Chart(
            self.triangles, self.edges, self.triangle_edges, rest, measure, measure, self.piece, self.piece_count
        )

    @property
    def degenerate(self) -> np.ndarray:
        """(m,) bool, True where the surface's triangle has no area and its shape at rest is made up."""
        return self.measure == 0

    @property
    def outlines(self) -> list[np.ndarray]:
        """The outer loop of every piece."""
        return self.loops[: self.piece_count]

    @property
    def holes(self) -> list[np.ndarray]:
        return self.loops[self.piece_count :]

    @property
    def hole_piece(self) -> np.ndarray:
        """The piece of every hole, (h,)."""
        return self.loop_piece[self.piece_count :]

    @cached_property
    def vertex_ends(self) -> list[int]:
        """(p + 1), where the vertices of each piece begin, and where the last one ends."""
        return [*self.vertex_starts.tolist(), len(self.vertices)]

    @cached_property
    def outline_lengths(self) -> np.ndarray:
        """(p,), of the pieces' outlines, in the scale of `vertices`."""
        loop = np.concatenate(self.outlines)
        start = np.cumsum([0, *(len(each) for each in self.outlines)])
        following = np.roll(loop, -1)
        following[start[1:] - 1] = loop[start[:-1]]
        length = np.linalg.norm(self.vertices[following] - self.vertices[loop], axis=1)
        return np.add.reduceat(length, start[:-1])

    @cached_property
    def own_loops(self) -> list[list[np.ndarray]]:
        """The loops of every piece, its outline first, in the piece's own vertices."""
        own = np.concatenate(self.loops) - np.repeat(
            self.vertex_starts[self.loop_piece], [len(loop) for loop in self.loops]
        )
        result: list[list[np.ndarray]] = [[] for _ in range(self.piece_count)]
        for loop, piece in zip(parts_of(own, starts_of(self.loops)), self.loop_piece.tolist(), strict=True):
            result[piece].append(loop)
        return result

    @cached_property
    def dissection(self) -> Dissection | None:
        """How systems on the surface take it apart; None where no piece is large enough for that."""
        if not is_large(len(self.vertices), self.vertex_piece):
            return None
        return Dissection.of(self.vertices, self.edges, self.vertex_piece)

    @cached_property
    def order(self) -> np.ndarray:
        """The order in which systems on the surface eliminate its vertices, (n,)."""
        if self.dissection is None:
            return local_order(len(self.vertices), self.edges, self.vertex_piece)
        return self.dissection.order

    def vertex_sums(self, values: np.ndarray) -> np.ndarray:
        """Of values (n, ...) at vertices over each piece, (p, ...)."""
        return np.add.reduceat(values, self.vertex_starts)

    def boxes(self, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The lower corner and the size of the box around every piece's map `uv` (n, 2), (p, 2) each."""
        low, high = (
            np.array([reduce.reduceat(along, self.vertex_starts) for along in uv.T]).T
            for reduce in (np.minimum, np.maximum)
        )
        return low, high - low

    def in_unit_square(self, uv: np.ndarray) -> np.ndarray:
        """Every piece's map `uv` (n, 2) moved and scaled, so that the longer side of the box around it is 0 to 1."""
        low, size = self.boxes(uv)
        size = size.max(axis=1, keepdims=True)
        size[size == 0] = 1
        if self.piece_count == 1:
            return (uv - low[0]) / size[0]
        return (uv - low[self.vertex_piece]) / size[self.vertex_piece]

    def numbering(self, pieces: np.ndarray) -> np.ndarray:
        """The number that every vertex has in the surface of the chosen `pieces` (p,) bool, (n,)."""
        return np.cumsum(pieces[self.vertex_piece]) - 1

    def of(self, pieces: np.ndarray, vertex_number: np.ndarray | None = None) -> Surface:
        """The surface of the chosen `pieces` (p,) bool alone."""
        if vertex_number is None:
            vertex_number = self.numbering(pieces)
        chosen, chosen_vertices = pieces[self.piece], pieces[self.vertex_piece]
        new_piece = np.cumsum(pieces) - 1
        made = Surface.__new__(Surface)
        Chart.__init__(
            made,
            **self._fields_of(chosen, vertex_number),
            piece=new_piece[self.piece[chosen]],
            piece_count=int(pieces.sum()),
        )
        made.scaled = None if self.scaled is None else self.scaled[chosen]
        made.vertices = np.asfortranarray(self.vertices[chosen_vertices])
        made.vertex_piece = new_piece[self.vertex_piece[chosen_vertices]]
        made.vertex_starts, made.triangle_starts = (
            np.flatnonzero(np.diff(each, prepend=-1)) for each in (made.vertex_piece, made.piece)
        )
        made.on_boundary = self.on_boundary.reshape(3, -1)[:, chosen].ravel()
        made.loops = [vertex_number[loop] for loop, its in zip(self.loops, self.loop_piece, strict=True) if pieces[its]]
        made.loop_piece = new_piece[self.loop_piece[pieces[self.loop_piece]]]
        # If they are there already
        dissection, order = self.__dict__.get("dissection"), self.__dict__.get("order")
        if dissection is not None:
            made.dissection = Dissection(dissection.key[chosen_vertices], dissection.levels)
        elif order is not None:
            made.order = vertex_number[order[chosen_vertices[order]]]
        return made

    def one(self, k: int) -> Surface:
        """The surface of piece k alone; takes no longer for the others."""
        if self.piece_count == 1:
            return self
        first, end = self.vertex_ends[k : k + 2]
        its = slice(*np.append(self.triangle_starts, len(self.triangles))[k : k + 2])
        edges = slice(*np.searchsorted(self.edges[:, 0], (first, end)))
        made = Surface.__new__(Surface)
        Chart.__init__(
            made,
            self.triangles[its] - first,
            self.edges[edges] - first,
            self.triangle_edges[its] - edges.start,
            self.rest[its],
            self.measure[its],
            self.barrier[its],
            np.zeros(its.stop - its.start, np.int64),
            1,
        )
        made.scaled = None if self.scaled is None else self.scaled[its]
        made.vertices = self.vertices[first:end]
        made.vertex_piece = np.zeros(end - first, np.int64)
        made.vertex_starts = made.triangle_starts = np.zeros(1, np.int64)
        made.on_boundary = self.on_boundary.reshape(3, -1)[:, its].ravel()
        made.loops = self.own_loops[k]
        made.loop_piece = np.zeros(len(made.loops), np.int64)
        return made

    def plugs(self, solid: bool) -> tuple[Chart, np.ndarray] | None:
        """A chart of fans that close all holes, and the fans' centres in space (h, 3), or None if there is no hole.

        The centres are numbered after the surface's own vertices.  If `solid`, the fans have a shape as the surface
        has; else they are air.
        """
        if not self.holes:
            return None
        n = len(self.vertices)
        centres = np.array([self.vertices[loop].mean(axis=0) for loop in self.holes])
        fans = [
            np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), n + i)]) for i, loop in enumerate(self.holes)
        ]
        piece = np.repeat(self.hole_piece, [len(loop) for loop in self.holes])
        triangles = np.concatenate(fans)
        if not solid:
            return air_chart(triangles, n + len(centres), piece, self.piece_count), centres
        edges, triangle_edges = numbered_edges(triangles, n + len(centres))
        points = np.vstack([self.vertices, centres])
        rest, degenerate = laid_flat(points, triangles, np.sqrt(self.piece_count / len(self.triangles)))
        area = signed_areas(rest)
        measure, barrier = np.where(degenerate, 0.0, area), np.where(degenerate, _UNSEEN * area, area)
        return Chart(triangles, edges, triangle_edges, rest, measure, barrier, piece, self.piece_count), centres


def air_chart(triangles: np.ndarray, n: int, piece: np.ndarray, piece_count: int) -> Chart:
    """The chart of triangles (t, 3) of the plane around or within islands, of n vertices in all: each counts alike."""
    edges, triangle_edges = numbered_edges(triangles, n)
    ones = np.ones(len(triangles))
    return Chart(np.asfortranarray(triangles), edges, triangle_edges, None, ones, ones, piece, piece_count)


def numbered_edges(triangles: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The edges (k, 2) of triangles (m, 3), each once and sorted, and each triangle's, (m, 3)."""
    unique, edge = np.unique(edge_keys(triangles, n), return_inverse=True)
    return np.array(np.divmod(unique, n)).T, edge.reshape(3, -1).T


def normalised_pieces(vertices: np.ndarray, topology: Topology) -> tuple[np.ndarray, dict[int, errors.DegenerateError]]:
    """The vertices (n, 3), every piece moved and scaled so that its area is 1, and an error for each without area."""
    starts, piece = topology.vertex_starts, topology.vertex_piece
    number = np.diff(starts, append=len(vertices))
    middle = np.add.reduceat(vertices.T, starts, axis=1) / number
    centred = (vertices.T - middle[:, piece]).T
    extent = np.maximum.reduceat(np.abs(centred).max(axis=1), starts)
    centred /= np.where(extent > 0, extent, 1)[piece, None]
    area = np.add.reduceat(areas_in_space(centred, topology.triangles), topology.triangle_starts)
    sizes = np.diff(topology.triangle_starts, append=len(topology.triangles))
    faults = {
        k: errors.DegenerateError("all its faces have zero area: there is nothing to unwrap", np.arange(sizes[k]))
        for k in np.flatnonzero(~(area > 1e-14)).tolist()
    }
    return centred / np.sqrt(np.where(area > 1e-14, area, 1))[piece, None], faults


def _scales(importance, area, starts, piece):
    """What to multiply the shapes of triangles with so that their areas are as the importance says, and add up to 1."""
    total = np.add.reduceat(area * importance, starts) / np.add.reduceat(area, starts)
    return np.sqrt(importance / total[piece])
