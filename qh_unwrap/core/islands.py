# SPDX-License-Identifier: GPL-3.0-or-later
"""From faces and seams to the islands that are unwrapped one by one.

A *corner* is one vertex of one face; the corners of a face follow each other, and corner `c` starts the face's edge
`corner_edge[c]`.  Corners become one UV vertex where faces hang together across an edge, and only there: so a seam
inside an island opens it, and a vertex where two fans of faces merely touch is split.
"""

from dataclasses import dataclass

import numpy as np

from .pieces import components, first_and_last


@dataclass(frozen=True)
class Island:
    """Faces that hang together; its n vertices are UV vertices, of which a mesh vertex may have several."""

    faces: np.ndarray  # (f,) mesh faces
    corners: np.ndarray  # (c,) mesh corners
    corner_vertex: np.ndarray  # (c,) island vertex of each of these corners
    vertices: np.ndarray  # (n,) mesh vertex of each island vertex
    triangles: np.ndarray  # (t, 3) island vertices
    triangle_corners: np.ndarray  # (t, 3) the same as mesh corners
    drawn_corners: np.ndarray  # (t, 3) the mesh's own triangles of the faces, as mesh corners
    crowded_edges: int = 0  # edges of its outline where more than two faces meet


def find_islands(
    corner_vertex: np.ndarray,
    corner_edge: np.ndarray,
    face_start: np.ndarray,
    seam: np.ndarray,
    selected: np.ndarray,
    corner_triangles: np.ndarray,
) -> list[Island]:
    """The islands that the selected faces make, ordered by their first face.

    corner_vertex, corner_edge  (c,) vertex and edge of each corner
    face_start                  (f,) first corner of each face, ascending
    seam                        (e,) bool, one per edge
    selected                    (f,) bool, the faces to split
    corner_triangles            (t, 3) the faces' triangles, as corners

    Faces are neighbours across an edge that is no seam and that exactly two selected faces use.
    """
    corner_count, face_count = len(corner_vertex), len(face_start)
    corner_face, following = _around_faces(face_start, corner_count)
    chosen_corners = np.flatnonzero(selected[corner_face])
    one, start, end = _across_edges(corner_vertex, corner_edge, following, seam, chosen_corners)
    uv_vertex = _uv_vertices(one, start, end, following)
    face_island = components(face_count, corner_face[one], corner_face[start])[1]

    drawn = corner_triangles
    corner_triangles = _without_doubled_diagonals(drawn, following, uv_vertex)
    chosen = np.flatnonzero(selected)
    _, first, rank = np.unique(face_island[chosen], return_index=True, return_inverse=True)
    island_order = np.argsort(np.argsort(first))  # by the first face
    face_rank = np.zeros(face_count, dtype=np.intp)
    face_rank[chosen] = island_order[rank]
    corner_rank = face_rank[corner_face]
    triangle_face = corner_face[corner_triangles[:, 0]]
    chosen_triangles = np.flatnonzero(selected[triangle_face])

    # UV vertices, those of one island after another
    rank_of = np.full(uv_vertex.max(initial=-1) + 1, -1)
    rank_of[uv_vertex[chosen_corners]] = corner_rank[chosen_corners]
    used, first_vertex = _grouped(np.flatnonzero(rank_of >= 0), rank_of)
    number = np.zeros(len(rank_of), dtype=np.intp)
    number[used] = np.arange(len(used)) - first_vertex[rank_of[used]]
    island_vertex = number[uv_vertex]
    mesh_vertex = np.zeros(len(rank_of), dtype=np.intp)
    mesh_vertex[uv_vertex[chosen_corners]] = corner_vertex[chosen_corners]

    crowded = (np.bincount(corner_edge[chosen_corners], minlength=len(seam)) > 2) & ~seam
    crowded_corners = chosen_corners[crowded[corner_edge[chosen_corners]]]
    pairs = np.unique(corner_rank[crowded_corners] * np.int64(len(seam)) + corner_edge[crowded_corners])
    crowded_edges = np.bincount(pairs // max(len(seam), 1), minlength=len(first)).tolist()

    def split(values, starts):
        return np.split(values, starts[1:]) if len(first) else []

    faces, face_starts = _grouped(chosen, face_rank)
    corners, corner_starts = _grouped(chosen_corners, corner_rank)
    triangles, triangle_starts = _grouped(chosen_triangles, face_rank[triangle_face])
    columns = {
        "faces": split(faces, face_starts),
        "corners": split(corners, corner_starts),
        "corner_vertex": split(island_vertex[corners], corner_starts),
        "vertices": split(mesh_vertex[used], first_vertex),
        "triangles": split(island_vertex[corner_triangles[triangles]], triangle_starts),
        "triangle_corners": split(corner_triangles[triangles], triangle_starts),
        "drawn_corners": split(drawn[triangles], triangle_starts),
        "crowded_edges": crowded_edges,
    }
    return [Island(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def cuts(
    corner_vertex: np.ndarray,
    corner_edge: np.ndarray,
    face_start: np.ndarray,
    edge_count: int,
    uv: np.ndarray,
    tolerance: float = 1e-6,
) -> np.ndarray:
    """The edges, (e,) bool, where two faces meet in space and their corners' UVs (c, 2) do not."""
    corners = np.arange(len(corner_vertex))
    _, following = _around_faces(face_start, len(corners))
    seam = np.zeros(edge_count, dtype=bool)
    one, start, end = _across_edges(corner_vertex, corner_edge, following, seam, corners)
    cut = np.zeros(edge_count, dtype=bool)
    cut[corner_edge[one[_gaps(uv, one, start, end, following) > tolerance]]] = True
    return cut


def attached(
    corner_vertex: np.ndarray,
    corner_edge: np.ndarray,
    face_start: np.ndarray,
    seam: np.ndarray,
    selected: np.ndarray,
    uv: np.ndarray,
    tolerance: float = 1e-5,
) -> np.ndarray:
    """The corners, (c,) bool, of selected faces that hang on unselected ones: no seam parts them, nor do the UVs."""
    corners = np.arange(len(corner_vertex))
    corner_face, following = _around_faces(face_start, len(corners))
    one, start, end = _across_edges(corner_vertex, corner_edge, following, seam, corners)
    joined = _gaps(uv, one, start, end, following) <= tolerance
    uv_vertex = _uv_vertices(one[joined], start[joined], end[joined], following)
    is_selected = selected[corner_face]
    unselected_there = np.bincount(uv_vertex, weights=~is_selected) > 0
    return is_selected & unselected_there[uv_vertex]


def _gaps(uv, one, start, end, following):
    """How far the UVs of two faces lie apart at most along the edges that `_across_edges` returns, (k,)."""
    return np.abs(np.hstack([uv[one] - uv[start], uv[following[one]] - uv[end]])).max(axis=1)


def _around_faces(face_start, corner_count):
    """The face of each corner, and the corner that follows it around that face."""
    face_end = np.append(face_start[1:], corner_count)
    corner_face = np.repeat(np.arange(len(face_start)), face_end - face_start)
    following = np.arange(1, corner_count + 1)
    following[face_end - 1] = face_start
    return corner_face, following


def _across_edges(corner_vertex, corner_edge, following, seam, corners):
    """Three corners for every edge that joins two faces, (k,) each: that of one face that starts the edge, and those of
    the other face at the edge's start and end."""
    uses = np.bincount(corner_edge[corners], minlength=len(seam))
    inner = (uses == 2) & ~seam
    one, other = (each[inner] for each in first_and_last(corners, corner_edge[corners], len(seam)))
    alike = corner_vertex[one] == corner_vertex[other]  # both run the same way: one of the faces is inside out
    return one, np.where(alike, other, following[other]), np.where(alike, following[other], other)


def _uv_vertices(one, start, end, following):
    """The UV vertex of each corner, (c,), where faces hang together across the edges that `_across_edges` returns."""
    return components(len(following), np.concatenate([one, following[one]]), np.concatenate([start, end]))[1]


def _without_doubled_diagonals(triangles, following, uv_vertex):
    """Triangles (t, 3) of the same faces, of which no two faces have a diagonal between the same two vertices.

    Faces are triangulated one by one, so where two of them share several edges in a row, both may be cut along the
    same diagonal, and the triangles beside it would lie on top of each other.  Such diagonals are flipped.
    """
    if (np.roll(triangles, -1, axis=1) == following[triangles]).all():
        return triangles  # there are no diagonals
    for _ in range(8):
        halves = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        low, high = np.sort(uv_vertex[halves], axis=1).T
        _, edge, uses = np.unique(low * np.int64(uv_vertex.max() + 1) + high, return_inverse=True, return_counts=True)
        is_diagonal = halves[:, 1] != following[halves[:, 0]]
        doubled = np.flatnonzero(is_diagonal & (uses[edge] > 2))
        if not len(doubled):
            break
        triangles = _flipped(triangles, {tuple(halves[row]): row for row in doubled})
    return triangles


def _flipped(triangles, rows):
    """The triangles after flipping diagonals, given as {(corner, corner): 3 * triangle + place}, both ways round."""
    triangles, touched = triangles.copy(), set()
    for (i, j), row in rows.items():
        one, other = row // 3, rows[j, i] // 3
        if not touched & {one, other}:
            k, h = triangles[one, (row + 2) % 3], triangles[other, (rows[j, i] + 2) % 3]
            triangles[one], triangles[other] = (h, j, k), (h, k, i)
            touched |= {one, other}
    return triangles


def _grouped(items, rank):
    """The items sorted by their rank, and where each rank begins; equal ones stay in order."""
    own = rank[items]
    order = np.argsort(own, kind="stable")
    return items[order], np.searchsorted(own[order], np.arange(own.max(initial=-1) + 1))
