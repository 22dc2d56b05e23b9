# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of UV maps that move while all around them stays: what is selected, as the UVs themselves hang together.

Corners are as in `islands`.  Here faces hang together where their UVs do, whatever the seams say.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .doubles import find_doubles
from .islands import Island, find_islands
from .joints import across_edges, meet, uv_vertices
from .pieces import around_faces, components


class Selection(NamedTuple):
    """What is selected in a UV map."""

    faces: np.ndarray  # (f,) bool
    corners: np.ndarray  # (c,) bool, UVs: those of selected faces, and single ones


class Connected:
    """How the faces of a mesh hang together in its UV map.

    Selected faces on top of others with the same corners and the same UVs go along with these; those with other UVs
    stay.

    Parameters
    ----------
    corner_vertex, corner_edge, face_start, edge_count : as in `islands`
    uv : (c, 2)
    selection : what is selected; of faces on top of each other, a selected one is looked at

    Attributes
    ----------
    uv_vertex : (c,), the UV vertex of each corner
    joined : (e,) bool, the edges across which faces hang together
    outline : (v,) bool, the UV vertices at which the map ends
    set_aside : (f,) bool, the faces on top of others, with other UVs
    single : (c,) bool, the corners of faces that lie on no other
    """

    def __init__(
        self,
        corner_vertex: np.ndarray,
        corner_edge: np.ndarray,
        face_start: np.ndarray,
        edge_count: int,
        uv: np.ndarray,
        selection: Selection,
    ):
        self._mesh, self._uv, self._selection = (corner_vertex, corner_edge, face_start), uv, selection
        nowhere = np.zeros(edge_count, bool)
        self.corner_face, following = around_faces(face_start, len(corner_vertex))
        doubles = self._doubles = find_doubles(corner_vertex, corner_edge, face_start, nowhere, selection.faces)
        apart = (uv[doubles.corners] != uv[doubles.twins]).any(axis=1)
        self.set_aside = np.zeros(len(face_start), bool)
        self.set_aside[self.corner_face[doubles.corners[apart]]] = True
        self.single = single = ~doubles.among(len(face_start))[self.corner_face]
        one, start, end, _ = across_edges(corner_vertex, corner_edge, following, nowhere, np.flatnonzero(single))
        joins = meet(uv, one, start, end, following)
        one, start, end = one[joins], start[joins], end[joins]
        self.joined = nowhere.copy()
        self.joined[corner_edge[one]] = True
        self.uv_vertex = uv_vertices(one, start, end, following)
        self.outline = np.zeros(self.uv_vertex.max(initial=-1) + 1, bool)
        ends = single & ~self.joined[corner_edge]
        self.outline[self.uv_vertex[ends]] = self.outline[self.uv_vertex[following[ends]]] = True

    def moving(self, outline_moves: bool) -> np.ndarray:
        """The corners whose UVs may move, (c,) bool.

        A UV vertex does if it is selected in all faces around it, and does not lie on the border between selected and
        unselected faces, nor, unless the `outline_moves`, on the outline of its island.  Where no face around it is
        selected, it never does on an outline: across a seam, the same vertex of the mesh is selected as well.
        """
        in_selected = self._selection.faces[self.corner_face]
        beside, apart = self._at_vertices(in_selected), self._at_vertices(~in_selected)
        still = self._at_vertices(~self._selection.corners) | (beside & apart)
        still |= self._pinched | (self.outline & ~beside) if outline_moves else self.outline
        return ~still[self.uv_vertex] & self.single

    def spread(self, corners: np.ndarray) -> np.ndarray:
        """The chosen corners (c,) bool, and all that share a UV vertex with one of them, or lie on such."""
        doubles = self._doubles
        chosen = corners.copy()
        its = corners[doubles.corners] & ~self.set_aside[self.corner_face[doubles.corners]]
        chosen[doubles.twins[its]] = True
        return self._at_vertices(chosen)[self.uv_vertex]

    def _at_vertices(self, corners):
        """Which UV vertices have any of the corners (c,) bool, (v,) bool; those of doubled faces do not count."""
        found = np.zeros(len(self.outline), bool)
        found[self.uv_vertex[corners & self.single]] = True
        return found

    @property
    def _pinched(self):
        """The UV vertices, (v,) bool, where several fans of faces meet in one place: moved, they would part."""
        corners = np.flatnonzero(self.single & self.outline[self.uv_vertex])
        _, first = np.unique(self.uv_vertex[corners], return_index=True)
        fans = corners[first]
        places = np.column_stack([self._mesh[0][fans], self._uv[fans]])
        _, place, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
        pinched = np.zeros(len(self.outline), bool)
        pinched[self.uv_vertex[fans[count[place.ravel()] > 1]]] = True
        return pinched

    def faces_with(self, corners: np.ndarray) -> np.ndarray:
        """The faces, (f,) bool, that have any of the chosen corners (c,) bool."""
        faces = np.zeros(len(self._mesh[2]), bool)
        faces[self.corner_face[corners]] = True
        return faces

    def whole_islands(self, faces: np.ndarray) -> np.ndarray:
        """The faces, (f,) bool, of all UV islands that have any of the chosen faces (f,) bool."""
        corners = np.flatnonzero(self.single)
        vertex, face = self.uv_vertex[corners], self.corner_face[corners]
        part = components(len(self.outline) + len(faces), vertex, len(self.outline) + face)[1][len(self.outline) :]
        return np.isin(part, part[faces & self.faces_with(self.single)]) & self.faces_with(self.single)

    def outline_sides(self) -> np.ndarray:
        """The sides of the outlines in the map, (k, 2) corners each."""
        _, following = around_faces(self._mesh[2], len(self.uv_vertex))
        corners = np.flatnonzero(self.single & ~self.joined[self._mesh[1]])
        return np.column_stack([corners, following[corners]])

    def islands(self, faces: np.ndarray, corner_triangles: np.ndarray) -> list[Island]:
        """The islands that the chosen faces (f,) bool make, with those on top of them that go along."""
        faces, doubles = faces.copy(), self._doubles
        faces[doubles.faces] = faces[doubles.twin_faces] & self._selection.faces[doubles.faces]
        return find_islands(*self._mesh, ~self.joined, faces & ~self.set_aside, corner_triangles)
