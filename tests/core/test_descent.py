# SPDX-License-Identifier: GPL-3.0-or-later
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qh_unwrap.core import Settings, Surface, descent, distortion, unwrap
from qh_unwrap.core.certificate import wrong_pieces
from qh_unwrap.core.delaunay import triangulate
from qh_unwrap.core.descent import Descent
from qh_unwrap.core.domain import Fixed, Held, loose
from qh_unwrap.core.energy import Barrier, energies, map_scale
from qh_unwrap.core.flattening import conformal
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.plane import Plane, airs_around
from qh_unwrap.core.stepping import finished

from ..benchmarks.generated import hundred
from . import shapes
from .test_tensor import seeds


def bent(seed):
    """A surface, a map of it without flips, and a direction to change the map."""
    vertices, triangles = shapes.bump(seed)
    rng = np.random.default_rng(seed)
    x, y, _ = vertices.T
    uv = np.column_stack([x + 0.1 * np.sin(2 * y), 0.7 * y + 0.1 * x * x])
    return Surface(vertices, triangles), uv, rng.normal(size=uv.shape)


def unheld(surface, uv):
    return Held(surface, Fixed(np.zeros(uv.shape, bool), uv))


@given(seeds, st.floats(0, 1))
def test_the_gradient_is_the_derivative_of_the_energy(seed, balance):
    surface, uv, direction = bent(seed)
    barrier = Barrier(unheld(surface, uv), uv, balance, np.array([1.3]))
    gradient = np.array(barrier.derivatives(barrier.jacobian(uv))[:2])
    np.testing.assert_allclose(barrier.gradient(barrier.jacobian(uv)), gradient, rtol=1e-9, atol=1e-12)
    total = np.zeros_like(uv)
    for corner in range(3):
        np.add.at(total, surface.triangles[:, corner], gradient[:, corner].T)
    step = 1e-6
    values = [barrier.value(barrier.jacobian(uv + side * step * direction))[0] for side in (-1, 1)]
    difference = (values[1] - values[0]) / (2 * step)
    assert (total * direction).sum() == pytest.approx(difference, rel=1e-4, abs=1e-6)


def test_the_hessian_is_that_of_the_energy_where_it_is_positive():
    vertices, triangles = shapes.random_disk(3)
    surface = Surface(vertices, triangles)
    rng = np.random.default_rng(3)
    uv = surface.vertices[:, :2] + 1e-4 * rng.normal(size=(len(vertices), 2))  # near the minimum nothing is clamped
    barrier = Barrier(unheld(surface, uv), uv, 0.25, np.ones(1))
    direction = rng.normal(size=uv.shape)
    mean, difference, symmetric, anti = barrier.derivatives(barrier.jacobian(uv))[2:]
    blocks = np.array([[mean + difference, symmetric - anti], [symmetric + anti, mean - difference]])
    quadratic = 0.0
    for corner in range(3):
        start, end = triangles[:, corner], triangles[:, (corner + 1) % 3]
        apart = direction[start] - direction[end]
        quadratic -= np.einsum("ti,ijt,tj->", apart, blocks[:, :, corner], apart)
    step = 1e-3
    values = [barrier.value(barrier.jacobian(uv + k * step * direction))[0] for k in (-1, 0, 1)]
    assert quadratic == pytest.approx((values[0] - 2 * values[1] + values[2]) / step**2, rel=1e-2)


def apart_from_rest(jacobian, weight):
    """Half the squared distance of all triangles from their shapes at rest, turned as in the map, without flips."""
    matrices = jacobian.transpose(2, 0, 1)
    left, _, right = np.linalg.svd(matrices)
    return (weight * ((matrices - left @ right) ** 2).sum(axis=(1, 2))).sum() / 2


