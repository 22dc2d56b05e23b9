# SPDX-License-Identifier: GPL-3.0-or-later
"""Letters as triangles, by Blender's own font, which is there without a window."""

import bpy

from . import bulk

_NAME = "QH Unwrap"


def letters(text):
    """The letters of a text as triangles (t, 3, 2), of size 1, on a baseline from 0, with y upwards."""
    curve = bpy.data.curves.new(_NAME, 'FONT')
    obj = bpy.data.objects.new(_NAME, curve)
    try:
        curve.body, curve.resolution_u = text, 3
        mesh = obj.to_mesh()
        return bulk.coordinates(mesh)[bulk.corner_vertices(mesh)[bulk.corner_triangles(mesh)]][..., :2].astype(float)
    finally:
        obj.to_mesh_clear()
        bpy.data.objects.remove(obj)
        bpy.data.curves.remove(curve)
