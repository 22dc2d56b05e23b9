# SPDX-License-Identifier: GPL-3.0-or-later
import dataclasses
import itertools
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qh_unwrap.core import Settings, Surface, UnwrapError, distortion, errors, locality, unwrap, unwrap_steps
from qh_unwrap.core import triangles as arithmetic
from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.course import Course
from qh_unwrap.core.distortion import measure
from qh_unwrap.core.initial import fit
from qh_unwrap.core.stepping import finished, mapped

from . import shapes
from .test_tensor import seeds

ALL = {
    field.name: [choice.identifier for choice in field.metadata["choices"]] for field in dataclasses.fields(Settings)
}
HELD = [name for name in ALL["boundary"] if name != "FREE"]
PINS = ("no pins", "inner pins", "four corners")


def ellipse_uv(vertices):
    x, y, _ = vertices.T
    return np.column_stack([1.5 * x + 0.2 * y, 0.9 * y + 0.1 * x * x])


def pins(kind, surface_vertices, seed=0):
    n = len(surface_vertices)
    if kind == "no pins":
        return None
    chosen = np.zeros(n, bool)
    # random_disk lists the inner vertices first, then the rim.
    chosen[[3, 20] if kind == "inner pins" else [n - 1, n - 7, n - 13, n - 19]] = True
    return chosen


def refusal(initial, boundary, weights, pin, has_uv):
    """The error that a combination must raise, or None."""
    if not has_uv and initial == "CURRENT" and not (boundary == "FREE" and weights != "COTANGENT"):
        return errors.UVError
    if boundary in ("CIRCLE", "OUTLINE") and pin != "no pins":
        return errors.PinError
    if boundary == "RECTANGLE" and pin == "inner pins":
        return errors.PinError
    if boundary == "FREE" and weights != "COTANGENT":
        return errors.SettingsError
    if not has_uv and boundary == "FREE" and pin != "no pins":
        return errors.UVError
    if not has_uv and boundary == "KEEP":
        return errors.UVError
    return None


@pytest.mark.parametrize(
    "initial, boundary, weights, pin, has_uv",
    list(itertools.product(ALL["initial"], ALL["boundary"], ALL["weights"], PINS, (True, False))),
)
def test_every_combination_works_or_is_refused(initial, boundary, weights, pin, has_uv):
    vertices, triangles = shapes.bump(11)
    uv = ellipse_uv(vertices) if has_uv else None
    pinned = pins(pin, vertices)
    settings = Settings(initial=initial, boundary=boundary, weights=weights, iterations=8, refine=2)
    error = refusal(initial, boundary, weights, pin, has_uv)
    if error:
        with pytest.raises(error) as caught:
            unwrap(vertices, triangles, settings, uv, pinned)
        assert ":" in str(caught.value)  # says what to do
        return
    result = unwrap(vertices, triangles, settings, uv, pinned)
    assert result.uv.shape == (len(vertices), 2) and np.isfinite(result.uv).all()
    assert 1 <= result.report.iterations <= 10 and result.report.after.symmetric_dirichlet < 4
    assert (result.report.before is not None) == has_uv
    if pin != "inner pins" or weights == "COTANGENT":  # pins in the middle undo the other schemes' guarantee
        assert result.report.after.flips == result.report.after.collapsed == 0
    if boundary == "KEEP":
        rim = np.arange(len(vertices)) >= 80
        held = rim if pinned is None else rim | pinned
        np.testing.assert_array_equal(result.uv[held], uv[held])
    elif boundary == "FREE" and pinned is not None:
        np.testing.assert_array_equal(result.uv[pinned], uv[pinned])
    else:
        assert result.uv.min() >= -0.021 and result.uv.max() <= 1.021  # a bowed side bulges


@given(seeds, st.floats(1e-6, 1e6), st.sampled_from(HELD), st.sampled_from(ALL["weights"]))
def test_similarities_do_not_change_the_result(seed, scale, boundary, weights):
    vertices, triangles = shapes.bump(seed)
    uv = ellipse_uv(vertices)
    settings = Settings(boundary=boundary, weights=weights)
    expected = unwrap(vertices, triangles, settings, uv).uv
    moved = scale * (vertices @ shapes.rotation(seed).T + [3, -2, 1])
    np.testing.assert_allclose(unwrap(moved, triangles, settings, uv).uv, expected, atol=1e-9)