@given(seeds)
def test_the_pull_is_the_derivative_of_the_distance_from_rest(seed):
    surface, uv, direction = bent(seed)
    barrier = Barrier(unheld(surface, uv), uv, 0.25, np.array([1.3]))
    *pull, stiffness = barrier.pull(barrier.jacobian(uv))
    step, corners, weight = 1e-6, surface.triangles.T, surface.barrier / surface.barrier.sum()
    values = [apart_from_rest(barrier.jacobian(uv + side * step * direction), weight) for side in (-1, 1)]
    slope = sum((each * direction[corners, c]).sum() for c, each in enumerate(pull))
    assert slope == pytest.approx((values[1] - values[0]) / (2 * step), rel=1e-4, abs=1e-6)
    # With the turns as they are, the distance is a parabola.
    apart = direction[corners] - direction[np.roll(corners, -1, axis=0)]
    curvature = (weight * (barrier.jacobian(direction) ** 2).sum(axis=(0, 1))).sum()
    assert -(stiffness * (apart**2).sum(axis=2)).sum() == pytest.approx(curvature)


def test_laid_out_in_their_shapes_triangles_of_a_flat_surface_fit_at_once():
    vertices, triangles = shapes.random_disk(6)
    surface = Surface(vertices, triangles)
    uv = surface.vertices[:, :2] * [1.3, 0.8]
    domain = loose(surface, uv, None)
    descending = Descent(0.25, np.ones(1), rigidly=True)
    _, uv, done = finished(descending.step(domain, uv, np.ones(1, bool)))
    assert energies(surface, uv, 0.25) == pytest.approx(1, abs=1e-9) and not done.any()
    _, uv, done = finished(descending.step(domain, uv, np.ones(1, bool)))
    assert done.all(), "the next step is Newton's, and brings nothing"


@pytest.mark.parametrize("in_air", [False, True])
def test_from_a_conformal_map_rigid_triangles_lead_most_of_the_way(in_air):
    vertices, triangles = shapes.bump(4, inner=300, outer=50, height=0.8)
    surface = Surface(vertices, triangles)
    uv, going = conformal(surface), np.ones(1, bool)
    best = energies(surface, unwrap(vertices, triangles).uv, 0.25)
    fixed = Fixed(np.zeros(uv.shape, bool), uv)
    domain = Plane(surface, uv, fixed, airs_around(surface, uv, triangulate), triangulate)
    domain = domain if in_air else loose(surface, uv, None)
    _, after, _ = finished(Descent(0.25, map_scale(surface, uv), rigidly=True).step(domain, domain.start(uv), going))
    before, laid_out = (energies(surface, each[: len(uv)], 0.25) for each in (uv, after))
    assert before > best + 0.04
    assert best < laid_out < best + 0.2 * (before - best)


def test_rigid_triangles_flip_nothing_and_never_raise_the_energy():
    for seed in range(20):
        surface, uv = squashed(seed, 0.05)
        going = np.ones(1, bool)
        domain = loose(surface, uv, None)
        _, after, _ = finished(Descent(0.25, np.ones(1), rigidly=True).step(domain, uv, going))
        assert energies(surface, after, 0.25) <= energies(surface, uv, 0.25)


def test_beside_a_piece_with_flips_others_begin_rigidly_once():
    one, other = shapes.random_disk(6), shapes.random_disk(7)
    surface = Surface(*joined([one[0], other[0]], [one[1], other[1]]))
    uv = surface.vertices[:, :2] * [1.3, 0.8]
    first = np.flatnonzero(surface.vertex_piece == 1)[0]
    uv[first] += 3
    assert wrong_pieces([surface], uv).tolist() == [False, True]
    domain, descending, going = loose(surface, uv, None), Descent(0.25, np.ones(2), rigidly=True), np.ones(2, bool)
    _, after, done = finished(descending.step(domain, uv, going))
    assert done.tolist() == [False, True]
    np.testing.assert_array_equal(after[surface.vertex_piece == 1], uv[surface.vertex_piece == 1])
    *_, done = finished(descending.step(domain, after, going))
    assert done.all()


