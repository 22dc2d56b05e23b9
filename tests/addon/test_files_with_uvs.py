# SPDX-License-Identifier: GPL-3.0-or-later
"""First unwraps of models with several islands, and what they must have in common."""

import os
from pathlib import Path

import bpy  # isort: skip
import numpy as np
import pytest
from scenes import uvs

from qh_unwrap.addon import files, mesh_arrays, operators
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.core import placing
from qh_unwrap.core.islands import find_islands
from qh_unwrap.core.pieces import Pieces

_MESHES = os.environ.get("QH_MESHES")


@pytest.fixture(scope="module")
def beast():
    """Its twenty islands, as seen after their first unwrap: (vertices, triangles, uv), and the object's up axis."""
    if not _MESHES:
        pytest.skip("QH_MESHES is not set")
    (obj,) = files.load(Path(_MESHES, "artist", "beast_quads_uv.obj"))
    files.mark_cuts([obj], MeshOptions())
    obj.data.uv_layers.remove(obj.data.uv_layers.active)
    obj.select_set(True)
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert not any(outcome.error or outcome.overlaps for outcome in operators.last_outcomes)
    mesh = mesh_arrays.read(obj)
    topology = mesh.corner_vertex, mesh.corner_edge, mesh.face_start, mesh.seam
    found = find_islands(*topology, np.ones(len(obj.data.polygons), dtype=bool), mesh.corner_triangles)
    uv = uvs(obj).astype(float)
    islands = []
    for island in found:
        island_uv = np.empty((len(island.vertices), 2))
        island_uv[island.corner_vertex] = uv[island.corners]
        islands.append((mesh.vertices[island.vertices], island.triangles, island_uv))
    return islands, mesh.up


def test_texel_density_is_equal(beast):
    islands, _ = beast
    assert len(islands) == 20
    in_space = together(islands).areas
    density = [uv_area(uv, triangles) for _, triangles, uv in islands] / in_space
    assert np.ptp(density) < 0.01 * np.mean(density)


def test_islands_are_upright_and_not_mirrored(beast):
    islands, up = beast
    both = together(islands)
    again = placing.upright(both, np.concatenate([uv for _, _, uv in islands]), np.tile(up, (len(islands), 1)))
    for (_, triangles, uv), turned in zip(islands, both.of_each(again), strict=True):
        assert uv_area(uv, triangles) > 0
        edges = triangles[:, 1], triangles[:, 0]
        z, w = ((each[edges[0]] - each[edges[1]]) @ (1, 1j) for each in (uv, turned))
        assert abs(np.angle(np.vdot(z, w))) < 1e-3, "turning it again changes nothing"


def together(islands):
    return Pieces([vertices for vertices, _, _ in islands], [triangles for _, triangles, _ in islands])


def uv_area(uv, triangles):
    a, b, c = uv[triangles].transpose(1, 0, 2)
    (x1, y1), (x2, y2) = (b - a).T, (c - a).T
    return (x1 * y2 - x2 * y1).sum() / 2
