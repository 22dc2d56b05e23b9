# SPDX-License-Identifier: GPL-3.0-or-later
"""A triangulated surface, checked once when it is made; everything after it trusts it."""

import copy
from functools import cached_property

import numpy as np

from . import errors
from .pieces import components, first_and_last, numbers
from .solver import banded, nested_dissection
from .triangles import areas_in_space, corner_angles, corners_of, hat_gradients, laid_flat, signed_areas

_KEYS = 2_000_000  # three numbers below it go into one of 64 bits


class Surface:
    """A connected, orientable, manifold triangle surface of genus 0 with at least one boundary loop; or several.

    Parameters
    ----------
    vertices : (n, 3) floats, any unit
    triangles : (m, 3) integers, consistently wound
    vertex_starts, triangle_starts : (p,) where the vertices and the triangles of each piece begin

    Attributes
    ----------
    vertices : (n, 3), the input, every piece moved and scaled so that its area is 1
    vertex_piece : (n,), piece : (m,), the piece that a vertex and a triangle belongs to, 0 if there is only one
    triangles : (m, 3)
    edges : (k, 2), each edge once, smaller index first
    triangle_edges : (m, 3), the edge from corner c to corner c + 1
    flat : (m, 3, 2), the corners of every triangle laid isometrically in the plane, counter-clockwise
    area : (m,), positive, in the scale of `vertices`
    degenerate : (m,), True where the surface's triangle has no area and `flat` is made up
    air : (m,), True for triangles that are no part of the surface, but of the plane around it
    on_boundary : (3 m,), True for half-edges without a neighbour
    loops : list of boundary loops, the longest first, each in the direction of its triangles' winding

    Raises a subclass of `SurfaceError`, one for each cause.
    """

    def __init__(self, vertices, triangles, vertex_starts=(0,), triangle_starts=(0,)):
        vertices, triangles = checked_arrays(vertices, triangles)
        self.triangles = triangles
        self.vertex_starts, self.triangle_starts = np.asarray(vertex_starts), np.asarray(triangle_starts)
        self.vertex_piece = numbers(self.vertex_starts, len(vertices))
        self.piece = numbers(self.triangle_starts, len(triangles))
        self._check_triangles(len(vertices))
        self._normalise(vertices)
        self._check_edges()
        self.loops = self._boundary_loops()
        self._check_topology()
        size = np.sqrt(len(self.vertex_starts) / len(triangles))  # every piece has the area 1
        self.flat, self.degenerate = laid_flat(self.vertices, triangles, size)
        self.area = signed_areas(self.flat)
        self.air = np.zeros(len(triangles), bool)

    def sums(self, values):
        """Of values (m,) at triangles over each piece, (p,)."""
        return np.add.reduceat(values, self.triangle_starts)

    def _normalise(self, vertices):
        count = np.diff(self.vertex_starts, append=len(vertices))
        middle = np.add.reduceat(vertices.T, self.vertex_starts, axis=1) / count
        centred = (vertices.T - middle[:, self.vertex_piece]).T
        extent = np.maximum.reduceat(np.abs(centred).max(axis=1), self.vertex_starts)
        centred /= np.where(extent > 0, extent, 1)[self.vertex_piece, None]
        area = self.sums(areas_in_space(centred, self.triangles))
        if not (area > 1e-14).all():
            wrong = np.flatnonzero((area <= 1e-14)[self.piece])
            raise errors.DegenerateError("all its faces have zero area: there is nothing to unwrap", wrong)
        self.vertices = centred / np.sqrt(area)[self.vertex_piece, None]

    def _check_triangles(self, n):
        triangles = self.triangles
        repeated = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
        if repeated.any():
            raise errors.DegenerateError(
                f"{_count(repeated, 'face', 'faces')} with one vertex twice: dissolve degenerate faces",
                np.flatnonzero(repeated),
            )
        if not np.bincount(triangles.ravel(), minlength=n).all():
            raise errors.LooseVertexError("some vertices belong to no face: delete the loose vertices")
        corners = triangles.T
        a, c = corners.min(axis=0), corners.max(axis=0)
        b = corners.sum(axis=0) - a - c
        if n < _KEYS and np.diff(np.sort((a * n + b) * n + c)).all():
            return
        order = np.lexsort((c, b, a))
        same = (np.diff(a[order]) == 0) & (np.diff(b[order]) == 0) & (np.diff(c[order]) == 0)
        if same.any():
            raise errors.DuplicateError(
                f"{_count(same, 'face', 'faces')} on top of another with the same corners: delete the duplicates",
                order[1:][same],
            )

    def _check_edges(self):
        count = self._number_edges()
        edge = self.half_edge_edges
        start, end = self.half_edges
        if count.max() > 2:
            raise errors.NonManifoldEdgeError(
                f"{_count(count > 2, 'edge has', 'edges have')} more than two faces: split the faces there,"
                " or mark seams",
                np.flatnonzero(count[edge] > 2) % len(self.triangles),
            )
        forward = np.bincount(edge, weights=start < end, minlength=len(count))
        wrong = (count == 2) & (forward != 1)
        if wrong.any():
            raise errors.WindingError(
                f"the faces at {_count(wrong, 'edge', 'edges')} face opposite ways: recalculate the normals",
                np.flatnonzero(wrong[edge]) % len(self.triangles),
            )
        self.on_boundary = count[edge] == 1

    def _number_edges(self):
        """Make `edges` and `triangle_edges`; returns how many triangles each edge has."""
        n = len(self.vertices)
        unique, edge, count = np.unique(_edge_keys(self.triangles, n), return_inverse=True, return_counts=True)
        self.edges = np.array(np.divmod(unique, n)).T
        self.triangle_edges = edge.reshape(3, -1).T
        return count

    def _check_vertices(self):
        # Two corners at one vertex belong to one fan if their triangles share an edge there.
        m = len(self.triangles)
        corner = np.arange(3 * m)  # corner c of triangle t is c * m + t, which is also the half-edge that starts there
        following = (corner + m) % (3 * m)
        first, second = self._twins
        link = np.concatenate([first, following[first]]), np.concatenate([following[second], second])
        fans, fan = components(3 * m, *link)
        if fans > len(self.vertices):
            fans_at = np.bincount(self.triangles.T.ravel()[np.unique(fan, return_index=True)[1]])
            wrong = fans_at > 1
            raise errors.NonManifoldVertexError(
                f"at {_count(wrong, 'vertex', 'vertices')} the surface touches itself: split it there",
                np.flatnonzero(wrong[self.triangles].any(axis=1)),
            )

    def _check_topology(self):
        n, p = len(self.vertices), len(self.vertex_starts)
        loops, vertices, edges, triangles = (
            np.bincount(self.vertex_piece[of], minlength=p)
            for of in ([loop[0] for loop in self.loops], slice(None), self.edges[:, 0], self.triangles[:, 0])
        )
        # Euler's formula: twice the handles, and vertices at which the surface touches itself
        excess = 2 - loops - (vertices - edges + triangles)
        m = len(self.triangles)
        first, second = self._twins
        found, part = components(m, first % m, second % m)
        if found == p and len(np.unique(part * p + self.piece)) == p and loops.all() and not excess.any():
            return
        self._check_vertices()
        found, part = components(n, *self.edges.T)
        if found != p or len(np.unique(part * p + self.vertex_piece)) > p:
            raise errors.DisconnectedError(f"it has {found} separate pieces: unwrap each on its own")
        if not loops.all():
            raise errors.ClosedError("it is closed: mark a seam to cut it open")
        handles = (excess // 2).max()
        raise errors.GenusError(
            f"it has {handles} {'handle' if handles == 1 else 'handles'}, like a torus: mark seams to cut it open"
        )

    @property
    def loop_piece(self):
        """The piece of every loop, (l,)."""
        return self.vertex_piece[[loop[0] for loop in self.loops]]

    @property
    def half_edges(self):
        """Start and end vertices of the half-edges, (3 m,) each; number c * m + t runs from corner c of triangle t."""
        return _half_edges(self.triangles)

    @property
    def half_edge_edges(self):
        """The edge of every half-edge, (3 m,)."""
        return self.triangle_edges.T.ravel()

    @property
    def _twins(self):
        # The two half-edges of every interior edge.
        first, last = first_and_last(np.arange(self.triangles.size), self.half_edge_edges, len(self.edges))
        inner = first != last
        return first[inner], last[inner]

    def _boundary_loops(self):
        start, end = (ends[self.on_boundary] for ends in self.half_edges)
        if len(np.unique(start)) < len(start):
            self._check_vertices()
        following = dict(zip(start.tolist(), end.tolist(), strict=True))
        loops = []
        while following:
            first, vertex = following.popitem()
            loop = [first]
            while vertex != first:
                loop.append(vertex)
                vertex = following.pop(vertex)
            # Start at the smallest index: the loop does not depend on the order of the triangles.
            least = loop.index(min(loop))
            loops.append(np.array(loop[least:] + loop[:least]))
        if len(loops) == len(self.vertex_starts):
            return sorted(loops, key=lambda loop: loop[0])  # one for each piece
        return sorted(loops, key=lambda loop: (-round(perimeter(self.vertices[loop]), 12), loop[0]))

    @cached_property
    def hats(self):
        """Gradients, in `flat`, of the hat functions of every triangle's second and third corners, (2, 2, m)."""
        return hat_gradients(self.flat)

    @cached_property
    def order(self):
        """The order in which systems on the surface eliminate its vertices, (n,)."""
        if len(self.vertex_starts) > 1:
            return banded(len(self.vertices), self.edges)
        return nested_dissection(self.vertices, self.edges)

    @cached_property
    def angle_sums(self):
        """The sum of the triangles' angles at every vertex, (n,), in radians."""
        return np.bincount(self.triangles.T.ravel(), corner_angles(self.flat).T.ravel(), len(self.vertices))

    def filled(self, air=False):
        """The surface with every hole (all loops but the longest) closed by a fan; its first triangles are ours.

        With `air` the fans belong to the plane, and take whatever shape the layout gives them.
        """
        holes = self.loops[len(self.vertex_starts) :]
        if not holes:
            return self
        n = len(self.vertices)
        centres = [self.vertices[loop].mean(axis=0) for loop in holes]
        fans = [np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), n + i)]) for i, loop in enumerate(holes)]
        closed = Surface(np.vstack([self.vertices, *centres]), np.vstack([self.triangles, *fans]))
        closed.air[len(self.triangles) :] = air
        return closed

    def with_air(self, triangles, uv):
        """The surface with `triangles` (t, 3) of air, whose vertices in the layout `uv` follow its own."""
        wider = copy.copy(self)
        wider.vertices = np.pad(self.vertices, ((0, len(uv) - len(self.vertices)), (0, 0)))
        wider.triangles = np.hstack([self.triangles.T, triangles.T]).T
        rim = self.half_edge_edges[self.on_boundary]
        key = np.concatenate([self.edges[rim] @ [len(uv), 1], _edge_keys(triangles, len(uv))])
        unique, edge = np.unique(key, return_inverse=True)
        number = np.full(len(unique), -1)
        number[edge[: len(rim)]] = rim
        new = number < 0
        number[new] = len(self.edges) + np.arange(new.sum())
        wider.edges = np.hstack([self.edges.T, np.divmod(unique[new], len(uv))]).T
        wider.triangle_edges = np.hstack([self.triangle_edges.T, number[edge[len(rim) :]].reshape(3, -1)]).T
        some_shape = np.broadcast_to([[0.0, 0], [1, 0], [0, 1]], (len(triangles), 3, 2))
        wider.flat = np.concatenate([self.flat.T, some_shape.T], axis=2).T
        wider.hats = np.concatenate([self.hats, hat_gradients(some_shape)], axis=2)
        wider.area, wider.degenerate = (np.pad(each, (0, len(triangles))) for each in (self.area, self.degenerate))
        wider.air = np.pad(self.air, (0, len(triangles)), constant_values=True)
        wider.vertex_piece, wider.piece = (np.zeros(len(each), np.int64) for each in (uv, wider.triangles))
        wider.order = nested_dissection(uv, wider.edges)
        del wider.loops, wider.on_boundary  # those of the surface alone
        return wider

    def shapes_in(self, uv):
        """The corners (m, 3, 2) of the surface's triangles laid flat, and of air where the layout has it."""
        if not self.air.any():
            return self.flat
        return np.where(self.air, corners_of(uv, self.triangles).T, self.flat.T).T


