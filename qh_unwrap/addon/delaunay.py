# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's constrained Delaunay triangulation in the form that the core wants."""

import numpy as np
from mathutils import Vector
from mathutils.geometry import delaunay_2d_cdt

_TRIANGLES = 0  # of the convex hull
_EPSILON = 1e-9


def triangulate(points, sides):
    """Triangles (t, 3) of exactly the points (p, 2) that contain all `sides` (s, 2), or None if there are none such.

    Blender works in 32-bit floats: points that these cannot tell apart are merged, and nothing is returned.
    """
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    normalised = (points - middle) / np.ptp(points, axis=0).max()
    vertices, _, faces, origins, *_ = delaunay_2d_cdt(
        [Vector(point) for point in normalised.tolist()], sides.tolist(), [], _TRIANGLES, _EPSILON
    )
    if len(vertices) != len(points) or any(len(origin) != 1 for origin in origins):
        return None
    return np.array(origins).ravel()[np.array(faces)]
