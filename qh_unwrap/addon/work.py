# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of an island while it is unwrapped."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..core import Settings, placing
from ..core.islands import Island
from ..core.regions import Connected
from ..core.straightening import Straight
from ..core.triangles import corners_of, signed_areas
from . import mesh_arrays
from .outcome import Outcome
from .selection import Target


@dataclass
class Work:
    """One island on its way through.  Its UVs have the proportions of the image, so that lengths in them are true."""

    target: Target
    mesh: mesh_arrays.MeshArrays
    island: Island
    outcome: Outcome
    settings: Settings
    attached: np.ndarray  # (c,) bool, the mesh's corners that hang on faces that are not unwrapped
    uv: np.ndarray | None = None  # (n, 2) the new ones
    loops: list | None = None  # its boundary
    mirrored: bool = False
    certified: bool = False  # by the core, before it was placed
    in_frame: bool = False  # of the old UVs, because something of them is held
    has_new_seams: bool = False  # so that its old place says nothing
    cut_fault: str = ""  # why no seams were found that open it
    scale: float | None = None  # how long a unit of its surface shall be in the new map, if that is chosen
    found_uv: np.ndarray | None = None  # (n, 2) those that the search for these seams ended with
    moving: np.ndarray | None = None  # (n,) bool, which vertices may move where not all of them may
    straight: Straight | None = None  # what is to be straight in it
    connected: Connected | None = None  # how its mesh hangs together in the UV map

    @cached_property
    def aspect(self):
        """(2,) what to multiply UVs with: of the image that most faces show."""
        if self.mesh.one_aspect is not None:
            return np.array([self.mesh.one_aspect, 1.0])
        values, counts = np.unique(self.mesh.aspect[self.island.faces], return_counts=True)
        return np.array([values[np.argmax(counts)], 1.0])

    @cached_property
    def image(self):
        """What most of its faces show: what shows the same shares the UVs."""
        return self.mesh.image_of(self.island.faces)

    @cached_property
    def picture(self):
        """The `Picture` that most of its faces show, None for none."""
        return self.mesh.pictures[self.mesh.slot_of(self.island.faces)]

    @cached_property
    def old_uv(self):
        """(n, 2), None if there is no map or nothing in it; where the map is cut, of one of the corners."""
        return None if self.mesh.uv is None or self.uv_fault else self.raw_uv

    @property
    def raw_uv(self):
        """The same where there is a map, whatever is in it."""
        return self.mesh.uv[self._source] * self.aspect

    @cached_property
    def uv_fault(self):
        """Why the map has no UVs for it though there is a map, or an empty text."""
        if self.mesh.uv is None:
            return ""
        corner_uv = self.mesh.uv[self._corners]
        if not np.isfinite(corner_uv).all():
            return "some of its UVs are no numbers"
        return "" if np.ptp(corner_uv, axis=0).any() else "all its UVs are in one place"

    @property
    def _corners(self):
        """(k,) the mesh's corners whose old UVs count: all but those of doubled faces."""
        return self.island.corners[: self.island.own_corners]

    @property
    def _corner_vertex(self):
        """(k,) the island vertex of each of these."""
        return self.island.corner_vertex[: self.island.own_corners]

    @cached_property
    def _source(self):
        """(n,) the mesh's corner that each vertex has its old UVs from, a pinned one if there is one."""
        source = np.empty(len(self.island.vertices), dtype=np.intp)
        source[self._corner_vertex] = self._corners
        pinned = self.mesh.pinned[self._corners]
        source[self._corner_vertex[pinned]] = self._corners[pinned]
        return source

    @property
    def can_stay(self):
        """Whether its old UVs, if they are valid, are better than new ones that are not."""
        settings = self.settings
        improves = settings.repair and (settings.iterations or settings.refine)
        return bool(improves and self.old_uv is not None and not self.is_fresh and not self.is_cut)

    def as_before(self):
        """The same with the old UVs for new ones."""
        mirrored = signed_areas(corners_of(self.old_uv, self.triangles)).sum() < 0
        return replace(self, uv=self.old_uv, mirrored=bool(mirrored))

    @cached_property
    def old_triangles(self):
        """The triangles' old UVs (t, 3, 2), None if they do not say where the island belongs."""
        if self.old_uv is None or self.is_fresh or self.has_new_seams:
            return None
        old = self.mesh.uv[self.island.triangle_corners] * self.aspect
        return old if placing.says_where(old) else None

    @cached_property
    def vertices(self):
        return self.mesh.vertices[self.island.vertices]

    @cached_property
    def importance(self):
        """(t,) how many times as large each triangle shall be as one without weights, None if all shall be alike."""
        if self.mesh.importance is None:
            return None
        return np.exp(self.mesh.importance[self.island.vertices][self.triangles].mean(axis=1))

    @property
    def polygons(self):
        """The mesh with this island alone as what is to be unwrapped."""
        selected = np.zeros(len(self.mesh.face_start), dtype=bool)
        selected[self.island.faces] = True
        return self.mesh.polygons(selected)

    @property
    def place(self):
        """(n,) a number for the place in space of each vertex: those on both sides of a seam have the same."""
        return np.unique(self.vertices, axis=0, return_inverse=True)[1].ravel()

    @property
    def triangles(self):
        return self.island.triangles

    @property
    def triangle_faces(self):
        """(t,) the face of the mesh that each triangle is a part of."""
        return self.mesh.corner_faces[self.island.triangle_corners[:, 0]]

    @property
    def written_uv(self):
        """(n, 2) the new UVs as they are written; one that stayed stays to the last bit."""
        uv = self.uv / self.aspect
        if self.in_frame:
            stayed = (self.uv == self.old_uv).all(axis=1)
            uv[stayed] = self.mesh.uv[self._source[stayed]]
        return uv

    @property
    def corner_uv(self):
        """(c, 2) the new UVs of its corners, the same for all of a vertex; but where it is relaxed, a coordinate that
        stayed stays in every corner."""
        new = self.written_uv[self.island.corner_vertex]
        if self.moving is None or not self.in_frame:
            return new
        return np.where((self.uv == self.old_uv)[self.island.corner_vertex], self.mesh.uv[self.island.corners], new)

    @property
    def written(self):
        """(c,) bool, those of its corners whose UVs are written: of vertices that may move."""
        if self.moving is None:
            return np.ones(len(self.island.corners), dtype=bool)
        moved = self.moving.copy()
        if self.straight is not None:
            moved |= self.straight.held.any(axis=1)
        return moved[self.island.corner_vertex]

    @property
    def is_cut(self):
        """Whether the old UVs have cuts where there is no seam."""
        old, corner_uv = self.old_uv, self.mesh.uv[self._corners] * self.aspect
        tolerance = 1e-5 * np.ptp(old, axis=0).max() + 4 * np.finfo(np.float32).eps * np.abs(old).max()
        return np.abs(old[self._corner_vertex] - corner_uv).max() > tolerance

    @cached_property
    def is_fresh(self):
        """Whether its old UVs are those of a new map, which say nothing; pinned ones always do."""
        return bool(self.mesh.fresh[self.island.faces].all()) and not self.pinned.any()

    @property
    def drawn(self):
        """(t, 3) the triangles that Blender draws."""
        return self._drawn if self.is_redrawn else self.island.triangles

    @cached_property
    def _drawn(self):
        return self._of_corners(self.island.drawn_corners)

    @property
    def doubled(self):
        """(s, 3) the triangles that Blender draws of its doubled faces, wound like their twins."""
        return self._of_corners(self.island.doubled_corners)

    def _of_corners(self, corners):
        """The island's vertices at some of its corners."""
        vertex = np.empty(len(self.mesh.corner_vertex), dtype=np.intp)
        vertex[self.island.corners] = self.island.corner_vertex
        return vertex[corners]

    @cached_property
    def is_redrawn(self):
        """Whether Blender cuts some of its faces into other triangles than the core gets."""
        return not np.array_equal(self.island.triangle_corners, self.island.drawn_corners)

    @property
    def held(self):
        """(n, 2) bool, which of its new UVs have to stay where they are."""
        held = np.zeros(self.uv.shape, dtype=bool)
        if self.in_frame:
            held[(self.uv == self.old_uv).all(axis=1)] = True
        elif self.settings.boundary != 'FREE':
            held[np.concatenate(self.loops)] = True
        return held

    @property
    def is_attached(self):
        """Whether its old UVs hang together with those of faces that are not unwrapped."""
        return self.old_triangles is not None and bool(self.attached[self.island.corners].any())

    @property
    def pinned(self):
        if not self.mesh.has_pins:
            return np.zeros(len(self.island.vertices), dtype=bool)
        return self._vertices_of(self.mesh.pinned)

    @property
    def attached_vertices(self):
        return self._vertices_of(self.attached)

    def _vertices_of(self, corners):
        chosen = np.zeros(len(self.island.vertices), dtype=bool)
        its = corners[self.island.corners]
        if its.any():
            chosen[self.island.corner_vertex[its]] = True
        return chosen
