# SPDX-License-Identifier: GPL-3.0-or-later
"""The same island has the same UVs, up to a similarity, whoever unwraps it, and in whatever company."""

import bpy
import numpy as np
import pytest
from scenes import uvs

from qh_unwrap.addon import files
from qh_unwrap.cli import main
from qh_unwrap.core import Shape, unwrap, unwrap_islands
from qh_unwrap.core.initial import fit
from qh_unwrap.core.stepping import finished

from ..core import shapes

MANY = 500
CLOSE = 1e-4  # relative to the island's size


@pytest.fixture(scope="module")
def islands():
    """Islands of many kinds, near and far from flat, with holes and without, with as many digits as Blender keeps."""
    made = [shapes.bump(seed, inner=10 + seed % 60, outer=12, height=0.3 + seed % 7 / 4) for seed in range(MANY - 6)]
    made += [shapes.ring(), shapes.hemisphere(8, 1.5), shapes.hemisphere(6, 3), shapes.grid(5, 4)]
    made += [shapes.bump(600, inner=700, outer=90, height=1.5), shapes.bump(601, inner=500, outer=40, height=2.5)]
    return [(vertices.astype(np.float32).astype(float), np.asarray(triangles)) for vertices, triangles in made]


@pytest.fixture(scope="module")
def alone(islands):
    return [unwrap(*island).uv for island in islands]


def assert_same(found, expected):
    everything = np.ones(len(found), bool)
    distance = np.linalg.norm(fit(found, everything, expected) - expected, axis=1).max()
    assert distance < CLOSE * np.ptp(expected, axis=0).max()


@pytest.mark.parametrize("order", ["as they are", "reversed", "shuffled"])
def test_in_company(islands, alone, order):
    number = np.arange(len(islands))
    if order == "reversed":
        number = number[::-1]
    elif order == "shuffled":
        number = np.random.default_rng(0).permutation(number)
    results = finished(unwrap_islands([Shape(*islands[k]) for k in number]))
    for k, result in zip(number, results, strict=True):
        assert result.report.injective
        assert_same(result.uv, alone[k])


def as_object(islands):
    """All islands as one object in an empty scene."""
    bpy.ops.wm.read_homefile(use_empty=True)
    start = np.cumsum([0] + [len(vertices) for vertices, _ in islands])
    points = np.concatenate([vertices for vertices, _ in islands])
    faces = np.concatenate([triangles + first for (_, triangles), first in zip(islands, start, strict=False)])
    mesh = bpy.data.meshes.new("Islands")
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    obj = bpy.data.objects.new("Islands", mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    return obj


def uvs_of_islands(obj, islands):
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    uv = np.empty((len(obj.data.vertices), 2))
    uv[vertex] = uvs(obj)
    return np.split(uv, np.cumsum([len(vertices) for vertices, _ in islands])[:-1])


@pytest.mark.parametrize("way", ["operator", "command line"])
def test_in_blender(islands, alone, way, tmp_path):
    obj = as_object(islands)
    if way == "operator":
        assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    else:
        source, target = tmp_path / "in.blend", tmp_path / "out.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(source))
        assert main([str(source), "-o", str(target)]) == 0
        (obj,) = files.load(target)
    for found, expected in zip(uvs_of_islands(obj, islands), alone, strict=True):
        assert_same(found, expected)
