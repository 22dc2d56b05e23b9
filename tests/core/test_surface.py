# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Surface, errors
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
        flat = surface.flat[:, k] - surface.flat[:, k - 1]
        solid = surface.vertices[triangles[:, k]] - surface.vertices[triangles[:, k - 1]]
        np.testing.assert_allclose(np.linalg.norm(flat, axis=1), np.linalg.norm(solid, axis=1), rtol=1e-12)
    assert (signed_areas(surface.flat) > 0).all()
    assert surface.area.sum() == pytest.approx(1, rel=1e-12)


def test_loops_follow_the_winding_and_the_longest_comes_first():
    vertices, triangles = shapes.ring()
    surface = Surface(vertices, triangles)
    assert [len(loop) for loop in surface.loops] == [16, 16]
    outer, inner = (surface.vertices[loop, :2] for loop in surface.loops)
    assert np.linalg.norm(outer, axis=1).min() > np.linalg.norm(inner, axis=1).max()
    sides = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1], strict=True)}
    for loop in surface.loops:
        assert all(side in sides for side in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))


def test_filling_closes_every_hole_and_keeps_the_triangles():
    surface = Surface(*shapes.ring())
    filled = surface.filled()
    assert len(filled.loops) == 1
    np.testing.assert_array_equal(filled.triangles[: len(surface.triangles)], surface.triangles)
    np.testing.assert_array_equal(filled.loops[0], surface.loops[0])
    assert filled.filled() is filled


def test_zero_area_triangles_are_survived():
    vertices, triangles = shapes.grid(4, 4)
    a, b, c = triangles[5]
    vertices[c] = (vertices[a] + vertices[b]) / 2  # one flat triangle
    vertices[triangles[20]] = vertices[triangles[20]].mean(axis=0)  # one that is a point
    surface = Surface(vertices, triangles)
    assert surface.degenerate[5] and surface.degenerate[20]
    assert (surface.area > 0).all() and np.isfinite(surface.flat).all()
