# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh's islands, and what there is to know of them before they are unwrapped, worked out for all at once."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..core import placing
from ..core.islands import Island
from ..core.pieces import numbers, parts_of, starts_of
from .mesh_arrays import MeshArrays

_NO_NUMBERS, _IN_ONE_PLACE = "some of its UVs are no numbers", "all its UVs are in one place"
_TOLERANCE = 1e-5  # of an island's extent, by which the UVs of a vertex may differ and yet be meant to be one


class MeshIslands:
    """What there is to know of a mesh's islands, their shapes and their old UVs.

    Parameters
    ----------
    mesh : MeshArrays
    islands : of this mesh

    Lists and arrays have an item for each island.  Old UVs are only there where the mesh has some; they have the
    proportions of the islands' images.
    """

    def __init__(self, mesh: MeshArrays, islands: Sequence[Island]):
        self._mesh, self._islands = mesh, islands

    @cached_property
    def aspects(self) -> np.ndarray:
        """(k, 2), what to multiply UVs with: of the image that most of an island's faces show."""
        result = np.ones((len(self._islands), 2))
        if self._mesh.one_aspect is not None:
            result[:, 0] = self._mesh.one_aspect
        else:
            for own, island in zip(result, self._islands, strict=True):
                values, counts = np.unique(self._mesh.aspect[island.faces], return_counts=True)
                own[0] = values[np.argmax(counts)]
        return result

    @cached_property
    def vertices(self) -> list[np.ndarray]:
        """Where the islands' vertices are in space, (n, 3) each."""
        return parts_of(self._mesh.vertices[np.concatenate([its.vertices for its in self._islands])], self._starts)

    @cached_property
    def triangle_faces(self) -> list[np.ndarray]:
        """The face of the mesh that each triangle is a part of, (t,) each."""
        return parts_of(self._mesh.corner_faces[self._triangle_corners[:, 0]], self._triangle_starts)

    # The old UVs

    @cached_property
    def uvs(self) -> list[np.ndarray]:
        """Those of the islands' vertices, (n, 2) each; where the map is cut, of one of the corners."""
        return parts_of(self._uv, self._starts)

    @cached_property
    def sources(self) -> list[np.ndarray]:
        """The mesh's corner that each vertex has its UVs from, (n,) each: a pinned one if there is one."""
        return parts_of(self._source, self._starts)

    @cached_property
    def faults(self) -> list[str]:
        """Why an island has no UVs though there is a map, or an empty text."""
        finite = np.logical_and.reduceat(np.isfinite(self._corner_uv).all(axis=1), self._corner_starts)
        low, high = (each.reduceat(self._corner_uv, self._corner_starts) for each in (np.minimum, np.maximum))
        spread = (low != high).any(axis=1)
        its = zip(finite.tolist(), spread.tolist(), strict=True)
        return [_NO_NUMBERS if not numbers else "" if apart else _IN_ONE_PLACE for numbers, apart in its]

    @cached_property
    def are_cut(self) -> list[bool]:
        """Whether they have cuts where there is no seam."""
        with np.errstate(invalid="ignore"):
            low, high = (each.reduceat(self._uv, self._starts) for each in (np.minimum, np.maximum))
            farthest = np.maximum(np.abs(low), np.abs(high)).max(axis=1)
            tolerance = _TOLERANCE * (high - low).max(axis=1) + 4 * np.finfo(np.float32).eps * farthest
            of_corners = self._corner_uv * np.repeat(self.aspects, self._corner_counts, axis=0)
            apart = np.abs(self._uv[self._corner_vertex] - of_corners).max(axis=1)
            return (np.maximum.reduceat(apart, self._corner_starts) > tolerance).tolist()

    @cached_property
    def are_fresh(self) -> list[bool]:
        """Whether they are those of a new map, which say nothing; pinned ones always do."""
        if not self._mesh.fresh.any():
            return [False] * len(self._islands)
        faces = [island.faces for island in self._islands]
        fresh = np.logical_and.reduceat(self._mesh.fresh[np.concatenate(faces)], starts_of(faces))
        corners = [island.corners for island in self._islands]
        return (
            fresh & ~np.logical_or.reduceat(self._mesh.pinned[np.concatenate(corners)], starts_of(corners))
        ).tolist()

    @cached_property
    def triangles(self) -> list[np.ndarray]:
        """Those of the islands' triangles, (t, 3, 2) each."""
        return parts_of(self._triangles, self._triangle_starts)

    @cached_property
    def say_where(self) -> list[bool]:
        """Whether they say where an island belongs."""
        return placing.say_where(self._triangles, self._triangle_starts).tolist()

    @cached_property
    def are_mirrored(self) -> list[bool]:
        """Whether most of their area is mirrored."""
        return placing.are_mirrored(self._triangles, self._triangle_starts).tolist()

    # Of all islands' vertices, corners or triangles, island after island

    @cached_property
    def _starts(self):
        return starts_of([island.vertices for island in self._islands])

    @cached_property
    def _triangle_starts(self):
        return starts_of([island.triangles for island in self._islands])

    @cached_property
    def _triangle_corners(self):
        return np.concatenate([island.triangle_corners for island in self._islands])

    @cached_property
    def _corner_counts(self):
        """(k,) how many corners' UVs count: all but those of doubled faces."""
        return np.array([island.own_corners for island in self._islands])

    @cached_property
    def _corner_starts(self):
        return np.cumsum(self._corner_counts) - self._corner_counts

    @cached_property
    def _corners(self):
        return np.concatenate([island.corners[: island.own_corners] for island in self._islands])

    @cached_property
    def _corner_vertex(self):
        its = np.concatenate([island.corner_vertex[: island.own_corners] for island in self._islands])
        return its + np.repeat(self._starts, self._corner_counts)

    @cached_property
    def _corner_uv(self):
        return self._mesh.uv[self._corners]

    @cached_property
    def _source(self):
        source = np.empty(sum(len(island.vertices) for island in self._islands), dtype=np.intp)
        source[self._corner_vertex] = self._corners
        if self._mesh.has_pins:
            pinned = self._mesh.pinned[self._corners]
            source[self._corner_vertex[pinned]] = self._corners[pinned]
        return source

    @cached_property
    def _uv(self):
        return self._mesh.uv[self._source] * self.aspects[numbers(self._starts, len(self._source))]

    @cached_property
    def _triangles(self):
        corners = self._triangle_corners
        return self._mesh.uv[corners] * self.aspects[numbers(self._triangle_starts, len(corners)), None]
