# SPDX-License-Identifier: GPL-3.0-or-later
"""Small inputs that once went wrong."""

import warnings

import numpy as np
import pytest

from qh_unwrap.core import Settings, Surface, Topology, distortion, errors, locality, unwrap
from qh_unwrap.core.air import make_air
from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.delaunay import triangulate

from . import shapes
from .overlaps import is_clean


def hill(across):
    """A bumpy grid over the unit square, and its projection."""
    vertices, triangles = shapes.grid(across, across)
    x, y, _ = vertices.T
    vertices[:, 2] = 0.3 * np.sin(3 * x) * np.cos(2 * y + 0.4) + 0.15 * np.exp(
        -((x - 0.5) ** 2 + (y - 0.4) ** 2) / 0.03
    )
    return vertices, triangles, vertices[:, :2].copy()


@pytest.mark.parametrize("across, moved, by", [(30, 30, (-0.026, 0.026)), (6, 6, (-0.13, 0.13)), (4, 4, (-0.3, 0.3))])
def test_an_inner_edge_may_lie_where_air_has_one(across, moved, by):
    """A flipped ear: its inner edge joins two vertices of the outline, and so does an edge of the air's."""
    vertices, triangles, uv = hill(across)
    uv[moved] += by
    assert distortion(vertices, triangles, uv).flips
    result = unwrap(vertices, triangles, Settings(initial="CURRENT"), uv)
    assert result.report.injective and is_clean(result.uv, triangles)


@pytest.mark.parametrize("by", [(-0.25, 0.25), (-0.1, 0.1), (-0.4, 0.1)])
def test_a_pinned_corner_may_be_dragged_past_its_diagonal(by):
    vertices, triangles, uv = hill(6)
    corners = [0, 6, 42, 48]
    uv[6] += by
    pinned = np.zeros(len(uv), bool)
    pinned[corners] = True
    result = unwrap(vertices, triangles, uv=uv, pinned=pinned)
    np.testing.assert_array_equal(result.uv[pinned], uv[pinned])
    assert result.report.injective == is_clean(result.uv, triangles)
    assert result.report.injective or result.report.after.flips


def test_a_dart_in_a_map_with_pins():
    """The two sides of the dart touch: there is no air between them."""
    vertices, triangles, uv = hill(12)
    dart = [6 * 13 + k for k in range(7)]
    above = (vertices[triangles].mean(axis=1)[:, 1] > vertices[dart[0], 1])[:, None]
    twin = {vertex: len(vertices) + k for k, vertex in enumerate(dart[:-1])}
    number = np.arange(len(vertices))
    number[list(twin)] = list(twin.values())
    cut = np.where(above, number[triangles], triangles)
    vertices, uv = (np.vstack([each, each[list(twin)]]) for each in (vertices, uv))
    pinned = np.zeros(len(uv), bool)
    pinned[[0, 12, 156, 168]] = True
    result = unwrap(vertices, cut, uv=uv, pinned=pinned)
    np.testing.assert_array_equal(result.uv[pinned], uv[pinned])
    assert result.report.after.flips == 0
    assert result.report.after.symmetric_dirichlet <= 1.001 * result.report.before.symmetric_dirichlet


def test_an_isometric_start_that_overlaps_itself_is_not_the_result():
    """Two turns of a flat stair: its projection is isometric in every triangle."""
    angle, across = np.meshgrid(np.linspace(0, 3.6 * np.pi, 90), np.linspace(1, 2, 5))
    _, triangles = shapes.grid(89, 4)
    flat = np.column_stack([(across * np.cos(angle)).ravel(), (across * np.sin(angle)).ravel(), 1e-9 * angle.ravel()])
    for initial in ("AUTO", "PROJECTION"):
        result = unwrap(flat, triangles[:, ::-1], Settings(initial=initial))
        assert result.report.injective and is_clean(result.uv, triangles[:, ::-1])


def test_an_isometric_start_with_a_flipped_spike_is_not_the_result():
    """A strip whose last, thin triangle is folded inward: hardly any area, and flipped."""
    vertices, triangles = shapes.grid(20, 2, width=10)
    side = np.flatnonzero(vertices[:, 0] == 10)[:2]
    tip = vertices[side].mean(axis=0) - [1e-3, 0, 0]
    vertices, triangles = np.vstack([vertices, tip]), np.vstack([triangles, [side[1], side[0], len(vertices)]])
    if Topology(triangles, len(vertices)).misaligned.any():
        triangles[-1] = triangles[-1, ::-1]
    uv = vertices[:, :2]
    assert distortion(vertices, triangles, uv).flips == 1
    result = unwrap(vertices, triangles, Settings(initial="CURRENT"), uv)
    assert result.report.injective and is_clean(result.uv, triangles)


