# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Surface, errors
from qh_unwrap.core.loops import perimeter
from qh_unwrap.core.triangles import signed_areas

from . import shapes


def broken(name):
    vertices, triangles = shapes.grid(3, 2)
    if name == "nan":
        vertices[4, 1] = np.nan
    elif name == "index":
        triangles[0, 0] = len(vertices)
    elif name == "loose":
        vertices = np.vstack([vertices, [5, 5, 5]])
    elif name == "repeated":
        triangles[3, 1] = triangles[3, 0]
    elif name == "no area":
        vertices[:, 1] = 0
    elif name == "duplicate":
        triangles = np.vstack([triangles, np.roll(triangles[:1], 1, axis=1)])
    elif name == "edge":
        vertices = np.vstack([vertices, [0.5, 0.5, 1.0]])
        a, b = triangles[2, :2]
        triangles = np.vstack([triangles, [b, a, len(vertices) - 1], [a, b, len(vertices) - 2]])
    elif name == "winding":
        triangles[2] = triangles[2, ::-1]
    elif name == "vertex":
        other = vertices[1:] + np.array([1, 1, 0])  # its corner 0 is our last vertex
        index = np.r_[len(vertices) - 1, len(vertices) + np.arange(len(other))]
        triangles = np.vstack([triangles, index[triangles]])
        vertices = np.vstack([vertices, other])
    elif name == "bubble":  # as many vertices shared as Euler's formula counts for the second piece
        other, faces = shapes.tetrahedron()
        index = np.r_[5, 3, len(vertices) + np.arange(len(other) - 2)]
        triangles, vertices = np.vstack([triangles, index[faces]]), np.vstack([vertices, other[2:] + [0, 0, 1]])
    elif name == "pieces":
        triangles = np.vstack([triangles, triangles + len(vertices)])
        vertices = np.vstack([vertices, vertices + np.array([9, 0, 0])])
    elif name == "closed":
        return shapes.tetrahedron()
    elif name == "handle":
        return shapes.torus(open=True)
    elif name == "flat array":
        triangles = triangles.ravel()
    elif name == "half index":
        triangles = triangles + 0.5
    elif name == "nothing":
        triangles = triangles[:0]
    return vertices, triangles


@pytest.mark.parametrize(
    "name, error",
    [
        ("nan", errors.NotFiniteError),
        ("index", errors.IndexRangeError),
        ("loose", errors.LooseVertexError),
        ("repeated", errors.DegenerateError),
        ("no area", errors.DegenerateError),
        ("duplicate", errors.DuplicateError),
        ("edge", errors.NonManifoldEdgeError),
        ("winding", errors.WindingError),
        ("vertex", errors.NonManifoldVertexError),
        ("bubble", errors.NonManifoldVertexError),
        ("pieces", errors.DisconnectedError),
        ("closed", errors.ClosedError),
        ("handle", errors.GenusError),
        ("flat array", errors.ShapeError),
        ("half index", errors.ShapeError),
        ("nothing", errors.ShapeError),
    ],
)
def test_each_defect_has_its_own_error(name, error):
    with pytest.raises(error) as caught:
        Surface(*broken(name))
    assert type(caught.value) is error
    assert len(str(caught.value)) > 20


def test_errors_name_the_triangles_at_fault():
    for name, error, expected in (
        ("repeated", errors.DegenerateError, {3}),
        ("duplicate", errors.DuplicateError, {12}),
        ("winding", errors.WindingError, {2}),
    ):
        with pytest.raises(error) as caught:
            Surface(*broken(name))
        assert expected <= set(caught.value.triangles.tolist())


def test_triangles_are_laid_out_isometrically():
    vertices, triangles = shapes.bump(3)
    surface = Surface(vertices, triangles)
    for k in range(3):
        flat = surface.rest[:, k] - surface.rest[:, k - 1]
        solid = surface.vertices[triangles[:, k]] - surface.vertices[triangles[:, k - 1]]
        np.testing.assert_allclose(np.linalg.norm(flat, axis=1), np.linalg.norm(solid, axis=1), rtol=1e-12)
    assert (signed_areas(surface.rest) > 0).all()
    assert surface.area.sum() == pytest.approx(1, rel=1e-12)


def test_loops_follow_the_winding_and_the_outline_comes_first():
    vertices, triangles = shapes.ring()
    surface = Surface(vertices, triangles)
    assert [len(loop) for loop in surface.loops] == [16, 16]
    outer, inner = (surface.vertices[loop, :2] for loop in surface.loops)
    assert np.linalg.norm(outer, axis=1).min() > np.linalg.norm(inner, axis=1).max()
    sides = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1], strict=True)}
    for loop in surface.loops:
        assert all(side in sides for side in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))


def star_in_a_plate(rays=24):
    """A square plate with a hole whose rim runs in and out so often that it is longer than the plate's own."""
    vertices, triangles = shapes.ring(2 * rays, 3)
    angle = np.pi * np.arange(2 * rays) / rays
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    plate = direction / np.abs(direction).max(axis=1, keepdims=True)
    star = direction * np.tile([0.2, 0.8], rays)[:, None]
    between = np.linspace(star, plate, 4, axis=1)
    return np.column_stack([between.reshape(-1, 2), np.zeros(len(vertices))]), triangles


def test_the_outline_is_the_widest_loop_not_the_longest():
    surface = Surface(*star_in_a_plate())
    outline, hole = (surface.vertices[loop] for loop in surface.loops)
    assert perimeter(hole) > 2 * perimeter(outline)
    assert np.abs(outline).max(axis=1).min() > np.abs(hole).max()


@pytest.mark.parametrize("solid", [True, False])
def test_plugs_close_every_hole_and_keep_the_outline(solid):
    surface = Surface(*shapes.ring())
    plugs, centres = surface.plugs(solid)
    assert plugs.is_air != solid and len(centres) == 1
    points = np.vstack([surface.vertices, centres])
    filled = Surface(points, np.vstack([surface.triangles, plugs.triangles]))
    assert len(filled.loops) == 1
    np.testing.assert_array_equal(filled.loops[0], surface.loops[0])
    assert filled.plugs(solid) is None
    m = len(surface.triangles)
    share = filled.area / filled.area[0] * surface.area[0]
    np.testing.assert_allclose(share[:m], surface.area, rtol=1e-9)
    if solid:
        np.testing.assert_allclose(share[m:], plugs.area, rtol=1e-9)


def test_zero_area_triangles_are_survived():
    vertices, triangles = shapes.grid(4, 4)
    a, b, c = triangles[5]
    vertices[c] = (vertices[a] + vertices[b]) / 2  # one flat triangle
    vertices[triangles[20]] = vertices[triangles[20]].mean(axis=0)  # one that is a point
    surface = Surface(vertices, triangles)
    assert surface.degenerate[5] and surface.degenerate[20]
    assert (surface.area > 0).all() and np.isfinite(surface.rest).all()


def test_of_equal_rims_the_lower_one_is_the_outline_whatever_the_numbers_are():
    vertices, triangles = shapes.ring(12, 4)
    angle = np.arctan2(vertices[:, 1], vertices[:, 0])
    level = np.round(np.hypot(vertices[:, 0], vertices[:, 1]), 6)
    vertices = np.column_stack([np.cos(angle), np.sin(angle), level])  # rolled up to a tube
    low = level.min()
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(len(vertices))
        number = np.argsort(order)
        outline = Surface(vertices[order], number[triangles]).outlines[0]
        assert (vertices[order][outline][:, 2] == low).all()
