# SPDX-License-Identifier: GPL-3.0-or-later
"""An island as seams are found on it: which of its edges may be cut, and what it is once some are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .chart import normalised_pieces
from .errors import ClosedError, GenusError, ShapeError, UnwrapError
from .islands import Island, find_islands
from .pieces import around_faces, components, joined
from .topology import HalfEdges, Topology, checked_arrays
from .triangles import areas_in_space, corners_of, normals


@dataclass(frozen=True, eq=False)
class Polygons:
    """A mesh of polygons, the seams that it has, and what of it is to be unwrapped.

    vertices          (n, 3) floats, any unit
    corner_vertex     (c,) vertex of each corner; the corners of a face follow each other
    corner_edge       (c,) edge from each corner to the next one of its face
    face_start        (f,) first corner of each face, ascending
    corner_triangles  (t, 3) the faces' triangles, as corners
    seam              (e,) bool, the edges that are cut already
    selected          (f,) bool, the faces that count
    """

    vertices: np.ndarray
    corner_vertex: np.ndarray
    corner_edge: np.ndarray
    face_start: np.ndarray
    corner_triangles: np.ndarray
    seam: np.ndarray
    selected: np.ndarray

    @classmethod
    def of_faces(cls, vertices: ArrayLike, corner_vertex: ArrayLike, sizes: ArrayLike) -> Polygons:
        """Faces of `sizes` (f,) corners without seams, all selected; larger ones become fans of triangles.

        The edges (e,) are sorted by their smaller vertices, then by their larger ones.  Raises `ShapeError`.
        """
        corner_vertex, sizes = np.asarray(corner_vertex, dtype=np.int64), np.asarray(sizes, dtype=np.int64)
        vertices = np.asarray(vertices, dtype=np.float64)
        if not len(sizes):
            raise ShapeError("the mesh has no faces: there is nothing to cut")
        if sizes.sum() != len(corner_vertex) or (sizes < 3).any():
            raise ShapeError("the sizes of the faces must be 3 or more, and sum up to the number of corners")
        face_start = np.cumsum(sizes) - sizes
        face, following = around_faces(face_start, len(corner_vertex))
        ends = np.sort([corner_vertex, corner_vertex[following]], axis=0)
        unique, edge = np.unique(ends[0] * np.int64(len(vertices)) + ends[1], return_inverse=True)
        corner = np.arange(len(corner_vertex))
        inner = corner[(corner > face_start[face]) & (following != face_start[face])]
        fans = np.column_stack([face_start[face[inner]], inner, following[inner]])
        seam, selected = np.zeros(len(unique), bool), np.ones(len(sizes), bool)
        return cls(vertices, corner_vertex, edge.ravel(), face_start, fans, seam, selected)

    @classmethod
    def of_triangles(cls, vertices: ArrayLike, triangles: ArrayLike) -> Polygons:
        """The same of triangles (m, 3).  Raises `SurfaceError` where the arrays are not those of a mesh."""
        points, corners = checked_arrays(vertices, triangles)
        return cls.of_faces(points, np.ascontiguousarray(corners).ravel(), np.full(len(corners), 3))

    @cached_property
    def ends(self) -> np.ndarray:
        """The vertices of each edge, (e, 2), the smaller one first; zeros where no face has it."""
        following = around_faces(self.face_start, len(self.corner_vertex))[1]
        ends = np.zeros((len(self.seam), 2), np.int64)
        ends[self.corner_edge] = np.sort(np.column_stack([self.corner_vertex, self.corner_vertex[following]]), axis=1)
        return ends

    @cached_property
    def lengths(self) -> np.ndarray:
        """The length of each edge, (e,)."""
        one, other = self.vertices[self.ends.T]
        return np.linalg.norm(other - one, axis=1)

    def with_seams(self, seam: np.ndarray) -> Polygons:
        """The same with other seams, (e,) bool."""
        return replace(self, seam=seam)

    def islands(self) -> list[Island]:
        """The islands, as `find_islands` returns them."""
        its = self
        return find_islands(
            its.corner_vertex, its.corner_edge, its.face_start, its.seam, its.selected, its.corner_triangles
        )


class Cuttable(HalfEdges):
    """An island that can be unwrapped once it is cut: sound but that it may be closed, or have handles.

    Parameters
    ----------
    polygons : Polygons
    island : one of the islands of these

    Attributes
    ----------
    points : (n, 3), moved and scaled so that the area is 1
    triangles, edges, triangle_edges : as those of a `Topology`, which is `topology`
    mesh_vertex : (n,), mesh_face : (m,)
    mesh_corners : (m, 3), the mesh's corners of each triangle
    mesh_edge : (k,), the mesh's edge, or -1 for a diagonal of a face

    Raises the `SurfaceError` of what no cut can mend.
    """

    def __init__(self, polygons: Polygons, island: Island):
        its = polygons
        face, following = around_faces(its.face_start, len(its.corner_vertex))
        points, triangles = checked_arrays(its.vertices[island.vertices], island.triangles)
        self.topology = topology = Topology(triangles, len(points))
        faults = [e for e in topology.faults().values() if not isinstance(e, ClosedError | GenusError)]
        self.points, flat = normalised_pieces(points, topology)
        for fault in (*faults, *flat.values()):
            raise fault
        self.triangles, self.triangle_edges, self.edges = topology.triangles, topology.triangle_edges, topology.edges
        self.mesh_corners = island.triangle_corners
        self.mesh_vertex, self.mesh_face = island.vertices, face[island.triangle_corners[:, 0]]
        self.area = float(areas_in_space(points, topology.triangles).sum())
        start = island.triangle_corners.T.ravel()
        end = np.roll(island.triangle_corners.T, -1, axis=0).ravel()
        side = np.where(following[start] == end, its.corner_edge[start], -1)
        side = np.where(following[end] == start, its.corner_edge[end], side)
        self.mesh_edge = np.full(len(topology.edges), -1, np.int64)
        self.mesh_edge[self.half_edge_edges] = side

    @cached_property
    def is_whole(self) -> np.ndarray:
        """(k,) bool, the edges between two triangles."""
        return self.topology.edge_uses == 2

    @cached_property
    def inner(self) -> np.ndarray:
        """(k,) bool, the edges between two faces: those that a seam can run along."""
        return self.is_whole & (self.mesh_edge >= 0)

    @cached_property
    def on_rim(self) -> np.ndarray:
        """(n,) bool, the vertices on the boundary."""
        return self.touched(~self.is_whole)

    @cached_property
    def fewest(self) -> int:
        """How many edges a cut must have at least: one alone would leave an outline of two edges between the same two
        vertices, which is none."""
        return 2 if self.topology.is_closed[0] else 0

    def touched(self, edges: np.ndarray) -> np.ndarray:
        """The vertices, (n,) bool, of the chosen edges, (k,) bool."""
        found = np.zeros(len(self.points), bool)
        found[self.edges[edges]] = True
        return found

    def degrees(self, edges: np.ndarray) -> np.ndarray:
        """How many of the chosen edges, (k,) bool, meet at each vertex, (n,)."""
        return np.bincount(self.edges[edges].ravel(), minlength=len(self.points))

    @cached_property
    def sides(self) -> tuple[np.ndarray, np.ndarray]:
        """The two half-edges of every edge, (k,) each; twice the same where it has one triangle."""
        edge = self.half_edge_edges
        first, last = np.empty((2, len(self.edges)), np.int64)
        half_edge = np.arange(len(edge))
        first[edge[::-1]], last[edge] = half_edge[::-1], half_edge
        return first, last

    @cached_property
    def lengths(self) -> np.ndarray:
        """(k,), where the area is 1."""
        one, other = self.points[self.edges.T]
        return np.linalg.norm(other - one, axis=1)

    @cached_property
    def areas(self) -> np.ndarray:
        """(m,), whose sum is 1."""
        return areas_in_space(self.points, self.triangles)

    @cached_property
    def normals(self) -> np.ndarray:
        """(m, 3), of length 1, or 0 where there is no area."""
        normal = normals(corners_of(self.points, self.triangles))
        length = np.linalg.norm(normal, axis=1)
        return normal / np.where(length > 0, length, 1)[:, None]

    @cached_property
    def dihedral(self) -> np.ndarray:
        """(k,), the angle between the two faces at each edge in radians: 0 where flat, negative where concave."""
        m = len(self.triangles)
        first, last = self.sides
        one, other = self.normals[first % m], self.normals[last % m]
        angle = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
        angle[~one.any(axis=1) | ~other.any(axis=1)] = 0
        opposite = self.triangles.T.ravel()[(last + 2 * m) % (3 * m)]
        height = ((self.points[opposite] - self.points[self.edges[:, 0]]) * one).sum(axis=1)
        return np.where(self.is_whole, np.where(height > 0, -angle, angle), 0)

    def of_mesh(self, values: ArrayLike) -> np.ndarray:
        """Values (e,) of the mesh's edges at the edges here, (k,); those of diagonals are 0."""
        return np.where(self.mesh_edge >= 0, np.asarray(values)[self.mesh_edge], 0)

    def opened(self, cut: np.ndarray) -> Opened:
        """The same triangles cut along the edges `cut` (k,) bool."""
        return Opened(self, cut)