@given(seeds, st.sampled_from(HELD), st.sampled_from(ALL["initial"]))
def test_the_numbering_does_not_change_the_result(seed, boundary, initial):
    vertices, triangles = shapes.bump(seed)
    uv = ellipse_uv(vertices)
    settings = Settings(boundary=boundary, initial=initial)
    expected = unwrap(vertices, triangles, settings, uv).uv
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(vertices))  # new number k is old vertex order[k]
    number = np.argsort(order)
    shuffled = np.roll(number[triangles], rng.integers(3), axis=1)[rng.permutation(len(triangles))]
    result = unwrap(vertices[order], shuffled, settings, uv[order]).uv
    # A rectangle's first corner is a matter of numbering: compare up to a rotation of the whole.
    everywhere = np.ones(len(uv), bool)
    np.testing.assert_allclose(fit(result, everywhere, expected[order]), expected[order], atol=1e-9)


@given(seeds)
def test_an_isometry_is_a_fixed_point(seed):
    vertices, triangles = shapes.random_disk(seed)
    uv = 0.3 * vertices[:, :2] @ [[0.6, 0.8], [-0.8, 0.6]] + 1
    for weights in ("COTANGENT", "MEAN_VALUE", "MEAN_VALUE_SCALAR"):
        settings = Settings(boundary="KEEP", initial="CURRENT", weights=weights, iterations=3, tolerance=0, refine=0)
        np.testing.assert_allclose(unwrap(vertices, triangles, settings, uv).uv, uv, atol=1e-12)


@given(seeds)
def test_balance_one_is_the_harmonic_map_in_one_step(seed):
    vertices, triangles = shapes.bump(seed)
    one_step = unwrap(
        vertices,
        triangles,
        Settings(boundary="CIRCLE", balance=1, iterations=1, initial="UNIFORM", repair=False, refine=0),
    )
    harmonic = unwrap(vertices, triangles, Settings(boundary="CIRCLE", iterations=0, initial="HARMONIC", refine=0))
    np.testing.assert_allclose(one_step.uv, harmonic.uv, atol=1e-12)


@pytest.mark.parametrize("balance", [0.25, 0.5])
@pytest.mark.parametrize("boundary", ["CIRCLE", "KEEP"])
def test_every_start_has_the_same_limit(balance, boundary):
    vertices, triangles = shapes.hemisphere(flattening=1.5)
    current = vertices[:, :2] * [1.3, 1.0]
    limits = [
        unwrap(
            vertices,
            triangles,
            Settings(boundary=boundary, initial=initial, balance=balance, iterations=200, tolerance=1e-9, refine=0),
            current,
        )
        for initial in ALL["initial"]
    ]
    assert all(result.report.converged for result in limits)
    for result in limits[1:]:
        np.testing.assert_allclose(result.uv, limits[0].uv, atol=1e-6)


def test_a_folded_start_corrects_itself():
    vertices, triangles = shapes.hemisphere(12)
    uv = vertices[:, :2].copy()
    inner = np.linalg.norm(uv, axis=1) < 0.9
    uv[inner] = np.abs(uv[inner]) ** 1.5  # folded twice
    settings = Settings(boundary="KEEP", balance=0.5, iterations=8, tolerance=0, refine=0)
    assert distortion(vertices, triangles, uv).flips > 100
    folded = unwrap(vertices, triangles, dataclasses.replace(settings, initial="CURRENT"), uv)
    harmonic = unwrap(vertices, triangles, dataclasses.replace(settings, initial="HARMONIC"), uv)
    assert folded.report.after.flips == 0
    assert np.abs(folded.uv - harmonic.uv).max() < 1e-3 * 2 * np.sqrt(2)


def test_iteration_lowers_stretch_and_stops_when_it_no_longer_changes():
    vertices, triangles = shapes.hemisphere(10, flattening=2)
    report = unwrap(vertices, triangles, Settings(boundary="CIRCLE", iterations=100, tolerance=1e-4, refine=0)).report
    assert report.converged and report.iterations < 100
    assert report.changes[-1] <= 1e-4 < report.changes[-2]
    start = unwrap(vertices, triangles, Settings(boundary="CIRCLE", iterations=0, refine=0)).report
    assert report.after.symmetric_dirichlet < start.after.symmetric_dirichlet
    unfinished = unwrap(vertices, triangles, Settings(boundary="CIRCLE", iterations=2, tolerance=1e-4, refine=0)).report
    assert not unfinished.converged and unfinished.iterations == len(unfinished.changes) == 2


