# SPDX-License-Identifier: GPL-3.0-or-later
"""What a seam along each edge costs: its length, less in creases, more where it is not welcome."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .cuttable import Cuttable
from .errors import ShapeError
from .seam_settings import SeamSettings

_BENT, _CONCAVE = 2.0, 2.0  # how much an edge attracts for each radian of the angle at it, and more in a fold
_MARKED = 8.0  # how much a marked edge attracts
_SEEN = 4.0  # times that a seam costs more where it is looked at straight on
_SHORTEST = 1e-6  # of the root of the area, that every edge costs at least


@dataclass(frozen=True, eq=False)
class Wishes:
    """Where seams are welcome on a mesh, and where not; each may be None.

    marked      (e,) from 0 to 1 or bool: edges that seams like to follow, as sharp ones and borders of materials
    spared      (n,) from 0 to 1: vertices that seams keep away from; an edge between two that have 1 is not cut
    closed      (e,) bool: edges that are not cut
    importance  (n,) positive: how many times as large the surface is to be in the map around each vertex; a seam counts
                as long as it will be there
    """

    marked: np.ndarray | None = None
    spared: np.ndarray | None = None
    closed: np.ndarray | None = None
    importance: np.ndarray | None = None

    def check(self, vertices: int, edges: int) -> None:
        """Raise `ShapeError` where an array does not have as many values as the mesh has vertices or edges."""
        counts = dict(marked=edges, spared=vertices, closed=edges, importance=vertices)
        for name, count in counts.items():
            values = getattr(self, name)
            if values is not None and np.shape(values) != (count,):
                raise ShapeError(f"{name} must have the shape ({count},), not {np.shape(values)}")


def edge_costs(mesh: Cuttable, settings: SeamSettings, wishes: Wishes) -> np.ndarray:
    """What a seam along each edge costs, (k,), positive; infinite for edges that may not be cut."""
    bend = mesh.dihedral
    attraction = settings.creases * (_BENT * np.abs(bend) + _CONCAVE * np.maximum(-bend, 0))
    if wishes.marked is not None:
        attraction += settings.marks * _MARKED * mesh.of_mesh(np.asarray(wishes.marked, dtype=float))
    cost = np.maximum(mesh.lengths, _SHORTEST) / (1 + attraction)
    if settings.hide_from != "NONE":
        axis, sign = "XYZ".index(settings.hide_from[-1]), -1 if settings.hide_from[0] == "-" else 1
        facing = np.maximum(sign * mesh.normals[:, axis], 0)
        m = len(mesh.triangles)
        first, last = mesh.sides
        cost *= 1 + _SEEN * np.maximum(facing[first % m], facing[last % m])
    if wishes.spared is not None:
        spared = np.clip(np.asarray(wishes.spared, dtype=float), 0, 1)[mesh.mesh_vertex]
        least, mean = spared[mesh.edges].min(axis=1), spared[mesh.edges].mean(axis=1)
        with np.errstate(divide="ignore"):
            cost /= np.where(least >= 1, 0, 1 - np.minimum(mean, 0.99))
    if wishes.importance is not None:
        cost *= np.sqrt(np.asarray(wishes.importance, dtype=float)[mesh.mesh_vertex][mesh.edges].mean(axis=1))
    if wishes.closed is not None:
        cost[mesh.of_mesh(np.asarray(wishes.closed, dtype=float)) > 0] = np.inf
    return np.where(mesh.inner, cost, np.inf)
