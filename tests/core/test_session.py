# SPDX-License-Identifier: GPL-3.0-or-later
import gc
import weakref

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from qh_unwrap.core import (
    Settings,
    Shape,
    Surface,
    UnwrapError,
    Unwrapper,
    course,
    distortion,
    errors,
    locality,
    unwrap,
    unwrap_islands,
)
from qh_unwrap.core.energy import density, map_scale
from qh_unwrap.core.stepping import PART, STEP, finished
from qh_unwrap.core.tensor import jacobian

from . import shapes


@pytest.fixture
def bump():
    return shapes.bump(3, inner=300, outer=60, height=1.5)


def steps(session):
    """How many steps the session takes to its end."""
    count = 0
    while session.step():
        count += 1
    return count


def only(session):
    (result,) = session.results()
    return result


def energy(mesh, uv, balance):
    """What the refinement descends: the energy at the scale that a free map takes by itself."""
    surface = Surface(*mesh)
    G = jacobian(surface, uv) / map_scale(surface, uv)
    weight, squares, det = surface.measure / surface.measure.sum(), (G**2).sum(axis=(0, 1)), np.linalg.det(G.T)

    def at(scale):
        return weight @ density(np.exp(scale) * squares, np.exp(scale) * det, balance)

    return minimize_scalar(at, bounds=(-3, 3), method="bounded").fun


def test_it_shows_what_it_has_at_any_time(bump):
    session = Unwrapper([Shape(*bump)])
    assert session.state() is None
    with pytest.raises(UnwrapError, match="not begun"):
        session.results()
    seen = []
    while session.step():
        seen.append(session.state())
        assert only(session).report.after.flips == 0, "there is a result at any time"
    assert [state.iteration for state in seen] == sorted(state.iteration for state in seen)
    assert seen[0].iteration == 0 and seen[0].change == np.inf
    assert all(state.uv.min() == 0 and state.uv.max() == pytest.approx(1) for state in seen)
    np.testing.assert_array_equal(seen[-1].uv, only(session).uv)
    np.testing.assert_array_equal(only(session).uv, unwrap(*bump).uv)
    assert not session.step() and seen[-1].converged and seen[-1].valid


def test_large_meshes_are_shown_in_their_own_order(bump, monkeypatch):
    plain = unwrap(*bump)
    monkeypatch.setattr(locality, "MANY", 10)
    uv = plain.uv * 3 + 1
    pinned = np.zeros(len(uv), bool)
    pinned[[7, 90, 200]] = True
    session = Unwrapper([Shape(*bump, uv, pinned)])
    steps(session)
    np.testing.assert_array_equal(session.state().uv[pinned], uv[pinned])
    target = uv.copy()
    target[90] += 0.02
    session.move(pinned, target)
    steps(session)
    np.testing.assert_array_equal(only(session).uv[pinned], target[pinned])
    assert only(session).report.injective


@pytest.mark.parametrize("boundary", ["FREE", "CIRCLE"])
@pytest.mark.parametrize("after", [1, 3])
def test_other_settings_on_the_way_lead_to_the_same_end(bump, boundary, after):
    settings = Settings(boundary=boundary, balance=0.6)
    session = Unwrapper([Shape(*bump)], Settings(boundary=boundary))
    for _ in range(after):
        session.step()
    session.settings = settings
    steps(session)
    result, fresh = only(session), unwrap(*bump, settings)
    assert result.report.injective and result.report.converged
    assert energy(bump, result.uv, 0.6) == pytest.approx(energy(bump, fresh.uv, 0.6), rel=1e-4)


@pytest.mark.parametrize("balance", [0.25, 0.5, 1])
def test_other_settings_lead_no_higher_where_it_stretches_much(balance):
    mesh = shapes.bump(1, inner=300, outer=60, height=8)
    session = Unwrapper([Shape(*mesh)], Settings(balance=0.25 if balance != 0.25 else 0.5))
    for _ in range(4):
        session.step()
    session.settings = Settings(balance=balance)
    steps(session)
    fresh = unwrap(*mesh, Settings(balance=balance))
    assert only(session).report.injective
    assert energy(mesh, only(session).uv, balance) < (1 + 1e-4) * energy(mesh, fresh.uv, balance)


@pytest.mark.parametrize("after", [1, 2, 3])
def test_other_settings_free_an_outline_that_is_held_on_the_way(after):
    bulb = shapes.bulb()
    session = Unwrapper([Shape(*bulb)])
    for _ in range(after):
        session.step()
    session.settings = Settings(iterations=19)
    steps(session)
    report, expected = only(session).report, unwrap(*bulb).report
    assert report.injective and report.converged
    assert report.after.symmetric_dirichlet == pytest.approx(expected.after.symmetric_dirichlet, rel=2e-3)


def test_another_boundary_begins_anew(bump):
    session = Unwrapper([Shape(*bump)])
    steps(session)
    session.settings = Settings(boundary="CIRCLE")
    steps(session)
    np.testing.assert_allclose(only(session).uv, unwrap(*bump, Settings(boundary="CIRCLE")).uv, atol=1e-9)


