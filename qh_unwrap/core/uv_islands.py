# SPDX-License-Identifier: GPL-3.0-or-later
"""The islands that UVs make by themselves, whatever the mesh and its seams are like."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .doubles import find_doubles
from .joints import across_edges, meet, uv_vertices, without_doubled_diagonals, wound_back
from .pieces import around_faces, components, starts_of_numbers
from .winding import agreed


@dataclass(frozen=True, eq=False)
class UVIslands:
    """Faces that hang together across the edges at which their UVs agree, numbered by their first faces."""

    count: int
    face_island: np.ndarray  # (f,) the number of each face's island, -1 for faces that were not asked for
    corner_vertex: np.ndarray  # (c,) the UV vertex of each corner; they are numbered island by island
    vertex_corner: np.ndarray  # (n,) a corner at each UV vertex
    corners: np.ndarray  # (t, 3) triangles as they are drawn, as corners, wound alike within each island
    closed_up: np.ndarray  # (t, 3) triangles of the same faces, as corners, none of which share a diagonal
    island: np.ndarray  # (t,) the island of each triangle, ascending
    turned_faces: np.ndarray  # (f,) bool, those that are inside out beside the others of their islands

    @cached_property
    def triangles(self) -> np.ndarray:
        """(t, 3) the drawn triangles as UV vertices."""
        return self.corner_vertex[self.corners]

    @cached_property
    def closed_up_triangles(self) -> np.ndarray:
        """(t, 3) the triangles that share no diagonals, as UV vertices."""
        return self.corner_vertex[self.closed_up]

    @property
    def triangle_starts(self) -> np.ndarray:
        """(k,) where the triangles of each island begin."""
        return starts_of_numbers(self.island, self.count)


def uv_islands(
    corner_vertex: np.ndarray,
    corner_edge: np.ndarray,
    face_start: np.ndarray,
    edge_count: int,
    corner_triangles: np.ndarray,
    uv: np.ndarray,
    selected: np.ndarray,
) -> UVIslands:
    """The islands of the UVs (c, 2) of the `selected` faces, (f,) bool; the other arrays are those of `find_islands`.

    Two faces hang together across an edge that no others of these faces use, if their UVs agree along it.  Faces on
    top of each other with the same corners are islands apart.
    """
    corner_face, following = around_faces(face_start, len(corner_vertex))
    no_seam = np.zeros(edge_count, dtype=bool)
    links: list[Sequence[np.ndarray]] = [_NO_LINKS]
    faces = selected
    while faces.any():  # one layer of faces with the same corners after the other
        doubled = find_doubles(corner_vertex, corner_edge, face_start, no_seam, faces).among(len(face_start)) & faces
        corners = np.flatnonzero((faces & ~doubled)[corner_face])
        link = across_edges(corner_vertex, corner_edge, following, no_seam, corners)
        agree = meet(uv, *link[:3], following)
        links.append([each[agree] for each in link])
        faces = doubled
    one, start, end, opposed = (np.concatenate(each) for each in zip(*links, strict=True))
    here, there = corner_face[one], corner_face[start]
    part = components(len(face_start), here, there)[1]
    inside_out, cut = agreed(here, there, opposed, part)
    one, start, end = (each[~cut] for each in (one, start, end))
    face_island, count = _numbered(part, selected)

    vertex = uv_vertices(one, start, end, following)
    closed_up = without_doubled_diagonals(corner_triangles, following, vertex)
    triangle_face = corner_face[corner_triangles[:, 0]]
    backward = (inside_out & selected)[triangle_face]
    its = np.flatnonzero(selected[triangle_face])
    order = its[np.argsort(face_island[triangle_face[its]], kind="stable")]
    drawn, closed_up = (wound_back(each, backward)[order] for each in (corner_triangles, closed_up))

    some_corner = np.empty(vertex.max(initial=-1) + 1, dtype=np.intp)
    some_corner[vertex] = np.arange(len(vertex))
    by_island = np.argsort(face_island[corner_face[some_corner]], kind="stable")
    number = np.empty(len(by_island), dtype=np.intp)
    number[by_island] = np.arange(len(by_island))
    return UVIslands(
        count=count,
        face_island=face_island,
        corner_vertex=number[vertex],
        vertex_corner=some_corner[by_island],
        corners=drawn,
        closed_up=closed_up,
        island=face_island[triangle_face[order]],
        turned_faces=inside_out & selected,
    )


_NO_LINKS = *(np.zeros(0, dtype=np.intp) for _ in range(3)), np.zeros(0, dtype=bool)


def _numbered(part, selected):
    """The number of the part of each of the selected faces, (f,), counted by their first faces, -1 for others; and how
    many there are."""
    chosen = np.flatnonzero(selected)
    _, first, number = np.unique(part[chosen], return_index=True, return_inverse=True)
    found = np.full(len(part), -1)
    found[chosen] = np.argsort(np.argsort(first))[number.ravel()]
    return found, len(first)
