# SPDX-License-Identifier: GPL-3.0-or-later
"""How triangles hang together: their edges, boundary loops, pieces and handles, and what is wrong with them.

A half-edge is a side of a triangle, run in the direction of the triangle's winding.  Half-edge `c * m + t` starts at
corner c of triangle t and ends at the next corner, m being the number of triangles.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from . import errors
from .pieces import components, first_and_last, numbers, parts_of

_KEYS = 2_000_000  # vertices, up to which the numbers of three go into one number of 64 bits


class HalfEdges:
    """Mix-in for what has `triangles` (m, 3) and `triangle_edges` (m, 3): half-edge c * m + t runs from corner c of
    triangle t."""

    triangles: np.ndarray
    triangle_edges: np.ndarray

    @property
    def half_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Start and end vertices of the half-edges, (3 m,) each."""
        return half_edges(self.triangles)

    @property
    def half_edge_edges(self) -> np.ndarray:
        """The edge of every half-edge, (3 m,)."""
        return self.triangle_edges.T.ravel()


class Topology(HalfEdges):
    """The connections of triangles.  Everything can be asked of whatever triangles there are; nothing raises.

    Parameters
    ----------
    triangles : (m, 3) integers
    n : number of vertices
    vertex_starts, triangle_starts : (p,), where the vertices and the triangles of each piece begin; by default, all
        are one piece.  No triangle may have vertices of two pieces.

    Attributes
    ----------
    edges : (k, 2), each edge once, smaller vertex first, sorted
    triangle_edges : (m, 3), the edge from corner c to corner c + 1
    edge_uses : (k,), how many triangles each edge has
    vertex_piece : (n,), triangle_piece : (m,), the piece of each
    """

    def __init__(
        self,
        triangles: np.ndarray,
        n: int,
        vertex_starts: Sequence[int] | np.ndarray = (0,),
        triangle_starts: Sequence[int] | np.ndarray = (0,),
    ):
        self.triangles = np.asfortranarray(triangles, dtype=np.int64)
        self.vertex_count = int(n)
        self.vertex_starts, self.triangle_starts = np.asarray(vertex_starts), np.asarray(triangle_starts)
        self.vertex_piece = numbers(self.vertex_starts, n)
        self.triangle_piece = numbers(self.triangle_starts, len(triangles))
        unique, edge, uses = np.unique(edge_keys(self.triangles, n), return_inverse=True, return_counts=True)
        self.edges = np.array(np.divmod(unique, n)).T
        self.triangle_edges = edge.reshape(3, -1).T
        self.edge_uses = uses

    @property
    def piece_count(self) -> int:
        """How many pieces there are, p."""
        return len(self.vertex_starts)

    @cached_property
    def on_boundary(self) -> np.ndarray:
        """(3 m,) bool, the half-edges without a neighbour."""
        return self.edge_uses[self.half_edge_edges] == 1

    @cached_property
    def repeated(self) -> np.ndarray:
        """(m,) bool, the triangles that have one vertex twice."""
        return (self.triangles == np.roll(self.triangles, 1, axis=1)).any(axis=1)

    @cached_property
    def duplicate(self) -> np.ndarray:
        """(m,) bool, the triangles with the same three vertices as an earlier one."""
        n, corners = self.vertex_count, self.triangles.T
        a, c = corners.min(axis=0), corners.max(axis=0)
        b = corners.sum(axis=0) - a - c
        found = np.zeros(len(self.triangles), bool)
        if n < _KEYS and np.diff(np.sort((a * n + b) * n + c)).all():
            return found
        order = np.lexsort((c, b, a))
        same = (np.diff(a[order]) == 0) & (np.diff(b[order]) == 0) & (np.diff(c[order]) == 0)
        found[order[1:][same]] = True
        return found

    @cached_property
    def loose(self) -> np.ndarray:
        """(n,) bool, the vertices that belong to no triangle."""
        return np.bincount(self.triangles.ravel(), minlength=self.vertex_count) == 0

    @cached_property
    def crowded(self) -> np.ndarray:
        """(k,) bool, the edges with more than two triangles."""
        return self.edge_uses > 2

    @cached_property
    def misaligned(self) -> np.ndarray:
        """(k,) bool, the edges whose two triangles run along them the same way, so that one is inside out."""
        start, end = self.half_edges
        forward = np.bincount(self.half_edge_edges, weights=start < end, minlength=len(self.edges))
        return (self.edge_uses == 2) & (forward != 1)

    @cached_property
    def pinched(self) -> np.ndarray:
        """(n,) bool, the vertices at which several fans of triangles touch."""
        m, n = len(self.triangles), self.vertex_count
        # Two corners at one vertex belong to one fan if their triangles share an edge there.
        corner = np.arange(3 * m)
        following = (corner + m) % (3 * m)
        first, second = self.twins
        link = np.concatenate([first, following[first]]), np.concatenate([following[second], second])
        fan = components(3 * m, *link)[1]
        return np.bincount(self.triangles.T.ravel()[np.unique(fan, return_index=True)[1]], minlength=n) > 1

    @cached_property
    def twins(self) -> tuple[np.ndarray, np.ndarray]:
        """The two half-edges of every inner edge, (i,) each."""
        first, last = first_and_last(np.arange(self.triangles.size), self.half_edge_edges, len(self.edges))
        inner = self.edge_uses == 2
        return first[inner], last[inner]

    @cached_property
    def component_counts(self) -> np.ndarray:
        """(p,), how many parts each piece has whose triangles share no edges."""
        m = len(self.triangles)
        first, second = self.twins
        part = components(m, first % m, second % m)[1]
        return np.bincount(self.triangle_piece[np.unique(part, return_index=True)[1]], minlength=self.piece_count)

    @cached_property
    def _traced(self) -> tuple[list[np.ndarray], np.ndarray]:
        """The loops of all pieces in which these can be told apart, and the other pieces, (p,) bool: those are crowded,
        misaligned, or several loops pass through one vertex."""
        start, end = (ends[self.on_boundary] for ends in self.half_edges)
        tangled = np.zeros(self.piece_count, bool)
        tangled[self.vertex_piece[self.edges[self.crowded | self.misaligned].ravel()]] = True
        tangled[self.vertex_piece[np.flatnonzero(np.bincount(start, minlength=self.vertex_count) > 1)]] = True
        clear = ~tangled[self.vertex_piece[start]]
        number = np.empty(self.vertex_count, np.intp)
        number[start[clear]] = np.arange(clear.sum())
        return _loops(start[clear], number[end[clear]]), tangled

    @property
    def loops(self) -> list[np.ndarray]:
        """The boundary loops, each in the direction of its triangles' winding and from its smallest vertex on, by which
        they are sorted; none of a piece in which they cannot be told apart, since it is pinched, crowded or misaligned.
        """
        return self._traced[0]

    @cached_property
    def loop_piece(self) -> np.ndarray:
        """The piece of every loop, (l,)."""
        return self.vertex_piece[[loop[0] for loop in self.loops]] if self.loops else np.zeros(0, int)

    @cached_property
    def loop_counts(self) -> np.ndarray:
        """(p,), the boundary loops of each piece."""
        return np.bincount(self.loop_piece, minlength=self.piece_count)

    @property
    def is_closed(self) -> np.ndarray:
        """(p,) bool, the pieces without a boundary."""
        return np.bincount(self.triangle_piece, self.on_boundary.reshape(3, -1).any(axis=0), self.piece_count) == 0

    @cached_property
    def excess(self) -> np.ndarray:
        """(p,), 2 - V + E - F - loops: for sound pieces twice the handles; others are pinched or have several parts."""
        vertices, edges, triangles = (
            np.bincount(self.vertex_piece[of], minlength=self.piece_count)
            for of in (slice(None), self.edges[:, 0], self.triangles[:, 0])
        )
        return 2 - self.loop_counts - (vertices - edges + triangles)

    @property
    def handles(self) -> np.ndarray:
        """(p,), the handles of pieces that have no fault but these."""
        return self.excess // 2

    def faults(self) -> dict[int, errors.SurfaceError]:
        """For every piece that is no disk, with or without holes, the first reason why."""
        found: dict[int, errors.SurfaceError] = {}

        def note(at_fault, of_piece, message, triangles=None):
            """Keep the fault of every piece that has something `at_fault`, (x,) bool, and that has no earlier fault.

            `of_piece` (x,) is the piece of each such thing, `triangles` (m,) bool are those to name.
            """
            for k in np.unique(of_piece[at_fault]).tolist():
                if k not in found:
                    mine = None if triangles is None else triangles & (self.triangle_piece == k)
                    which = () if mine is None else np.flatnonzero(mine) - self.triangle_starts[k]
                    found[k] = message(int((at_fault & (of_piece == k)).sum()), which)

        edge_piece = self.vertex_piece[self.edges[:, 0]]
        note(self.repeated, self.triangle_piece, _repeated, self.repeated)
        note(self.loose, self.vertex_piece, _loose)
        note(self.duplicate, self.triangle_piece, _duplicate, self.duplicate)
        note(self.crowded, edge_piece, _crowded, self.crowded[self.triangle_edges].any(axis=1))
        note(self.misaligned, edge_piece, _misaligned, self.misaligned[self.triangle_edges].any(axis=1))
        one_part = self.component_counts == 1
        sound = one_part & (self.loop_counts > 0) & (self.excess == 0) & ~self._traced[1]
        if sound.all():
            return found
        note(self.pinched, self.vertex_piece, _pinched, self.pinched[self.triangles].any(axis=1))
        for k in np.flatnonzero(~sound).tolist():
            if k not in found:
                if not one_part[k]:
                    found[k] = errors.DisconnectedError(
                        f"it has {self.component_counts[k]} separate pieces: unwrap each on its own"
                    )
                elif not self.loop_counts[k]:
                    found[k] = errors.ClosedError("it is closed: mark a seam to cut it open")
                else:
                    text = count(int(self.handles[k]), "handle", "handles")
                    found[k] = errors.GenusError(f"it has {text}, like a torus: mark seams to cut it open")
        return found


