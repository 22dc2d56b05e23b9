# SPDX-License-Identifier: GPL-3.0-or-later
"""Large meshes in an order in which neighbours in space are neighbours in memory, where processors find them sooner."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, overload

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from .report import Result

MANY = 40_000  # vertices above which a mesh is worth sorting: a smaller one fits into the processor's cache


class Sorted:
    """A mesh, `vertices` (n, 3) and `triangles` (m, 3), sorted, and the way back to its own order."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        self._order = cKDTree(vertices, leafsize=32, balanced_tree=False, compact_nodes=False).indices
        self._place = np.argsort(self._order)
        triangles = self._place[triangles]
        self._triangle_order = np.argsort(triangles.min(axis=1), kind="stable")
        self._triangle_place = np.argsort(self._triangle_order)
        self.vertices = vertices[self._order]
        self.triangles = triangles[self._triangle_order]

    @overload
    def sorted(self, values: np.ndarray) -> np.ndarray: ...
    @overload
    def sorted(self, values: None) -> None: ...
    def sorted(self, values: np.ndarray | None) -> np.ndarray | None:
        """Values (n, ...) at the vertices in the sorted order; None for None."""
        return None if values is None else np.asarray(values)[self._order]

    def restored(self, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) at the sorted vertices in the mesh's own order."""
        return values[self._place]

    def renumbered(self, vertices: np.ndarray) -> np.ndarray:
        """Numbers of vertices (n, ...), given for every vertex, as sorted numbers for every sorted vertex."""
        return self._place[vertices][self._order]

    def sorted_triangles(self, values: np.ndarray | None) -> np.ndarray | None:
        """Values (m, ...) at the triangles in the sorted order; None for None."""
        return None if values is None else np.asarray(values)[self._triangle_order]

    def own_triangles(self, triangles: np.ndarray) -> np.ndarray:
        """The numbers that sorted triangles, given by their numbers (k,), have in the mesh's own order."""
        return self._triangle_order[triangles]

    def restored_result(self, result: Result) -> Result:
        """The result of the sorted mesh as that of the mesh in its own order."""
        report = result.report
        measured = {name: self._restored_distortion(getattr(report, name)) for name in ("before", "after")}
        loops = [self._order[loop] for loop in result.loops]
        return replace(result, uv=self.restored(result.uv), report=replace(report, **measured), loops=loops)

    def _restored_distortion(self, distortion):
        if distortion is None:
            return None
        names = [field.name for field in fields(distortion) if field.metadata.get("per_triangle")]
        return replace(distortion, **{name: getattr(distortion, name)[self._triangle_place] for name in names})