def checked_arrays(vertices, triangles):
    """Both as arrays of finite floats (n, 3) and of indices (m, 3); raises `SurfaceError`."""
    try:
        vertices = np.asfortranarray(vertices, dtype=np.float64)
        indices = np.asarray(triangles)
        triangles = np.asfortranarray(indices, dtype=np.int64)
    except (TypeError, ValueError) as error:
        raise errors.ShapeError(f"vertices and triangles must be arrays of numbers: {error}") from None
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise errors.ShapeError(f"vertices must have the shape (n, 3), not {vertices.shape}")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or not len(triangles):
        raise errors.ShapeError(f"triangles must have the shape (m, 3) with m > 0, not {triangles.shape}")
    if not np.array_equal(indices, triangles):
        raise errors.ShapeError("triangles must be whole numbers")
    if not np.isfinite(vertices).all():
        bad = ~np.isfinite(vertices).all(axis=1)
        raise errors.NotFiniteError(
            f"{_count(bad, 'vertex has', 'vertices have')} coordinates that are no numbers (NaN or infinite):"
            " delete or move what is there"
        )
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise errors.IndexRangeError(f"a triangle refers to a vertex outside 0 to {len(vertices) - 1}")
    return vertices, triangles


def _half_edges(triangles):
    corners = triangles.T
    return corners.ravel(), np.roll(corners, -1, axis=0).ravel()


def _edge_keys(triangles, n):
    """One number for the edge of every half-edge, (3 m,): the smaller vertex times n, and the larger."""
    start, end = _half_edges(triangles)
    return np.minimum(start, end) * n + np.maximum(start, end)


def edge_lengths(points):
    """Lengths of the sides of a closed polygon (n, d); side i runs from point i to i + 1."""
    return np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)


def perimeter(points):
    """Length of the closed polygon (n, d)."""
    return edge_lengths(points).sum()


def _count(mask, one, more):
    number = int(np.sum(mask))
    return f"{number} {one if number == 1 else more}"