def _repeated(number, triangles):
    text = f"{count(number, 'face', 'faces')} with one vertex twice: dissolve degenerate faces"
    return errors.DegenerateError(text, triangles)


def _loose(_number, triangles):
    return errors.LooseVertexError("some vertices belong to no face: delete the loose vertices", triangles)


def _duplicate(number, triangles):
    text = f"{count(number, 'face', 'faces')} on top of another with the same corners: delete the duplicates"
    return errors.DuplicateError(text, triangles)


def _crowded(number, triangles):
    text = count(number, "edge has", "edges have")
    text = f"{text} more than two faces: split the faces there, or mark seams"
    return errors.NonManifoldEdgeError(text, triangles)


def _misaligned(number, triangles):
    text = f"the faces at {count(number, 'edge', 'edges')} face opposite ways: recalculate the normals"
    return errors.WindingError(text, triangles)


def _pinched(number, triangles):
    text = f"at {count(number, 'vertex', 'vertices')} the surface touches itself: split it there"
    return errors.NonManifoldVertexError(text, triangles)


def _loops(vertex, following):
    """The loops of vertices (k,), of which each is followed by that with the number `following` (k,): each loop begins
    at its smallest vertex, and they are sorted by it.

    All go around at once, by steps that double.
    """
    least, ahead = vertex, following
    while (least > least[ahead]).any():
        least, ahead = np.minimum(least, least[ahead]), ahead[ahead]
    begins = vertex == least
    steps, ahead = (~begins).astype(np.intp), np.where(begins, np.arange(len(vertex)), following)
    while not begins[ahead].all():
        steps, ahead = steps + steps[ahead], ahead[ahead]
    # Of each loop first the beginning, and then what is the farthest from it.
    order = np.lexsort((np.where(begins, -len(vertex), -steps), least))
    return parts_of(vertex[order], np.flatnonzero(begins[order]))


