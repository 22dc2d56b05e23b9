# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of an island while it is unwrapped."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..core import Settings
from ..core.islands import Island
from ..core.pieces import Pieces, joined, parts_of, starts_of
from ..core.regions import Connected
from ..core.straightening import Straight
from . import mesh_arrays
from .mesh_islands import MeshIslands
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
    together: MeshIslands  # of its mesh's islands,
    number: int  # and which of these it is
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

    @property
    def aspect(self):
        """(2,) what to multiply UVs with: of the image that most faces show."""
        return self.together.aspects[self.number]

    @cached_property
    def image(self):
        """What most of its faces show: what shows the same shares the UVs."""
        return self.mesh.image_of(self.island.faces)

    @cached_property
    def picture(self):
        """The `Picture` that most of its faces show, None for none."""
        return self.mesh.pictures[self.mesh.slot_of(self.island.faces)]

    @property
    def old_uv(self):
        """(n, 2), None if there is no map or nothing in it; where the map is cut, of one of the corners."""
        return None if self.mesh.uv is None or self.uv_fault else self.raw_uv

    @property
    def raw_uv(self):
        """The same where there is a map, whatever is in it."""
        return self.together.uvs[self.number]

    @property
    def uv_fault(self):
        """Why the map has no UVs for it though there is a map, or an empty text."""
        return "" if self.mesh.uv is None else self.together.faults[self.number]

    @property
    def can_stay(self):
        """Whether its old UVs, if they are valid, are better than new ones that are not."""
        settings = self.settings
        improves = settings.repair and (settings.iterations or settings.refine)
        return bool(improves and self.old_uv is not None and not self.is_fresh and not self.is_cut)

    def as_before(self):
        """The same with the old UVs for new ones."""
        return replace(self, uv=self.old_uv, mirrored=self.was_mirrored)

    @property
    def has_place(self):
        """Whether its old UVs say where it belongs."""
        if self.old_uv is None or self.is_fresh or self.has_new_seams:
            return False
        return self.together.say_where[self.number]

    @property
    def old_triangles(self):
        """The triangles' old UVs (t, 3, 2)."""
        return self.together.triangles[self.number]

    @property
    def was_mirrored(self):
        """Whether most of the area of its old UVs is mirrored."""
        return self.together.are_mirrored[self.number]

    @property
    def vertices(self):
        """(n, 3)"""
        return self.together.vertices[self.number]

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
        return self.together.triangle_faces[self.number]

    @property
    def stayed(self):
        """(n,) bool, the vertices whose UVs are the old ones, and the UVs (k, 2) of these, to the last bit."""
        stayed = (self.uv == self.old_uv).all(axis=1)
        return stayed, self.mesh.uv[self.together.sources[self.number][stayed]]

    @property
    def written(self):
        """(c,) bool, those of its corners whose UVs are written where it is relaxed: of vertices that may move."""
        moved = self.moving.copy()
        if self.straight is not None:
            moved |= self.straight.held.any(axis=1)
        return moved[self.island.corner_vertex]

    @property
    def is_cut(self):
        """Whether the old UVs have cuts where there is no seam."""
        return self.together.are_cut[self.number]

    @property
    def is_fresh(self):
        """Whether its old UVs are those of a new map, which say nothing; pinned ones always do."""
        return self.together.are_fresh[self.number]

    @property
    def drawn(self):
        """(t, 3) the triangles that Blender draws."""
        return self._drawn if self.island.is_redrawn else self.island.triangles

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
        return self.has_place and bool(self.attached[self.island.corners].any())

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


def surfaces(works: Sequence[Work]) -> Pieces:
    """The works' surfaces as one."""
    return Pieces([work.vertices for work in works], [work.triangles for work in works])


def maps(works: Sequence[Work]) -> np.ndarray:
    """The works' new UVs (n, 2), one after another."""
    return np.concatenate([work.uv for work in works])


def _in_image(works):
    """The same in their images, which need not be square."""
    return maps(works) / np.repeat([work.aspect for work in works], [len(work.uv) for work in works], axis=0)


def triangles_in_image(works: Sequence[Work]) -> list[np.ndarray]:
    """The new UVs (t, 3, 2) of each work's triangles in its image."""
    _, triangles, _, triangle_starts = joined([work.uv for work in works], [work.triangles for work in works])
    return parts_of(_in_image(works)[triangles], triangle_starts)


def put_maps(works: Sequence[Work], uvs: Sequence[np.ndarray]) -> None:
    """Give the works their new UVs, (n, 2) each."""
    for work, uv in zip(works, uvs, strict=True):
        work.uv = uv


def written_uv(works: Sequence[Work]) -> np.ndarray:
    """The works' new UVs (n, 2), one after another, as they are written; one that stayed stays to the last bit."""
    starts = starts_of([work.uv for work in works])
    uv = _in_image(works)
    for work, start in zip(works, starts.tolist(), strict=True):
        if work.in_frame:
            stayed, old = work.stayed
            uv[start + np.flatnonzero(stayed)] = old
    return uv


def corners_to_write(works: Sequence[Work]) -> tuple[np.ndarray, np.ndarray]:
    """The corners (c,) of the works' mesh whose UVs are written, and these, (c, 2): the same for all corners of a
    vertex; but where a work is relaxed, a coordinate that stayed stays in every corner."""
    corners = np.concatenate([work.island.corners for work in works])
    counts = [len(work.island.corners) for work in works]
    starts = starts_of([work.uv for work in works])
    vertex = np.concatenate([work.island.corner_vertex for work in works]) + np.repeat(starts, counts)
    uv = written_uv(works)[vertex]
    if all(work.moving is None for work in works):
        return corners, uv
    chosen = np.ones(len(corners), bool)
    for work, end, count in zip(works, np.cumsum(counts).tolist(), counts, strict=True):
        its = slice(end - count, end)
        if work.moving is not None:
            chosen[its] = work.written
            if work.in_frame:
                stays = (work.uv == work.old_uv)[work.island.corner_vertex]
                uv[its] = np.where(stays, work.mesh.uv[work.island.corners], uv[its])
    return corners[chosen], uv[chosen]
