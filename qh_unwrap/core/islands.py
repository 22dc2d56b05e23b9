# SPDX-License-Identifier: GPL-3.0-or-later
"""From faces and seams to the islands that are unwrapped one by one.

A *corner* is one vertex of one face; the corners of a face follow each other, and corner `c` starts the face's edge
`corner_edge[c]`.  Corners become one UV vertex where faces hang together across an edge, and only there: so a seam
inside an island opens it, and a vertex where two fans of faces merely touch is split.

A face on top of another one with the same corners is set aside, and gets its UVs.  Of the others, those that are inside
out are turned for the unwrap, and what is one-sided is cut; the mesh stays as it is.
"""

from dataclasses import dataclass, fields

import numpy as np

from .doubles import find_doubles
from .joints import across_edges, meet, uv_vertices, without_doubled_diagonals, wound_back
from .pieces import around_faces, components, parts_of
from .winding import agreed


@dataclass(frozen=True)
class Island:
    """Faces that hang together; its n vertices are UV vertices, of which a mesh vertex may have several."""

    faces: np.ndarray  # (f,) mesh faces, doubled ones too
    corners: np.ndarray  # (c,) mesh corners, those of doubled faces at the end
    corner_vertex: np.ndarray  # (c,) island vertex of each of these corners
    vertices: np.ndarray  # (n,) mesh vertex of each island vertex
    triangles: np.ndarray  # (t, 3) island vertices, all wound alike; none of doubled faces
    triangle_corners: np.ndarray  # (t, 3) the same as mesh corners
    drawn_corners: np.ndarray  # (t, 3) the mesh's own triangles of the same faces, as mesh corners, wound like these
    doubled_corners: np.ndarray  # (s, 3) the mesh's own triangles of doubled faces, wound like their twins
    own_corners: int  # how many of the corners are not of doubled faces
    doubled_faces: int  # faces on top of another one with the same corners, whose UVs they get
    turned_faces: int  # faces that are inside out, not counting doubled ones
    one_sided_edges: int  # edges where it is cut since it is one-sided
    crowded_edges: int  # edges of its outline where more than two faces meet
    is_redrawn: bool  # whether the mesh's own triangles are others than these


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

    Faces are neighbours across an edge that is no seam and that exactly two selected faces use; doubled ones do not
    count.
    """
    corner_face, following = around_faces(face_start, len(corner_vertex))
    doubles = find_doubles(corner_vertex, corner_edge, face_start, seam, selected)
    is_double = doubles.among(len(face_start))
    single, doubled = selected & ~is_double, selected & is_double
    own_corners = np.flatnonzero(single[corner_face])
    one, start, end, opposed = across_edges(corner_vertex, corner_edge, following, seam, own_corners)
    here, there = corner_face[one], corner_face[start]
    face_island = components(len(face_start), here, there)[1]
    turned, cut = agreed(here, there, opposed, face_island)
    if cut.any():
        one, start, end = (each[~cut] for each in (one, start, end))
    uv_vertex = uv_vertices(one, start, end, following)
    triangles = without_doubled_diagonals(corner_triangles, following, uv_vertex)

    uv_vertex[doubles.corners] = uv_vertex[doubles.twins]
    face_island[doubles.faces] = face_island[doubles.twin_faces]
    backward = turned.copy()
    backward[doubles.faces] = turned[doubles.twin_faces] ^ doubles.is_reversed
    triangle_face = corner_face[corner_triangles[:, 0]]
    drawn = corner_triangles
    if backward.any():
        triangles, drawn = (wound_back(each, backward[triangle_face]) for each in (triangles, drawn))

    rank, count = _ranks(face_island, selected)
    corner_rank, triangle_rank = rank[corner_face], rank[triangle_face]
    faces, face_starts = _grouped(np.flatnonzero(selected), rank, count)
    corners = np.concatenate([own_corners, np.flatnonzero(doubled[corner_face])])
    corners, corner_starts = _grouped(corners, corner_rank, count)
    its, triangle_starts = _grouped(np.flatnonzero(single[triangle_face]), triangle_rank, count)
    its_doubled, doubled_starts = _grouped(np.flatnonzero(doubled[triangle_face]), triangle_rank, count)
    first_corner, vertex_starts, island_vertex = _vertices(uv_vertex, corners, corner_rank, count)

    redrawn = (triangles != drawn).any(axis=1)

    def counted(faces):
        return np.bincount(rank[faces], minlength=count).tolist()

    columns = {
        "faces": parts_of(faces, face_starts),
        "corners": parts_of(corners, corner_starts),
        "corner_vertex": parts_of(island_vertex[corners], corner_starts),
        "vertices": parts_of(corner_vertex[first_corner], vertex_starts),
        "triangles": parts_of(island_vertex[triangles[its]], triangle_starts),
        "triangle_corners": parts_of(triangles[its], triangle_starts),
        "drawn_corners": parts_of(drawn[its], triangle_starts),
        "doubled_corners": parts_of(drawn[its_doubled], doubled_starts),
        "own_corners": np.bincount(corner_rank[own_corners], minlength=count).tolist(),
        "doubled_faces": counted(doubled),
        "turned_faces": counted(turned),
        "one_sided_edges": counted(here[cut]),
        "crowded_edges": _crowded_edges(corner_edge[own_corners], corner_rank[own_corners], seam, count),
        "is_redrawn": (np.bincount(triangle_rank[its], redrawn[its], count) > 0).tolist(),
    }
    in_order = (columns[field.name] for field in fields(Island))
    return [Island(*row) for row in zip(*in_order, strict=True)]


def _ranks(face_island, selected):
    """The number of each face's island, (f,), counting those of selected faces by their first faces, and how many these
    are."""
    chosen = np.flatnonzero(selected)
    _, first, number = np.unique(face_island[chosen], return_index=True, return_inverse=True)
    rank = np.zeros(len(face_island), dtype=np.intp)
    rank[chosen] = np.argsort(np.argsort(first))[number]
    return rank, len(first)


def _vertices(uv_vertex, corners, corner_rank, count):
    """A corner of every UV vertex that the corners have, one island after another, where each island begins among
    these, and the number of each corner's UV vertex within its island, (c,)."""
    some_corner = np.full(uv_vertex.max(initial=-1) + 1, -1)
    some_corner[uv_vertex[corners]] = corners
    used = np.flatnonzero(some_corner >= 0)
    ordered, starts = _grouped(some_corner[used], corner_rank, count)
    number = np.zeros(len(some_corner), dtype=np.intp)
    number[uv_vertex[ordered]] = np.arange(len(ordered)) - starts[corner_rank[ordered]]
    return ordered, starts, number[uv_vertex]


