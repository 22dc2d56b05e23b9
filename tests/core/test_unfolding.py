# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qh_unwrap.core import Settings, Shape, Surface, errors, locality, unwrap, unwrap_islands
from qh_unwrap.core.certificate import certified_pieces, orientation
from qh_unwrap.core.delaunay import triangulate
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.unfolding import _energy, unfolded, unfolded_in_air

from . import shapes

NOTHING = np.zeros((104, 2), bool)


def thrown(seed, count):
    """A flat patch, its own map, and the same with some inner vertices thrown across their neighbours."""
    vertices, triangles = shapes.random_disk(seed)
    uv = vertices[:, :2].copy()
    for k in np.random.default_rng(seed).choice(80, count, replace=False):
        around = np.setdiff1d(triangles[(triangles == k).any(axis=1)], [k])
        uv[k] += 1.5 * (uv[around[0]] - uv[k])
    return Surface(vertices, triangles), vertices[:, :2], uv


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 4))
def test_flipped_triangles_open_and_what_is_far_stays(seed, count):
    surface, flat, uv = thrown(seed, count)
    wrong = orientation(uv, surface.triangles) <= 0
    opened, done = unfolded(surface, uv, NOTHING, 1.0)
    assert done.tolist() == [bool(wrong.any())]
    assert (orientation(opened, surface.triangles) > 0).all()
    moved = (opened != uv).any(axis=1)
    assert moved.sum() < len(uv)
    assert np.abs(opened - flat)[moved].max() < 1


def test_what_is_held_stays_to_the_last_bit():
    surface, _, uv = thrown(3, 2)
    held = NOTHING.copy()
    held[80:] = True
    opened, done = unfolded(surface, uv, held, 1.0)
    assert done.all()
    np.testing.assert_array_equal(opened[held], uv[held])


def test_what_cannot_be_opened_stays_as_it_was():
    surface, _, uv = thrown(3, 2)
    for held, most in ((NOTHING | True, 1.0), (NOTHING, 0.0)):
        opened, done = unfolded(surface, uv, held, most)
        assert not done.any()
        np.testing.assert_array_equal(opened, uv)


@pytest.mark.parametrize("bent", [1e-1, 1e-3])
def test_the_gradient_is_that_of_the_energy(bent):
    surface, _, uv = thrown(5, 3)
    free = np.ones_like(uv, dtype=bool)

    def value(x):
        return _energy(x, surface.triangles.T, surface.hats, bent, free)

    rng = np.random.default_rng(0)
    gradient = value(uv)[1]
    for _ in range(5):
        way = rng.normal(size=uv.shape)
        step = 1e-8 * way
        slope = (value(uv + step)[0] - value(uv - step)[0]) / 2e-8
        assert slope == pytest.approx(gradient @ way.ravel(), rel=1e-2)


def plate(sides, points, rng):
    """A flat polygon with points along its straight sides, cut into ears as they come, somewhere in space."""
    corner = np.exp(2j * np.pi * np.arange(sides) / sides)
    way = np.sort(np.hstack([np.zeros((sides, 1)), rng.random((sides, points))]), axis=1)
    rim = (corner[:, None] * (1 - way) + np.roll(corner, -1)[:, None] * way).ravel()
    flat = np.column_stack([rim.real, rim.imag, np.zeros(len(rim))])
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    left, triangles = list(range(len(rim))), []
    while len(left) > 2:
        k = int(rng.integers(len(left)))
        ear = [left[k - 1], left[k], left[(k + 1) % len(left)]]
        triangles.append(ear)
        left.remove(ear[1])
    return (flat @ rotation.T).astype(np.float32).astype(float), np.array(triangles)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("boundary", ["FREE", "CIRCLE"])
