# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Settings, Surface, bands, distortion, errors, unwrap
from qh_unwrap.core.air import _within, make_air
from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.delaunay import triangulate
from qh_unwrap.core.domain import Fixed
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.plane import Plane, airs_around
from qh_unwrap.core.triangles import signed_areas
from qh_unwrap.core.weights import scheme

from . import shapes
from .patches import Patches


def free(vertices, triangles, uv=None, pinned=None, **settings):
    return unwrap(vertices, triangles, Settings(boundary="FREE", **settings), uv, pinned)


@pytest.mark.parametrize("name", shapes.DEVELOPABLE)
def test_developable_surfaces_become_isometric(name):
    result = free(*shapes.developable(name), iterations=15, refine=0)
    assert result.report.injective and result.report.after.flips == 0
    assert result.report.after.l2_stretch < 1.005


@pytest.mark.parametrize("name", ["strip 4:1", "L", "cone", "cylinder"])
def test_they_also_do_from_a_circle(name):
    result = free(*shapes.developable(name), initial="MEAN_VALUE", iterations=40, tolerance=1e-5, refine=0)
    assert result.report.injective
    assert result.report.after.l2_stretch < 1.005


def test_air_fills_the_plane_outside_and_in_holes():
    vertices, triangles = shapes.ring(24, 3)
    surface = Surface(vertices, triangles)
    uv = vertices[:, :2]
    points, on_circle, air, _ = make_air(uv, surface.loops, triangulate)
    everything = np.vstack([uv, points])
    areas = signed_areas(everything[air])
    assert (areas > 0).all() and len(air) < 1500
    rim = points[on_circle]
    whole = signed_areas(np.stack([rim, np.roll(rim, -1, axis=0), np.zeros_like(rim)], axis=1)).sum()
    assert areas.sum() + signed_areas(uv[triangles]).sum() == pytest.approx(whole, rel=1e-9)
    with_hole = {tuple(sorted(t)) for t in air.tolist()}
    assert len(with_hole) == len(air)


def test_triangles_with_indices_of_32_bits_make_the_same_air():
    angle = 2 * np.pi * np.arange(46_500) / 46_500
    uv = np.column_stack([np.cos(angle), np.sin(angle)])
    air = make_air(uv, [np.arange(len(uv))], triangulate)
    same = make_air(uv, [np.arange(len(uv))], lambda *given: triangulate(*given).astype(np.int32))
    np.testing.assert_array_equal(same.triangles, air.triangles)


def test_air_needs_an_outline_that_does_not_cross_itself():
    vertices, triangles = shapes.random_disk(1)
    surface = Surface(vertices, triangles)
    uv = vertices[:, :2].copy()
    a, b = surface.loops[0][[0, 12]]
    uv[[a, b]] = uv[[b, a]]
    assert make_air(uv, surface.loops, triangulate) is None
    assert make_air(0 * uv, surface.loops, triangulate) is None


@pytest.mark.parametrize("turned", [(0,), (1,), (0, 1)])
def test_air_needs_loops_that_run_the_right_way(turned):
    surface = Surface(*shapes.ring(24, 3))
    uv = surface.vertices[:, :2]
    loops = [loop[::-1] if k in turned else loop for k, loop in enumerate(surface.loops)]
    assert make_air(uv, surface.loops, triangulate) is not None
    assert make_air(uv, loops, triangulate) is None


def test_air_needs_triangles_with_all_sides():
    surface = Surface(*shapes.random_disk(1))

    def with_others(points, sides):
        number = np.arange(len(points))
        number[[0, 5]] = number[[5, 0]]
        return number[triangulate(points, sides)]

    assert make_air(surface.vertices[:, :2], surface.loops, with_others) is None