def test_steps_show_every_iteration_and_can_be_abandoned():
    vertices, triangles = shapes.hemisphere()
    steps = unwrap_steps(vertices, triangles, Settings(boundary="CIRCLE", iterations=4, tolerance=0, refine=0))
    start, first = next(steps), next(steps)
    assert start.iteration == 0 and first.iteration == 1
    assert first.uv.shape == (len(vertices), 2) and 0 < first.change < 1
    steps.close()
    steps = unwrap_steps(vertices, triangles, Settings(boundary="CIRCLE", iterations=4, tolerance=0, refine=0))
    seen = []
    result = finished(mapped(seen.append, steps))
    assert [state.iteration for state in seen] == [0, 1, 2, 3, 4]
    np.testing.assert_array_equal(seen[-1].uv, result.uv)


def rough(seed):
    """A rugged patch of thin, obtuse triangles: plain cotangent weights flip some of them."""
    vertices, triangles = shapes.random_disk(seed, inner=400, outer=40)
    vertices[:, 1] *= 0.3
    vertices[:, 2] = 0.6 * np.random.default_rng(seed).random(len(vertices)) ** 3
    return vertices, triangles


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("balance", [0.25, 0.5])
def test_repair_turns_flipped_triangles_back(seed, balance):
    vertices, triangles = rough(seed)
    plain = unwrap(vertices, triangles, Settings(boundary="CIRCLE", repair=False, balance=balance, refine=0))
    assert plain.report.after.flips > 0
    repaired = unwrap(vertices, triangles, Settings(boundary="CIRCLE", balance=balance, refine=0))
    assert repaired.report.after.flips == repaired.report.after.collapsed == 0


def test_holes_are_filled_or_free():
    vertices, triangles = shapes.ring(24, 4)
    vertices[:, 2] = vertices[:, 0] ** 2
    for fill in (True, False):
        for weights in ("COTANGENT", "MEAN_VALUE"):
            result = unwrap(vertices, triangles, Settings(boundary="CIRCLE", fill_holes=fill, weights=weights))
            assert result.uv.shape == (len(vertices), 2)
            assert result.report.after.flips == 0 and result.report.after.symmetric_dirichlet < 1.1


def test_zero_area_faces_are_survived_with_a_warning():
    vertices, triangles = shapes.bump(3)
    a, b, c = triangles[np.flatnonzero((triangles < 80).all(axis=1))[0]]
    vertices[c] = (vertices[a] + vertices[b]) / 2
    for weights in ALL["weights"]:
        for initial in ALL["initial"]:
            settings = Settings(boundary="CIRCLE", weights=weights, initial=initial)
            result = unwrap(vertices, triangles, settings, ellipse_uv(vertices))
            assert np.isfinite(result.uv).all() and result.report.after.l2_stretch < 10
            assert any("zero area" in warning for warning in result.report.warnings)


def test_mirrored_uvs_stay_mirrored():
    vertices, triangles = shapes.bump(5)
    uv = ellipse_uv(vertices)
    settings = Settings(boundary="KEEP")
    expected = unwrap(vertices, triangles, settings, uv)
    mirrored = unwrap(vertices, triangles, settings, uv * [-1, 1])
    assert mirrored.report.mirrored and not expected.report.mirrored
    np.testing.assert_allclose(mirrored.uv * [-1, 1], expected.uv, atol=1e-12)
    assert mirrored.report.after.flips == 0


def test_smallest_surfaces():
    for boundary in ("CIRCLE", "OUTLINE"):
        result = unwrap(np.eye(3), [[0, 1, 2]], Settings(boundary=boundary))
        assert result.report.after.symmetric_dirichlet == pytest.approx(1)
    vertices, triangles = shapes.grid(1, 1)
    assert unwrap(vertices, triangles, Settings(boundary="RECTANGLE")).report.after.l2_stretch == pytest.approx(1)


@pytest.mark.parametrize("boundary", HELD)
def test_surfaces_with_nothing_but_an_outline(boundary):
    vertices, triangles = shapes.grid(8, 1, width=8)
    vertices[:, 2] = 0.3 * np.sin(vertices[:, 0])
    result = unwrap(vertices, triangles, Settings(boundary=boundary), vertices[:, :2] * [1, 2])
    assert np.isfinite(result.uv).all() and result.report.after.flips == 0


def test_everything_pinned_stays():
    vertices, triangles = shapes.bump(1)
    uv = ellipse_uv(vertices)
    result = unwrap(vertices, triangles, Settings(boundary="KEEP"), uv, np.ones(len(uv), bool))
    np.testing.assert_array_equal(result.uv, uv)


def test_refusals_name_the_cure():
    vertices, triangles = shapes.bump(1)
    for settings in (
        dict(weights="MEAN_VALUE", balance=0.6),
        dict(weights="MEAN_VALUE_SCALAR", balance=1),
    ):
        with pytest.raises(errors.SettingsError, match="lower it"):
            unwrap(vertices, triangles, Settings(boundary="CIRCLE", **settings))
    for pinned in (np.zeros(3, bool), np.zeros(len(vertices))):
        with pytest.raises(errors.PinError):
            unwrap(vertices, triangles, pinned=pinned)