def checked_arrays(vertices: ArrayLike, triangles: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Both as arrays, of finite floats (n, 3) and of indices (m, 3); raises `SurfaceError`."""
    try:
        vertices = np.asfortranarray(vertices, dtype=np.float64)
        indices = np.asarray(triangles)
        triangles = np.asfortranarray(indices, dtype=np.int64)
    except (TypeError, ValueError, OverflowError) as error:
        raise errors.ShapeError(f"vertices and triangles must be arrays of numbers: {error}") from None
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise errors.ShapeError(f"vertices must have the shape (n, 3), not {vertices.shape}")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or not len(triangles):
        raise errors.ShapeError(f"triangles must have the shape (m, 3) with m > 0, not {triangles.shape}")
    if indices.dtype.kind not in "iu" and not np.array_equal(indices, triangles):
        raise errors.ShapeError("triangles must be whole numbers")
    if not np.isfinite(vertices).all():
        bad = ~np.isfinite(vertices).all(axis=1)
        raise errors.NotFiniteError(
            f"{count(int(bad.sum()), 'vertex has', 'vertices have')} coordinates that are no numbers (NaN or infinite):"
            " delete or move what is there"
        )
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise errors.IndexRangeError(f"a triangle refers to a vertex outside 0 to {len(vertices) - 1}")
    return vertices, triangles


def half_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Start and end vertices of the half-edges of triangles (m, 3), (3 m,) each."""
    corners = triangles.T
    return corners.ravel(), np.roll(corners, -1, axis=0).ravel()


def edge_keys(triangles: np.ndarray, n: int) -> np.ndarray:
    """One number for the edge of every half-edge, (3 m,): the smaller vertex times n, and the larger."""
    start, end = half_edges(triangles)
    # Python numbers times 32-bit indices overflow from 46 341 vertices on.
    return np.minimum(start, end).astype(np.int64, copy=False) * np.int64(n) + np.maximum(start, end)


def count(number: int, one: str, more: str) -> str:
    """The number and its noun: `one` for 1, else `more`."""
    return f"{number} {one if number == 1 else more}"