def test_air_gives_way_step_by_step():
    vertices, triangles = hundred()["spiral 33"]  # every step keeps its promise, and is followed by others
    ended = unwrap(vertices, triangles).report
    stopped = unwrap(vertices, triangles, Settings(refine=15)).report
    assert ended.after.symmetric_dirichlet < stopped.after.symmetric_dirichlet - 0.003


@pytest.mark.parametrize("seed", range(4))
def test_where_a_step_has_kept_its_promise_its_equations_do_for_the_last(seed, monkeypatch):
    mesh = shapes.bump(seed, inner=300, outer=50, height=0.8)
    result = unwrap(*mesh)
    monkeypatch.setattr(descent, "_TRUE", 0)
    longer = unwrap(*mesh)
    assert result.report.converged and len(result.report.changes) < len(longer.report.changes)
    found, best = (energies(Surface(*mesh), each.uv, 0.25) for each in (result, longer))
    assert found == pytest.approx(best, rel=2e-5)


def test_small_bulges_need_no_air():
    """They end where air would have led them, and free of overlaps."""
    vertices, triangles = shapes.hemisphere(10, 3)

    def no_air(*_):
        raise AssertionError("air was made")

    result = unwrap(vertices, triangles, triangulate=no_air)
    start = unwrap(vertices, triangles, Settings(iterations=0, refine=0))
    assert start.report.after.symmetric_dirichlet > 10
    assert result.report.injective
    again = unwrap(vertices, triangles, Settings(initial="CURRENT"), result.uv)
    assert again.report.after.symmetric_dirichlet > (1 - 5e-4) * result.report.after.symmetric_dirichlet


def test_steps_lower_the_energy_and_flip_nothing():
    vertices, triangles = shapes.bump(4, inner=300, outer=50, height=2)
    surface = Surface(vertices, triangles)
    for boundary in ("CIRCLE", "FREE"):
        rough = unwrap(vertices, triangles, Settings(boundary=boundary, refine=0))
        result = unwrap(vertices, triangles, Settings(boundary=boundary))
        assert result.report.injective and result.report.converged
        assert energies(surface, result.uv, 0.25) < energies(surface, rough.uv, 0.25)


def test_the_minimum_is_the_same_from_every_start():
    vertices, triangles = shapes.hemisphere(8, flattening=1.5)
    reached = [
        unwrap(vertices, triangles, Settings(boundary="CIRCLE", refine=50, initial=initial, iterations=iterations)).uv
        for initial in ("UNIFORM", "HARMONIC", "PROJECTION")
        for iterations in (3, 12)
    ]
    for uv in reached[1:]:
        np.testing.assert_allclose(uv, reached[0], atol=5e-3)


def squashed(seed, part):
    """A surface and a map of it of which a part in the middle is all but collapsed."""
    vertices, triangles = shapes.bump(seed)
    uv = vertices[:, :2].copy()
    return Surface(vertices, triangles), uv * np.where(np.linalg.norm(uv, axis=1, keepdims=True) < 0.4, part, 1)


def test_far_from_the_end_steps_go_farther_than_newton_s():
    surface, uv = squashed(8, 1e-3)
    domain, going = loose(surface, uv, None), np.ones(1, bool)
    descending = Descent(0.25, np.ones(1))
    values = [energies(surface, uv, 0.25)[0]]
    for _ in range(6):
        _, uv, _ = finished(descending.step(domain, uv, going))
        values.append(energies(surface, uv, 0.25)[0])
    # Newton's own length would divide the energy by 16 / 9 in each.
    assert values[-1] < values[0] / 100


def test_a_face_without_area_that_has_all_but_collapsed_opens_in_few_steps():
    vertices = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (2, 1, 0)]
    report = unwrap(vertices, [(0, 1, 2), (0, 2, 4), (0, 4, 3)]).report
    assert report.converged and report.injective
    assert report.iterations <= 20  # Newton's own length would take a hundred, from an energy of 1e14
    assert report.after.symmetric_dirichlet < 1 + 1e-6