def test_behind_a_short_outline_the_islands_own_order_serves_on(monkeypatch):
    monkeypatch.setattr(bands, "_WIDEST", -1)
    meshes = [shapes.bump(1, inner=1100, outer=20), shapes.bump(2, inner=100, outer=40)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    uv = surface.vertices[:, :2] + 9 * surface.vertex_piece[:, None]
    plane = Plane(surface, uv, Fixed(np.zeros(uv.shape, bool), uv), airs_around(surface, uv, triangulate), triangulate)
    order, first = plane.constrained.order, surface.order[surface.vertex_piece[surface.order] == 0]
    np.testing.assert_array_equal(order[: len(first)], first)
    assert (np.sort(order) == np.arange(len(plane.vertex_piece))).all()
    assert (np.diff(plane.vertex_piece[order]) >= 0).all()
    second = order[plane.vertex_piece[order] == 1]
    assert (np.diff(second < len(uv)) != 0).sum() > 1, "behind a long one it and the air are eliminated together"


def test_a_flat_patch_is_a_fixed_point_with_air_around_it():
    vertices, triangles = shapes.random_disk(2)
    result = free(vertices, triangles, vertices[:, :2], initial="CURRENT", iterations=3, tolerance=0, refine=0)
    assert max(result.report.changes) < 1e-9
    assert result.report.after.symmetric_dirichlet == pytest.approx(1, abs=1e-9)


def test_the_island_neither_grows_nor_spins():
    vertices, triangles = shapes.bump(3, inner=300, outer=60, height=1.5)
    result = free(vertices, triangles, iterations=60, tolerance=1e-7, refine=0)
    assert result.report.changes[-1] < 1e-3 * result.report.changes[0]


def test_a_free_outline_distorts_less_than_a_circle():
    vertices, triangles = shapes.grid(12, 6, width=3)
    vertices[:, 2] = 0.3 * np.sin(3 * vertices[:, 0]) * vertices[:, 1]
    circle = unwrap(vertices, triangles, Settings(boundary="CIRCLE", iterations=20, refine=0)).report.after
    ours = free(vertices, triangles, iterations=20).report.after
    assert ours.symmetric_dirichlet - 1 < 0.2 * (circle.symmetric_dirichlet - 1)


def test_every_hole_stays_open():
    vertices, triangles = shapes.grid(33, 33)
    plate = shapes.cut(vertices, triangles, lambda x, y, z: (np.floor(x * 11) % 2 == 0) | (np.floor(y * 11) % 2 == 0))
    plate[0][:, 2] = 0.3 * plate[0][:, 0] ** 2
    surface = Surface(*plate)
    assert len(surface.loops) == 26
    result = free(*plate, iterations=12)
    assert result.report.injective and result.report.after.symmetric_dirichlet < 1.02
    for loop in surface.loops[1:]:
        x, y = result.uv[loop].T
        assert abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 1e-4


def test_pins_stay_and_the_rest_follows():
    vertices, triangles = shapes.bump(4)
    uv = 2 * vertices[:, :2] @ [[0.8, 0.6], [-0.6, 0.8]] + 3
    pinned = np.zeros(len(uv), bool)
    pinned[[5, 40, 90]] = True
    for mirror in ([1, 1], [-1, 1]):
        result = free(vertices, triangles, uv * mirror, pinned, iterations=20)
        np.testing.assert_array_equal(result.uv[pinned], (uv * mirror)[pinned])
        assert result.report.mirrored == (mirror[0] < 0)
        assert result.report.injective and result.report.after.symmetric_dirichlet < 1.4


def test_air_is_made_around_sides_that_lie_all_but_on_a_line():
    # Spread on a circle its 803 sides are straight in 32-bit floats, and triangles between them are inside out.
    kind, vertices, triangles = Patches()(124)
    assert (kind, len(triangles)) == ("fan", 803)
    report = free(vertices, triangles, iterations=1).report
    assert report.injective and not report.warnings


def test_points_lie_within_or_without():
    random = np.random.default_rng(0)
    for polygon, points in ((random.random((40, 2)), random.random((900, 2))), np.mgrid[:2, :6, :6].reshape(2, -1, 2)):
        start, end = polygon, np.roll(polygon, -1, axis=0)
        (x, y), (px, py) = points.T[:, :, None], (start.T, end.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = px[0] + (py[0] - px[0]) * (y - px[1]) / (py[1] - px[1])
        crossed = ((px[1] > y) != (py[1] > y)) & (x < at)
        np.testing.assert_array_equal(_within(points, start, end), crossed.sum(axis=1) % 2 == 1)


def test_an_outline_that_pins_cross_is_kept_and_not_certified():
    vertices, triangles = shapes.bump(4)
    loop = Surface(vertices, triangles).loops[0]
    uv = vertices[:, :2].copy()
    pinned = np.zeros(len(uv), bool)
    pinned[loop] = True
    uv[loop] = np.random.default_rng(1).permutation(uv[loop])
    result = free(vertices, triangles, uv, pinned)
    np.testing.assert_array_equal(result.uv[pinned], uv[pinned])
    assert not result.report.injective and result.report.after.flips > 0
    assert any("pins" in warning for warning in result.report.warnings)


def test_crossing_pins_are_never_certified():
    vertices, triangles = shapes.bump(4)
    uv = vertices[:, :2].copy()
    pinned = np.zeros(len(uv), bool)
    pinned[:40] = True
    uv[:40] = uv[:40][::-1]
    result = free(vertices, triangles, uv, pinned)
    np.testing.assert_array_equal(result.uv[pinned], uv[pinned])
    assert not result.report.injective and result.report.after.flips > 0


def test_starts_that_overlap_give_way_to_a_circle():
    angle, across = np.meshgrid(np.linspace(0, 3 * np.pi, 60), np.linspace(0, 1, 5))
    _, triangles = shapes.grid(59, 4)
    radius = 1 + across
    stairs = np.column_stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel(), 0.3 * angle.ravel()])
    result = free(stairs, triangles[:, ::-1], initial="PROJECTION", iterations=30)
    assert any("overlaps" in warning for warning in result.report.warnings)
    assert result.report.injective


