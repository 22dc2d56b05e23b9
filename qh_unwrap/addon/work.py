# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of an island while it is unwrapped."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core import Settings
from ..core.islands import Island
from ..core.validity import as_stored
from . import mesh_arrays, placing
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
    in_frame: bool = False  # of the old UVs, because something of them is held

    @cached_property
    def aspect(self):
        """(2,) what to multiply UVs with: of the image that most faces show."""
        if self.mesh.one_aspect is not None:
            return np.array([self.mesh.one_aspect, 1.0])
        values, counts = np.unique(self.mesh.aspect[self.island.faces], return_counts=True)
        return np.array([values[np.argmax(counts)], 1.0])

    @cached_property
    def old_uv(self):
        """(n, 2), None if there is no map or nothing in it; where the map is cut, of one of the corners."""
        if self.mesh.uv is None:
            return None
        corner_uv = self.mesh.uv[self.island.corners]
        if not np.isfinite(corner_uv).all() or not np.ptp(corner_uv, axis=0).any():
            return None
        uv = np.empty((len(self.island.vertices), 2))
        uv[self.island.corner_vertex] = corner_uv
        return uv * self.aspect

    @cached_property
    def old_triangles(self):
        """The triangles' old UVs (t, 3, 2), None if they do not say where the island belongs."""
        if self.old_uv is None:
            return None
        old = self.mesh.uv[self.island.triangle_corners] * self.aspect
        return old if placing.says_where(old) else None

    @cached_property
    def vertices(self):
        return self.mesh.vertices[self.island.vertices]

    @property
    def triangles(self):
        return self.island.triangles

    @property
    def corner_uv(self):
        """The new UVs (c, 2) of its corners; where a vertex stayed, its corners stay to the last bit."""
        uv = (self.uv / self.aspect)[self.island.corner_vertex]
        if self.in_frame:
            stayed = (self.uv == self.old_uv).all(axis=1)[self.island.corner_vertex]
            uv[stayed] = self.mesh.uv[self.island.corners[stayed]]
        return uv

    @property
    def stored_uv(self):
        """(n, 2) the new UVs in Blender's single precision, as seen from the side where they are not mirrored."""
        uv = np.empty_like(self.uv)
        uv[self.island.corner_vertex] = as_stored(self.corner_uv)
        return uv * (-1, 1) if self.mirrored else uv

    @property
    def is_cut(self):
        """Whether the old UVs have cuts where there is no seam."""
        gap = self.old_uv[self.island.corner_vertex] - self.mesh.uv[self.island.corners] * self.aspect
        return np.abs(gap).max() > 1e-5 * np.ptp(self.old_uv, axis=0).max()

    @property
    def is_free(self):
        """Whether nothing of it is held: no pin, and no face that is not unwrapped."""
        return not (self.mesh.pinned[self.island.corners].any() or self.attached[self.island.corners].any())

    @property
    def pinned(self):
        return self._vertices_of(self.mesh.pinned)

    @property
    def hanging(self):
        return self._vertices_of(self.attached)

    def _vertices_of(self, corners):
        chosen = np.zeros(len(self.island.vertices), dtype=bool)
        chosen[self.island.corner_vertex[corners[self.island.corners]]] = True
        return chosen
