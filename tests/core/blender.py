# SPDX-License-Identifier: GPL-3.0-or-later
"""What the core's tests borrow of Blender: a triangulator of the plane."""

import bpy  # noqa: F401 (comes before anything else of Blender's)

from qh_unwrap.addon.delaunay import triangulate

__all__ = ["triangulate"]