@pytest.mark.parametrize(
    "name, value",
    [
        ("balance", 1.5),
        ("balance", float("nan")),
        ("weights", "COT"),
        ("iterations", -1),
        ("iterations", 2.5),
        ("repair", 3),
    ],
)
def test_settings_refuse_values_out_of_range(name, value):
    with pytest.raises(errors.SettingsError, match=name):
        Settings(**{name: value})


def test_settings_defaults_are_in_range_and_described():
    Settings()
    for field in dataclasses.fields(Settings):
        assert field.metadata["label"] and field.metadata["description"]
        assert not field.metadata["description"].endswith(".")


def test_the_report_is_plain_data():
    vertices, triangles = shapes.bump(1)
    report = unwrap(vertices, triangles, Settings(boundary="CIRCLE"), ellipse_uv(vertices)).report
    again = json.loads(json.dumps(report.to_dict()))
    assert again["after"]["l2_stretch"] == report.after.l2_stretch
    assert again["iterations"] == len(again["changes"])
    assert issubclass(UnwrapError, ValueError)


def test_work_on_parts_changes_nothing(monkeypatch):
    mesh = shapes.bump(6, inner=200, outer=40)
    whole = unwrap(*mesh)
    monkeypatch.setattr(arithmetic, "_AT_ONCE", 7)
    parts = unwrap(*mesh)
    np.testing.assert_allclose(parts.uv, whole.uv, rtol=0, atol=1e-12)
    assert parts.report.after.to_dict() == pytest.approx(whole.report.after.to_dict(), rel=1e-9)


def test_large_meshes_are_sorted_and_their_results_put_back(monkeypatch):
    vertices, triangles = shapes.bump(8, inner=300, outer=60)
    uv = vertices[:, :2] * [1.5, 1]
    pinned = np.zeros(len(uv), bool)
    pinned[[3, 50]] = True
    plain = unwrap(vertices, triangles, Settings(), uv, pinned)
    monkeypatch.setattr(locality, "MANY", 100)
    steps = unwrap_steps(vertices, triangles, Settings(), uv, pinned)
    start = next(steps)
    np.testing.assert_array_equal(start.uv[pinned], uv[pinned])
    result = unwrap(vertices, triangles, Settings(), uv, pinned)
    np.testing.assert_allclose(result.uv, plain.uv, atol=1e-3)
    np.testing.assert_array_equal(result.uv[pinned], uv[pinned])
    surface = Surface(vertices, triangles)
    for loop, other in zip(result.loops, surface.loops, strict=True):
        assert set(loop) == set(other) and is_injective(result.uv, triangles, [loop])
    for measured, of in ((result.report.before, uv), (result.report.after, result.uv)):
        for name in ("triangle_stretch", "triangle_angle", "triangle_log_area", "triangle_orientation"):
            np.testing.assert_allclose(
                getattr(measured, name), getattr(measure(surface, of), name), rtol=1e-9, atol=1e-9
            )
    with pytest.raises(errors.DuplicateError) as raised:
        unwrap(vertices, np.vstack([triangles, triangles[7, [1, 2, 0]]]))
    assert raised.value.triangles[0] in (7, len(triangles))
    with pytest.raises(errors.UVError):
        unwrap(vertices, triangles, Settings(), uv[:-1])


@pytest.mark.parametrize("initial", ["RINGS", "CONFORMAL", "MEAN_VALUE"])
def test_a_map_without_flips_is_never_given_up_for_one_with_flips(initial, monkeypatch):
    """Whatever fails on the way: here every map that is found is turned inside out in one place."""
    vertices, triangles = shapes.bump(3)
    uv = vertices[:, :2] / 4 + 0.5
    pinned = np.arange(len(vertices)) >= 80
    inner = np.arange(len(vertices)) == 10
    spoilt = Course._free

    def spoil(self):
        yield from spoilt(self)
        self.best[inner] += 100

    monkeypatch.setattr(Course, "_free", spoil)
    result = unwrap(vertices, triangles, Settings(initial=initial), uv, pinned)
    np.testing.assert_array_equal(result.uv, uv)
    assert result.report.injective and "stay as they were" in result.report.warnings[0]
    start = unwrap(vertices, triangles, Settings(initial=initial, iterations=0, refine=0), uv, pinned)
    assert not np.array_equal(start.uv, uv), "a start that is asked for stays, whatever it is"