def test_settings_that_exclude_each_other_change_nothing(bump):
    session = Unwrapper([Shape(*bump)])
    with pytest.raises(errors.SettingsError):
        session.settings = Settings(weights="MEAN_VALUE")
    assert session.settings == Settings()
    with pytest.raises(errors.SettingsError):
        Unwrapper([Shape(*bump)], Settings(weights="MEAN_VALUE"))


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize("boundary", ["FREE", "KEEP"])
def test_a_moved_pin_needs_a_third_of_the_steps(bump, boundary, mirror):
    vertices, triangles = bump
    uv = unwrap(*bump).uv * [mirror, 1]
    pinned = np.zeros(len(uv), bool)
    pinned[[5, 60, 150, 220]] = True
    settings = Settings(boundary=boundary)
    session = Unwrapper([Shape(*bump, uv, pinned)], settings)
    steps(session)
    target = only(session).uv.copy()
    target[60] += 0.01 * np.ptp(target, axis=0).max() * np.array([0.6, 0.8])
    session.move(pinned, target)
    warm = steps(session)
    moved = only(session)
    np.testing.assert_array_equal(moved.uv[pinned], target[pinned])
    assert moved.report.injective and moved.report.mirrored == (mirror < 0)
    if boundary == "FREE":
        given = np.where(pinned[:, None], target, 0)  # nothing but the pins
        cold = Unwrapper([Shape(vertices, triangles, given, pinned)], settings)
        assert warm <= steps(cold) / 3
        assert moved.report.after.symmetric_dirichlet < 1.01 * only(cold).report.after.symmetric_dirichlet


@pytest.mark.parametrize("far", [0.02, 0.1, 0.2])
def test_all_follows_one_pin_that_was_dragged_where_it_stretches_much(far):
    mesh = shapes.bump(1, inner=300, outer=60, height=8)
    uv = unwrap(*mesh).uv
    pinned = np.zeros(len(uv), bool)
    pinned[[5, 60, 150]] = True
    session = Unwrapper([Shape(*mesh, uv, pinned)])
    steps(session)
    dragged = only(session).uv.copy()
    dragged[60] += far * np.array([0.6, 0.8])
    session.move(pinned, dragged)
    assert steps(session) <= 12
    again = unwrap(*mesh, uv=dragged, pinned=pinned)
    for result in (only(session), again):
        np.testing.assert_array_equal(result.uv[pinned], dragged[pinned])
        assert result.report.injective and not result.report.warnings
        assert result.report.after.symmetric_dirichlet < 2 * distortion(*mesh, uv).symmetric_dirichlet


def test_pins_everywhere_that_cross_spoil_nothing_else(monkeypatch):
    original = course.before_pins

    def before_pins(surface, uv, pinned):
        if np.logical_and.reduceat(pinned.all(axis=1), surface.vertex_starts).any():  # which rounding may hide
            raise errors.SingularError("its equations have no solution")
        return original(surface, uv, pinned)

    monkeypatch.setattr(course, "before_pins", before_pins)
    square, halves = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float), np.array([(0, 1, 2), (0, 2, 3)])
    crossed = Shape(square, halves, square[[0, 2, 1, 3], :2], np.ones(4, bool))
    mesh = shapes.bump(1, inner=50, outer=20)
    uv, pinned = unwrap(*mesh).uv, np.zeros(70, bool)
    pinned[[3, 30]] = True
    uv[30] += 0.2
    bad, good = finished(unwrap_islands([crossed, Shape(*mesh, uv, pinned)]))
    np.testing.assert_array_equal(bad.uv, crossed.uv)
    assert not bad.report.injective and good.report.injective


def test_pins_can_be_set_on_what_is_shown(bump):
    session = Unwrapper([Shape(*bump)])
    for _ in range(2):
        session.step()
    shown = session.state().uv
    pinned = np.zeros(len(shown), bool)
    pinned[[10, 100]] = True
    target = shown.copy()
    target[10] += [0.05, -0.02]
    session.move(pinned, target)
    steps(session)
    result = only(session)
    np.testing.assert_array_equal(result.uv[pinned], target[pinned])
    assert result.report.injective


def test_pins_far_away_are_reached_or_reported(bump):
    session = Unwrapper([Shape(*bump)])
    steps(session)
    shown = session.state().uv
    pinned = np.zeros(len(shown), bool)
    pinned[[10, 11, 100]] = True
    for target in (shown + [2, 0], shown @ [[0, 1], [-1, 0]] * 3, np.roll(shown, 7, axis=0)):
        session.move(pinned, target)
        steps(session)
        result = only(session)
        np.testing.assert_array_equal(result.uv[pinned], target[pinned])
        assert np.isfinite(result.uv).all()
        assert result.report.injective or result.report.after.flips or result.report.warnings