def _crowded_edges(edges, ranks, seam, count):
    """How many edges each of `count` islands has where more than two faces meet, of the edges and the islands' ranks of
    corners, (k,) each."""
    crowded = (np.bincount(edges, minlength=len(seam)) > 2) & ~seam
    if not crowded.any():
        return [0] * count
    crowded = crowded[edges]
    pairs = np.unique(ranks[crowded] * np.int64(len(seam)) + edges[crowded])
    return np.bincount(pairs // len(seam), minlength=count).tolist()


def cuts(
    corner_vertex: np.ndarray, corner_edge: np.ndarray, face_start: np.ndarray, edge_count: int, uv: np.ndarray
) -> np.ndarray:
    """The edges, (e,) bool, where two faces meet in space and their corners' UVs (c, 2) do not."""
    seam, everything = np.zeros(edge_count, dtype=bool), np.ones(len(face_start), dtype=bool)
    following, (one, start, end) = _neighbours(corner_vertex, corner_edge, face_start, seam, everything)
    cut = np.zeros(edge_count, dtype=bool)
    cut[corner_edge[one[~meet(uv, one, start, end, following)]]] = True
    return cut


def attached(
    corner_vertex: np.ndarray,
    corner_edge: np.ndarray,
    face_start: np.ndarray,
    seam: np.ndarray,
    selected: np.ndarray,
    uv: np.ndarray,
) -> np.ndarray:
    """The corners, (c,) bool, of selected faces that hang on unselected ones: no seam parts them, nor do the UVs.

    A doubled face that is not selected holds nothing, nor does it count as one that hangs there.
    """
    following, (one, start, end) = _neighbours(corner_vertex, corner_edge, face_start, seam, selected)
    joined = meet(uv, one, start, end, following)
    uv_vertex = uv_vertices(one[joined], start[joined], end[joined], following)
    is_selected = selected[around_faces(face_start, len(corner_vertex))[0]]
    unselected_there = np.bincount(uv_vertex, weights=~is_selected) > 0
    return is_selected & unselected_there[uv_vertex]


def _neighbours(corner_vertex, corner_edge, face_start, seam, selected):
    """The corner that follows each around its face, and what `across_edges` returns of all faces but doubled ones."""
    corner_face, following = around_faces(face_start, len(corner_vertex))
    doubles = find_doubles(corner_vertex, corner_edge, face_start, seam, selected)
    corners = np.flatnonzero(~doubles.among(len(face_start))[corner_face])
    return following, across_edges(corner_vertex, corner_edge, following, seam, corners)[:3]


def _grouped(items, rank, count):
    """The items sorted by their rank, and where each of `count` ranks begins; equal ones stay in order."""
    if count == 1:
        return items, np.zeros(1, dtype=np.intp)
    own = rank[items]
    order = np.argsort(own, kind="stable")
    return items[order], np.searchsorted(own[order], np.arange(count))