def test_polygons_with_points_along_straight_sides(seed, boundary):
    """Their triangles along a side have hardly any area, and lie either way by rounding."""
    rng = np.random.default_rng(seed)
    vertices, triangles = plate(3 + seed % 4, 12, rng)
    report = unwrap(vertices, triangles, Settings(boundary=boundary)).report
    assert report.injective
    if boundary == "FREE":
        assert report.after.symmetric_dirichlet < 1.001


@pytest.mark.parametrize("initial", ["AUTO", "MEAN_VALUE", "PROJECTION", "RINGS"])
@pytest.mark.parametrize("boundary", ["FREE", "CIRCLE"])
def test_faces_that_are_all_in_one_place(initial, boundary):
    """A rough sheet of which some quads are scaled to a point."""
    rng = np.random.default_rng(1)
    vertices, triangles = shapes.grid(30, 30)
    vertices[:, 2] = 0.02 * rng.random(len(vertices))
    for corner in rng.choice(29 * 31, 40, replace=False):
        quad = corner + np.array([0, 1, 31, 32])
        vertices[quad] = vertices[corner]
    assert unwrap(vertices, triangles, Settings(initial=initial, boundary=boundary)).report.injective


@pytest.mark.parametrize("thinness", [1e-2, 1e-4, 1e-6])
def test_a_sheet_that_is_thin_as_a_whole_is_no_sheet_without_area(thinness):
    vertices, triangles = shapes.grid(12, 12, height=thinness)
    report = unwrap(vertices, triangles).report
    assert report.after.symmetric_dirichlet == pytest.approx(1, abs=1e-9)
    assert not report.warnings


@pytest.mark.parametrize("sorted_above", [0, 10**9])
def test_polygons_count_as_without_area_only_as_a_whole(sorted_above, monkeypatch):
    """A point along a quad's side makes a triangle without area, but no face without."""
    monkeypatch.setattr(locality, "MANY", sorted_above)
    vertices, triangles = shapes.grid(4, 4)
    vertices[1] = (vertices[0] + vertices[6]) / 2  # of the first quad's triangles (0, 1, 6) and (0, 6, 5)
    (flat,) = np.flatnonzero(Surface(vertices, triangles).degenerate)
    other = np.flatnonzero((np.sort(triangles, axis=1) == (0, 5, 6)).all(axis=1))
    triangle_of_its_own, half_of_a_quad = np.arange(len(triangles)), np.arange(len(triangles))
    half_of_a_quad[other] = flat
    for face, expected in ((None, 1), (triangle_of_its_own, 1), (half_of_a_quad, 0)):
        (result,) = finished(unwrap_islands([Shape(vertices, triangles, face=face)]))
        assert len(result.report.warnings) == expected


def test_there_must_be_a_face_for_each_triangle():
    vertices, triangles = shapes.grid(2, 2)
    (error,) = finished(unwrap_islands([Shape(vertices, triangles, face=np.zeros(3, int))]))
    assert isinstance(error, errors.ShapeError)


@pytest.mark.parametrize("gap", [3e-8, 1e-7])
@pytest.mark.parametrize("shift", [9.3, 40.1])
def test_an_outline_that_rounding_would_close_is_opened(gap, shift):
    """A slit so narrow that single precision cannot tell its sides apart."""
    flat, triangles = shapes.grid(6, 6)
    sides = 21 + np.arange(3)  # the vertices from the rim inwards, on the line between two rows of quads
    copies = len(flat) + np.arange(3)
    above = flat[triangles][:, :, 1].mean(axis=1) > 0.5
    for side, copy in zip(sides, copies, strict=True):
        triangles[above] = np.where(triangles[above] == side, copy, triangles[above])
    vertices = np.vstack([flat, flat[sides]])
    uv = vertices[:, :2] + shift
    uv[copies, 1] += gap
    surface = Surface(vertices, triangles)
    assert not certified_pieces(surface, uv)[0]
    opened, done = unfolded_in_air(surface, uv, np.zeros_like(uv, dtype=bool), triangulate)
    assert done and certified_pieces(surface, opened)[0]
    assert np.abs(opened - uv).max() < 0.05