def test_only_one_coordinate_can_be_pinned(bump):
    uv = unwrap(*bump).uv
    pinned = np.zeros((len(uv), 2), bool)
    pinned[[20, 140], 0] = True
    pinned[[33, 99], 1] = True
    target = uv + [0.03, 0]
    target[33, 1] += 0.05
    result = unwrap(*bump, uv=target, pinned=pinned)
    np.testing.assert_array_equal(result.uv[pinned], target[pinned])
    assert result.report.injective and (result.uv[20, 1] != target[20, 1]) and (result.uv[33, 0] != target[33, 0])


def test_partners_keep_their_distance(bump):
    vertices, triangles = bump
    start = unwrap(vertices, triangles).uv
    partner = np.column_stack([np.arange(len(start))] * 2)
    partner[40, 0], partner[70, 1] = 120, 200
    pinned = np.zeros(len(start), bool)
    pinned[[5, 150]] = True
    target = start.copy()
    target[5] += [0.02, 0.01]
    session = Unwrapper(
        [Shape(vertices, triangles, target, pinned, partner)], Settings(initial="CURRENT", iterations=0)
    )
    steps(session)
    uv = only(session).uv
    np.testing.assert_array_equal(uv[pinned], target[pinned])
    assert uv[40, 0] - uv[120, 0] == pytest.approx(target[40, 0] - target[120, 0], abs=1e-9)
    assert uv[70, 1] - uv[200, 1] == pytest.approx(target[70, 1] - target[200, 1], abs=1e-9)
    assert abs(uv[40, 1] - uv[120, 1] - (target[40, 1] - target[120, 1])) > 1e-6


def test_what_cannot_be_moved_says_so(bump):
    uv = bump[0][:, :2]
    pinned = np.zeros(len(uv), bool)
    session = Unwrapper([Shape(*bump)], Settings(boundary="CIRCLE"))
    with pytest.raises(errors.PinError, match="boundary"):
        session.move(pinned, uv)
    session = Unwrapper([Shape(*bump), Shape(*shapes.tetrahedron())])
    with pytest.raises(errors.PinError, match="nothing to pin"):
        session.move(pinned, uv, shape=1)
    with pytest.raises(errors.PinError, match="True or False"):
        session.move(pinned[:5], uv)
    with pytest.raises(errors.UVError):
        session.move(~pinned, uv * np.nan)
    steps(session)
    assert only_good(session) == [True, False]


def only_good(session):
    return [not isinstance(result, UnwrapError) for result in session.results()]


@pytest.mark.parametrize("after", [0, 1, 3, 100])
def test_cancelled_it_holds_nothing_back(bump, after):
    session = Unwrapper([Shape(*bump)])
    for _ in range(after):
        session.step()
    held = weakref.ref(session._course), weakref.ref(session._course.batch.surface)
    session.cancel()
    gc.collect()
    assert [each() for each in held] == [None, None]
    assert not session.step() and session.state() is None
    with pytest.raises(UnwrapError, match="cancelled"):
        session.results()


def test_parts_of_steps_are_yielded_and_are_no_steps(bump):
    whole, inner = Unwrapper([Shape(*bump)]), Unwrapper([Shape(*bump)])
    steps = 0
    while whole.step():
        steps += 1
    yielded = list(inner.parts())
    assert yielded.count(STEP) == steps and yielded.count(PART) >= steps
    np.testing.assert_array_equal(inner.results()[0].uv, whole.results()[0].uv)


@pytest.mark.parametrize("way", ["closed", "failed"])
def test_a_run_that_ends_half_way_holds_nothing_back(bump, monkeypatch, way):
    held, original = [], Unwrapper.parts

    def parts(session):
        for part in original(session):
            if session._course is not None:
                held.append(weakref.ref(session._course))
                if way == "failed" and len(held) > 2:
                    raise ZeroDivisionError
            yield part

    monkeypatch.setattr(Unwrapper, "parts", parts)
    vertices, triangles = bump[0].copy(), bump[1].copy()
    run = unwrap_islands([Shape(vertices, triangles)])
    if way == "closed":
        for _ in range(3):
            next(run)
        run.close()
    else:
        for _ in run:
            pass
    del run
    gc.collect()
    assert held and not any(each() for each in held)
    np.testing.assert_array_equal(vertices, bump[0])
    np.testing.assert_array_equal(triangles, bump[1])


def test_stages_can_be_had_alone(bump):
    for boundary in ("FREE", "CIRCLE"):
        start = unwrap(*bump, Settings(boundary=boundary, iterations=0, refine=0))
        assert start.report.iterations == 0
        iterated = unwrap(*bump, Settings(boundary=boundary, refine=0, iterations=12))
        refined = unwrap(*bump, Settings(boundary=boundary, iterations=0))
        both = unwrap(*bump, Settings(boundary=boundary))
        ends = [energy(bump, result.uv, 0.25) for result in (start, iterated, refined, both)]
        assert ends[0] > ends[1] > ends[2] == pytest.approx(ends[3], rel=1e-3)
        again = unwrap(*bump, Settings(boundary=boundary, initial="CURRENT", iterations=0, refine=1), both.uv)
        assert again.report.iterations == 1, "relax what there is"
        assert energy(bump, again.uv, 0.25) == pytest.approx(ends[3], rel=1e-3)
