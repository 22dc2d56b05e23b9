# SPDX-License-Identifier: GPL-3.0-or-later
"""What a mesh looks like in a mirror gets the map that this looks like in a mirror, whatever its vertices' numbers."""

import numpy as np
import pytest

from qh_unwrap.core import Settings, unwrap
from qh_unwrap.core.air import make_air
from qh_unwrap.core.delaunay import triangulate

from . import shapes


def bent_strip():
    """Three quarters of a bumpy ring, which is cut and widens: its outline is long, and has air within the bend."""
    vertices, triangles = shapes.strip(8.0, 40, bend=1.4)
    x, y, _ = vertices.T
    return vertices + np.column_stack([0 * x, 0 * x, 0.3 * np.sin(3 * x + y)]), triangles


# How to make them, and how far apart the maps may be; a regular outline has no axis that could tell how air lies
SHAPES = {
    "bump": (lambda: shapes.bump(3, inner=300, outer=40), 1e-6),
    "steep bump": (lambda: shapes.bump(5, inner=500, outer=30, height=3.0), 1e-6),
    "hemisphere": (lambda: shapes.hemisphere(8, 2.5), 1e-4),
    "bent strip": (bent_strip, 1e-6),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("renumbered", [False, True])
def test_a_mirrored_mesh_gets_the_mirrored_map(name, renumbered):
    make, most = SHAPES[name]
    vertices, triangles = make()
    vertices = vertices @ shapes.rotation(1)
    number = np.random.default_rng(0).permutation(len(vertices)) if renumbered else np.arange(len(vertices))
    mirrored = np.empty_like(vertices)
    mirrored[number] = vertices * [-1, 1, 1]
    one = unwrap(vertices, triangles, Settings())
    other = unwrap(mirrored, number[triangles[:, ::-1]], Settings())
    assert one.report.iterations == other.report.iterations
    assert shapes.furthest_apart(one.uv, other.uv[number] * [-1, 1]) < most


@pytest.mark.parametrize("angle", [0.3, 2.0])
@pytest.mark.parametrize("mirror", [1, -1])
def test_air_turns_with_the_island_and_is_mirrored_with_it(angle, mirror):
    along = 2 * np.pi * np.sort(np.random.default_rng(4).random(40))
    outline = np.column_stack([np.cos(along), np.sin(along)]) * (1 + 0.3 * np.sin(3 * along))[:, None]
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, sin], [-sin, cos]]) @ np.diag([mirror, 1])
    loop = np.arange(40)
    air = make_air(outline, [loop], triangulate)
    seen = make_air(5 * outline @ turn + 7, [loop[::mirror]], triangulate)
    expected = 5 * air.points @ turn + 7
    assert len(seen.points) == len(expected) and len(seen.triangles) == len(air.triangles)
    apart = np.linalg.norm(seen.points[:, None] - expected, axis=2)
    assert apart.min(axis=0).max() < 1e-9
