# SPDX-License-Identifier: GPL-3.0-or-later
"""How faces hang together: across which edges, whether their UVs do as well, and what follows for their triangles."""

import numpy as np

from .pieces import components, first_and_last

_SMALL = 1e-4  # of an edge's length in the map, up to which a gap there is none
_ROUNDING = 4 * float(np.finfo(np.float32).eps)  # of a UV, by which its copies may differ


def across_edges(
    corner_vertex: np.ndarray, corner_edge: np.ndarray, following: np.ndarray, seam: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Three corners for every edge that joins two faces, (k,) each: that of one face that starts the edge, and those of
    the other face at the edge's start and end; and whether both run along it the same way, so that one of the faces is
    inside out, (k,) bool."""
    uses = np.bincount(corner_edge[corners], minlength=len(seam))
    inner = (uses == 2) & ~seam
    one, other = (each[inner] for each in first_and_last(corners, corner_edge[corners], len(seam)))
    opposed = corner_vertex[one] == corner_vertex[other]
    return one, np.where(opposed, other, following[other]), np.where(opposed, following[other], other), opposed


def meet(uv: np.ndarray, one: np.ndarray, start: np.ndarray, end: np.ndarray, following: np.ndarray) -> np.ndarray:
    """Whether the UVs of two faces are the same along each of the edges that `across_edges` returns, (k,) bool.

    They may differ by some rounding, and by a small part of the edge's length.
    """
    corners = np.column_stack([one, following[one], start, end])
    meet = (uv[corners[:, :2]] == uv[corners[:, 2:]]).all(axis=(1, 2))
    different = np.flatnonzero(~meet)
    here, there = uv[corners[different, :2]], uv[corners[different, 2:]]
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.abs(here[:, 0] - here[:, 1]).max(axis=1)
        size = np.abs(np.hstack([here, there])).max(axis=(1, 2))
        meet[different] = np.abs(here - there).max(axis=(1, 2)) <= _SMALL * length + _ROUNDING * size
    return meet


def uv_vertices(one: np.ndarray, start: np.ndarray, end: np.ndarray, following: np.ndarray) -> np.ndarray:
    """The UV vertex of each corner, (c,), where faces hang together across the edges that `across_edges` returns."""
    return components(len(following), np.concatenate([one, following[one]]), np.concatenate([start, end]))[1]


def without_doubled_diagonals(triangles: np.ndarray, following: np.ndarray, uv_vertex: np.ndarray) -> np.ndarray:
    """Triangles (t, 3) of the same faces, of which no two faces have a diagonal between the same two vertices.

    Faces are triangulated one by one, so where two of them share several edges in a row, both may be cut along the
    same diagonal, and the triangles beside it would lie on top of each other.  Such diagonals are flipped.
    """
    if 3 * len(triangles) == len(following):
        return triangles  # all faces are triangles: there are no diagonals
    for _ in range(8):
        halves = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        start, end = uv_vertex[halves].T
        key = np.minimum(start, end) * np.int64(uv_vertex.max() + 1) + np.maximum(start, end)
        ordered = np.sort(key)
        if (ordered[2:] != ordered[:-2]).all():
            break
        _, edge, uses = np.unique(key, return_inverse=True, return_counts=True)
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


def wound_back(triangles: np.ndarray, backward: np.ndarray) -> np.ndarray:
    """The triangles (t, 3), those that are `backward`, (t,) bool, run the other way round."""
    return np.where(backward[:, None], triangles[:, [0, 2, 1]], triangles)
