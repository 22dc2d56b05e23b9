# SPDX-License-Identifier: GPL-3.0-or-later
"""What mirrors what on a symmetric island."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .cuttable import Cuttable

_NEAR = 1e-4  # of the root of the area, up to which a vertex lies where another one is mirrored


@dataclass(frozen=True, eq=False)
class Mirror:
    """For every vertex (n,) and edge (k,) of an island the one that mirrors it, which may be itself.

    first_half  (n,) bool, the vertices on one side, and those on the plane
    """

    vertex: np.ndarray
    edge: np.ndarray
    first_half: np.ndarray

    @classmethod
    def of(cls, mesh: Cuttable, vertices: np.ndarray, axis: int) -> Mirror | None:
        """The mirror across an axis, 0 to 2, or None if the island is not symmetric.

        The plane passes through the origin of the mesh's `vertices` (n', 3), or else through the island's middle.
        """
        size = np.sqrt(mesh.area)
        centre = vertices[mesh.mesh_vertex[0]] - size * mesh.points[0]
        along = mesh.points[:, axis]
        return cls._across(mesh, axis, -centre[axis] / size) or cls._across(mesh, axis, (along.min() + along.max()) / 2)

    @classmethod
    def _across(cls, mesh: Cuttable, axis: int, place: float) -> Mirror | None:
        points = mesh.points.copy()
        points[:, axis] -= place
        image = points * np.where(np.arange(3) == axis, -1, 1)
        distance, vertex = cKDTree(points).query(image, distance_upper_bound=2 * _NEAR)
        if (distance > _NEAR).any() or (vertex[vertex] != np.arange(len(vertex))).any():
            return None
        number = np.int64(len(points)) ** np.arange(1, -1, -1)
        key, mirrored = mesh.edges @ number, np.sort(vertex[mesh.edges], axis=1) @ number
        edge = np.minimum(np.searchsorted(key, mirrored), len(key) - 1)
        found = key[edge] == mirrored
        if not found[mesh.mesh_edge >= 0].all():
            return None
        edge = np.where(found & (mesh.mesh_edge >= 0), edge, np.arange(len(edge)))  # diagonals mirror nothing
        return cls(vertex, edge, (points[:, axis] > 0) | (vertex == np.arange(len(vertex))))

    @property
    def on_plane(self) -> np.ndarray:
        """(n,) bool"""
        return self.vertex == np.arange(len(self.vertex))