class Opened:
    """The triangles of a `Cuttable` cut along some edges; vertices on a cut become several.

    Attributes
    ----------
    triangles : (m, 3) of the new vertices
    origin : (n',), the vertex that each of these is a copy of
    """

    def __init__(self, mesh: Cuttable, cut: np.ndarray):
        self._mesh = mesh
        m = len(mesh.triangles)
        self._whole = mesh.is_whole & ~cut
        first, last = (side[self._whole] for side in mesh.sides)
        here, there = (first + m) % (3 * m), (last + m) % (3 * m)
        self.vertex_count, vertex = components(3 * m, np.concatenate([first, here]), np.concatenate([there, last]))
        self._corner_vertex = vertex.astype(np.int64)
        self.triangles = self._corner_vertex.reshape(3, m).T
        self.origin = np.empty(self.vertex_count, np.int64)
        self.origin[vertex] = mesh.triangles.T.ravel()

    @cached_property
    def ends(self) -> np.ndarray:
        """The new vertices of each edge, (k, 2); those of one side where it is cut."""
        first, corners = self._mesh.sides[0], self._corner_vertex
        return np.column_stack([corners[first], corners[(first + len(self.triangles)) % len(corners)]])

    @cached_property
    def rim(self) -> tuple[np.ndarray, np.ndarray]:
        """The new vertices at both ends of every half-edge without a neighbour, (r,) each."""
        outer = np.flatnonzero(~self._whole[self._mesh.half_edge_edges])
        corners = self._corner_vertex
        return corners[outer], corners[(outer + len(self.triangles)) % len(corners)]

    @cached_property
    def loop(self) -> np.ndarray:
        """(n',), the number of the boundary loop that each new vertex is on, counted from 0, or -1."""
        start, end = self.rim
        part = components(self.vertex_count, start, end)[1]
        loop = np.full(self.vertex_count, -1)
        loop[start] = np.unique(part[start], return_inverse=True)[1]
        return loop

    @cached_property
    def charts(self) -> tuple[int, np.ndarray]:
        """How many charts there are, and that of each triangle, (m,), numbered by their first triangles."""
        m = len(self.triangles)
        first, last = (side[self._whole] % m for side in self._mesh.sides)
        count, chart = components(m, first, last)
        rank = np.argsort(np.argsort(np.unique(chart, return_index=True)[1]))
        return count, rank[chart]


def cuttables(polygons: Polygons, islands: Sequence[Island]) -> list[Cuttable | UnwrapError]:
    """The `Cuttable` of every island, or the error that says why there is none."""
    found: list[Cuttable | UnwrapError] = []
    for island in islands:
        try:
            found.append(Cuttable(polygons, island))
        except UnwrapError as error:
            found.append(error)
    return found


def need_cuts(islands: Sequence[Island]) -> np.ndarray:
    """Which of the islands, (p,) bool, are closed or have handles, and are sound but for that."""
    found = np.zeros(len(islands), bool)
    if islands:
        its = joined([island.vertices[:, None] for island in islands], [island.triangles for island in islands])
        vertices, triangles, starts, triangle_starts = its
        faults = Topology(triangles, len(vertices), starts, triangle_starts).faults()
        found[[k for k, fault in faults.items() if isinstance(fault, ClosedError | GenusError)]] = True
    return found