def test_one_pin_keeps_size_and_turn_of_a_map_with_flips():
    vertices, triangles, uv = hill(8)
    uv = 0.1 * uv @ [[0.8, 0.6], [-0.6, 0.8]] + 0.4
    uv[[40, 41]] = uv[[41, 40]]
    pinned = np.zeros(len(uv), bool)
    pinned[20] = True
    assert distortion(vertices, triangles, uv).flips
    result = unwrap(vertices, triangles, uv=uv, pinned=pinned)
    np.testing.assert_array_equal(result.uv[20], uv[20])
    assert result.report.injective
    np.testing.assert_allclose(np.ptp(result.uv, axis=0), np.ptp(uv, axis=0), rtol=0.15)
    long_side = (result.uv[72] - result.uv[0]) @ (uv[72] - uv[0])
    assert long_side > 0.98 * np.linalg.norm(result.uv[72] - result.uv[0]) * np.linalg.norm(uv[72] - uv[0])


def test_a_folded_face_without_area_does_not_end_the_refinement():
    vertices, triangles, uv = hill(8)
    # Two vertices in one place: the faces between them have no area, and lie folded where the start swaps them.
    one, other = 40, 41
    vertices[other] = vertices[one]
    uv[other] = uv[one] + [1e-3, 0]
    uv[one] += [0.002, 0]
    start = distortion(vertices, triangles, uv)
    result = unwrap(vertices, triangles, Settings(initial="CURRENT", boundary="KEEP", iterations=0), uv)
    assert result.report.iterations > 1 and np.isfinite(result.uv).all()
    assert result.report.after.symmetric_dirichlet < start.symmetric_dirichlet


@pytest.mark.parametrize("name", ["iterations", "refine", "balance", "tolerance"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1])
def test_settings_that_are_no_numbers_are_refused(name, value):
    with pytest.raises(errors.SettingsError, match=name):
        Settings(**{name: value})


@pytest.mark.parametrize("bad", [[[0, 1, 10**6]], [[0, 1, -1]], [[0.0, 1.0, 2.0]], [0, 1, 2], np.zeros((0, 3), int)])
def test_bad_triangles_of_a_foreign_triangulator_are_refused(bad):
    vertices, triangles = shapes.bump(2, inner=60, outer=30, height=1.5)
    with pytest.raises(errors.BoundaryError, match="triangulator"):
        unwrap(vertices, triangles, Settings(initial="MEAN_VALUE"), triangulate=lambda *_: np.asarray(bad))
    uv = np.array([[0, 0], [1, 0], [0, 1.0]])
    with pytest.raises(errors.BoundaryError):
        make_air(uv, [np.arange(3)], lambda *_: np.asarray(bad))
    assert make_air(uv, [np.arange(3)], triangulate) is not None


def test_arrays_of_a_report_are_in_the_mesh_s_own_order(monkeypatch):
    vertices, triangles = shapes.bump(5)
    plain = unwrap(vertices, triangles).report.after
    monkeypatch.setattr(locality, "MANY", 10)
    large = unwrap(vertices, triangles).report.after
    arrays = [name for name, value in vars(plain).items() if isinstance(value, np.ndarray)]
    assert len(arrays) == 4
    for name in arrays:
        np.testing.assert_allclose(getattr(large, name), getattr(plain, name), rtol=1e-4, err_msg=name)


def test_an_outline_without_length_is_named():
    """A sphere of rings whose first and last are points: poles that are not merged."""
    around, along = 12, 8
    polar, angle = np.meshgrid(np.linspace(0, np.pi, along + 1), 2 * np.pi * np.arange(around) / around, indexing="ij")
    sphere = np.column_stack(
        [(np.sin(polar) * np.cos(angle)).ravel(), (np.sin(polar) * np.sin(angle)).ravel(), np.cos(polar).ravel()]
    )
    sphere[:around], sphere[-around:] = sphere[0], sphere[-1]
    k, i = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = k * around + i, k * around + (i + 1) % around
    corners = [each.ravel() for each in (a, a + around, b + around, b)]
    triangles = np.vstack(
        [np.column_stack([corners[c] for c in (0, 1, 2)]), np.column_stack([corners[c] for c in (0, 2, 3)])]
    )
    for boundary in ("FREE", "CIRCLE", "RECTANGLE", "OUTLINE"):
        with pytest.raises(errors.UnwrapError, match="merge"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            unwrap(sphere, triangles, Settings(boundary=boundary))


def test_touching_itself_is_not_certified():
    vertices, triangles, uv = hill(3)
    surface = Surface(vertices, triangles)
    assert is_injective(uv, triangles, surface.loops)
    uv[5] = uv[0]
    assert not is_injective(uv, triangles, surface.loops)