def test_refusals_name_the_cure():
    vertices, triangles = shapes.bump(1)
    for weights in ("MEAN_VALUE", "MEAN_VALUE_SCALAR", "STRETCH"):
        with pytest.raises(errors.SettingsError, match="COTANGENT"):
            free(vertices, triangles, weights=weights)
    pinned = np.zeros(len(vertices), bool)
    pinned[3] = True
    with pytest.raises(errors.UVError):
        free(vertices, triangles, None, pinned)


def test_smallest_surfaces():
    for vertices, triangles in ((np.eye(3), [[0, 1, 2]]), shapes.grid(1, 1), shapes.grid(2, 1, height=0.001)):
        result = free(vertices, triangles)
        assert result.report.injective
        assert result.report.after.symmetric_dirichlet == pytest.approx(1, abs=1e-3)


def test_results_without_pins_lie_in_the_unit_square():
    vertices, triangles = shapes.bump(6)
    result = free(vertices, triangles)
    assert result.uv.min() == 0 and result.uv.max() == pytest.approx(1)
    surface = Surface(vertices, triangles)
    assert is_injective(result.uv, triangles, surface.loops)
    assert distortion(vertices, triangles, result.uv).flips == 0


def test_the_weights_of_an_isometry_need_no_balance():
    vertices, triangles = shapes.random_disk(7)
    surface = Surface(vertices, triangles)
    uv = 3 * vertices[:, :2]
    nothing = Fixed(np.zeros(uv.shape, bool), uv)
    plane = Plane(surface, uv, nothing, airs_around(surface, uv, triangulate), triangulate)
    weights = scheme(Settings(balance=0.25))(plane.charts, plane.start(uv))
    np.testing.assert_allclose(
        plane.weights(weights, plane.start(uv)), plane.triangles.joined(weights), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize(
    "renewed", [[True, False, False], [False, True, False], [True, False, True], [True, True, True]]
)
def test_new_air_around_some_pieces_leaves_the_order_of_the_others(renewed):
    renewed = np.array(renewed)
    meshes = [shapes.bump(k, inner=60 * (k + 1), outer=20 + 4 * k) for k in range(3)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    uv = surface.vertices[:, :2] * (1 + 0.2 * surface.vertex_piece[:, None])
    fixed = Fixed(np.zeros(uv.shape, bool), uv)
    plane = Plane(surface, uv, fixed, airs_around(surface, uv, triangulate), triangulate)
    before = plane.constrained.order, plane.vertex_piece
    moved = plane.start(uv)
    moved[: len(uv)] *= 1 + 0.1 * np.sin(3 * moved[: len(uv), ::-1])
    everything, failed = plane.recalled(moved, moved[: len(uv)], renewed)
    assert not failed.any()
    order, piece = plane.constrained.order, plane.vertex_piece
    assert (np.sort(order) == np.arange(len(everything))).all()
    for k in np.flatnonzero(~renewed):
        one, other = (its[whose[its] == k] for its, whose in (before, (order, piece)))
        inner = one < len(uv)
        assert len(one) == len(other) and (one[inner] == other[inner]).all(), "its own vertices keep their numbers"
        assert (np.diff(one[~inner] - other[~inner]) == 0).all(), "those of its air are all moved on alike"
    weights = plane.weights(scheme(Settings(balance=0.25))(plane.charts, everything), everything)
    fresh = Plane(surface, everything[: len(uv)], fixed, plane._airs, triangulate)
    found, expected = (each.constrained.solve(weights) for each in (plane, fresh))
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("radius", [0.33, 0.25, 0.15])
def test_a_hole_that_grows_from_nothing_does_not_cross_itself(radius):
    # a torus cut along one ring: its start draws the inner end together until single precision sees nothing of it
    around, across = 48, 12
    a, b = 2 * np.pi * np.arange(around + 1)[:, None] / around, 2 * np.pi * np.arange(across) / across
    out = 1 + radius * np.cos(b)
    vertices = np.stack([out * np.cos(a), out * np.sin(a), radius * np.sin(b) + 0 * a], axis=2).reshape(-1, 3)
    k, j = np.divmod(np.arange(around * across), across)
    corner, beside = k * across + j, k * across + (j + 1) % across
    halves = [corner, corner + across, beside + across], [corner, beside + across, beside]
    result = free(vertices, np.concatenate([np.column_stack(half) for half in halves]))
    assert result.report.injective and result.report.after.flips == 0
    assert result.report.after.symmetric_dirichlet < 16
