# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's monkey with seams, to try things on."""

import bmesh
import bpy


def add():
    """Add Suzanne without UVs: her eyes are pieces of their own, and seams cut off the ears and open the back."""
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=False)
    mesh = bpy.context.object.data
    bm = bmesh.new()
    bm.from_mesh(mesh)
    for edge in bm.edges:
        edge.seam = _at_ear(edge) or _on_back(edge)
    bm.to_mesh(mesh)
    bm.free()


def _at_ear(edge):
    beyond = [abs(face.calc_center_median().x) > 0.85 for face in edge.link_faces]
    return any(beyond) and not all(beyond)


def _on_back(edge):
    one, other = (vertex.co for vertex in edge.verts)
    return abs(one.x) < 1e-4 and abs(other.x) < 1e-4 and one.y + other.y > -0.5
