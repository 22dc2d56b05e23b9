# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of many elements of a mesh at once."""

import numpy as np


def values(collection, name, dtype, width=1):
    """The property of this name of all elements, (k,), or (k, width) of a vector."""
    found = np.empty(len(collection) * width, dtype=dtype)
    collection.foreach_get(name, found)
    return found.reshape(-1, width) if width > 1 else found


def coordinates(mesh):
    """Where the vertices are, (n, 3) float32."""
    return values(mesh.vertices, "co", np.float32, 3)


def corner_vertices(mesh):
    """The vertex of each corner, (c,)."""
    return _of_corners(mesh, ".corner_vert", "vertex_index")


def corner_edges(mesh):
    """The edge that each corner starts, (c,)."""
    return _of_corners(mesh, ".corner_edge", "edge_index")


def corner_triangles(mesh):
    """The triangles that Blender draws, as corners, (t, 3)."""
    if len(mesh.loops) == 3 * len(mesh.polygons):
        return np.arange(len(mesh.loops), dtype=np.int32).reshape(-1, 3)
    mesh.calc_loop_triangles()
    return values(mesh.loop_triangles, "loops", np.int32, 3)


def _of_corners(mesh, attribute, name):
    """Read as an attribute they are copied in one go, by their name one by one."""
    found = mesh.attributes.get(attribute)
    return values(mesh.loops, name, np.int32) if found is None else values(found.data, "value", np.int32)