def test_in_air_what_promised_more_gets_another_step():
    vertices, triangles = hundred()["spiral 7"]  # of which one step in the middle brings a quarter of its promise
    assert unwrap(vertices, triangles).report.after.symmetric_dirichlet < 1.009


def test_air_holds_no_step_back():
    surface, uv = bent(9)[:2]
    domain = Plane(surface, uv, Fixed(np.zeros(uv.shape, bool), uv), airs_around(surface, uv, triangulate), triangulate)
    uv = domain.start(uv)
    barrier = Barrier(domain, uv, 0.25, np.ones(1))
    jacobian = barrier.jacobian(uv)
    squeezed = jacobian.copy()
    squeezed[..., len(surface.triangles) :] *= 0.5
    np.testing.assert_array_equal(barrier.value(squeezed), barrier.value(jacobian))
    squeezed[0, :, -1] *= -1
    assert np.isinf(barrier.value(squeezed)).all()


def test_what_was_still_improving_is_told():
    vertices, triangles = shapes.hemisphere(14, flattening=6)
    stopped = unwrap(vertices, triangles, Settings(refine=2)).report
    (warning,) = stopped.warnings
    assert not stopped.converged and warning.startswith("it was still improving after 2 steps: set Refine higher")
    ended = unwrap(vertices, triangles).report
    assert ended.converged and not ended.warnings


def test_held_vertices_stay():
    vertices, triangles = shapes.bump(5)
    uv = vertices[:, :2] * [1.5, 1]
    pinned = np.zeros(len(uv), bool)
    pinned[[4, 30]] = True
    kept = unwrap(vertices, triangles, Settings(boundary="KEEP"), uv, pinned)
    rim = np.arange(len(uv)) >= 80
    np.testing.assert_array_equal(kept.uv[rim | pinned], uv[rim | pinned])
    free = unwrap(vertices, triangles, Settings(), uv, pinned)
    np.testing.assert_array_equal(free.uv[pinned], uv[pinned])
    assert free.report.injective


def test_the_slider_trades_areas_for_angles():
    vertices, triangles = shapes.bump(6, inner=300, outer=50, height=2)
    measured = [
        unwrap(vertices, triangles, Settings(boundary="CIRCLE", balance=balance, refine=40)).report.after
        for balance in (0, 0.25, 0.5, 0.75, 1)
    ]
    for less, more in pairwise(measured):
        assert more.angle < less.angle and more.area > less.area


def test_nothing_is_refined_where_the_map_has_flips_or_other_weights_are_chosen():
    vertices, triangles = shapes.bump(7)
    settings = Settings(boundary="CIRCLE", weights="MEAN_VALUE")
    plain = unwrap(vertices, triangles, Settings(boundary="CIRCLE", weights="MEAN_VALUE", refine=0))
    np.testing.assert_array_equal(unwrap(vertices, triangles, settings).uv, plain.uv)
    uv = vertices[:, :2].copy()
    pinned = np.zeros(len(uv), bool)
    pinned[:40] = True
    uv[:40] = uv[:40][::-1]
    crossed = unwrap(vertices, triangles, Settings(), uv, pinned)
    assert crossed.report.after.flips > 0 and np.isfinite(crossed.uv).all()


def test_extreme_starts_are_survived():
    vertices, triangles = shapes.hemisphere(14, flattening=6)
    start = unwrap(vertices, triangles, Settings(boundary="CIRCLE", iterations=0, refine=0))
    tall = unwrap(vertices, triangles, Settings(boundary="CIRCLE"))
    assert tall.report.after.flips == 0
    assert tall.report.after.symmetric_dirichlet < 0.2 * start.report.after.symmetric_dirichlet
    assert distortion(vertices, triangles, tall.uv).symmetric_dirichlet == tall.report.after.symmetric_dirichlet
