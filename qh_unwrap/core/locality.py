# SPDX-License-Identifier: GPL-3.0-or-later
"""Large meshes in an order in which neighbours in space are neighbours in memory, where processors find them sooner."""

from dataclasses import fields, replace

import numpy as np
from scipy.spatial import cKDTree

MANY = 40_000  # vertices: fewer fit into the processor's cache


class Sorted:
    """A mesh, `vertices` (n, 3) and `triangles` (m, 3), sorted, and the way back."""

    def __init__(self, vertices, triangles):
        self._order = cKDTree(vertices, leafsize=32, balanced_tree=False, compact_nodes=False).indices
        self._place = np.argsort(self._order)
        triangles = self._place[triangles]
        self._triangle_order = np.argsort(triangles.min(axis=1), kind="stable")
        self._triangle_place = np.argsort(self._triangle_order)
        self.vertices = vertices[self._order]
        self.triangles = triangles[self._triangle_order]

    def sorted(self, values):
        """Values at the vertices (n, ...), or None."""
        return None if values is None else np.asarray(values)[self._order]

    def restored(self, values):
        """The same in the mesh's own order."""
        return values[self._place]

    def renumbered(self, vertices):
        """For every sorted vertex (n, ...) the sorted number of the vertex that it is given."""
        return self._place[vertices][self._order]

    def own_triangles(self, triangles):
        """The numbers that triangles have in the mesh's own order."""
        return self._triangle_order[triangles]

    def restored_result(self, result):
        report = result.report
        measured = {name: self._restored_distortion(getattr(report, name)) for name in ("before", "initial", "after")}
        loops = [self._order[loop] for loop in result.loops]
        return replace(result, uv=self.restored(result.uv), report=replace(report, **measured), loops=loops)

    def _restored_distortion(self, distortion):
        if distortion is None:
            return None
        names = [field.name for field in fields(distortion) if field.metadata.get("per_triangle")]
        return replace(distortion, **{name: getattr(distortion, name)[self._triangle_place] for name in names})
