# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qh_unwrap.core import distortion, errors
from qh_unwrap.core.distortion import measure_corners

from . import shapes
from .test_tensor import seeds


@given(seeds, st.floats(1e-3, 1e3), st.floats(0.2, 5))
def test_a_stretch_along_one_axis(seed, scale, ratio):
    vertices, triangles = shapes.random_disk(seed)
    measured = distortion(vertices, triangles, scale * vertices[:, :2] * [ratio, 1])
    # Free of scale the stretches are sqrt(ratio) and its inverse.
    assert measured.l2_stretch == pytest.approx(np.sqrt((ratio + 1 / ratio) / 2), rel=1e-9)
    assert measured.symmetric_dirichlet == pytest.approx((ratio + 1 / ratio) / 2, rel=1e-9)
    assert measured.angle == pytest.approx(max(ratio, 1 / ratio), rel=1e-9)
    assert measured.area == pytest.approx(0, abs=1e-9)
    assert measured.flips == measured.collapsed == 0


def test_two_halves_at_different_scale():
    vertices, triangles = shapes.grid(4, 4)
    uv = vertices[:, :2].copy()
    left = uv[:, 0] <= 0.5
    uv[left, 0] *= 3  # areas 3 : 1, so relative to their mean 3/2 and 1/2
    uv[~left, 0] += 1
    measured = distortion(vertices, triangles, uv)
    half = np.log(1.5), np.log(0.5)
    assert measured.area == pytest.approx(np.sqrt((half[0] ** 2 + half[1] ** 2) / 2), rel=1e-9)
    assert sorted(set(np.round(measured.triangle_log_area, 9))) == sorted(np.round(half, 9))


def test_flips_and_collapses_are_counted_against_the_winding():
    vertices, triangles = shapes.grid(4, 4)
    uv = vertices[:, :2].copy()
    assert distortion(vertices, triangles, uv * [-1, 1]).flips == len(triangles)
    a, b, c = triangles[9]
    uv[c] = uv[a] + uv[b] - uv[c]
    measured = distortion(vertices, triangles, uv)
    assert measured.triangle_orientation[9] == -1 and measured.flips >= 1
    uv[c] = uv[a]
    measured = distortion(vertices, triangles, uv)
    assert measured.triangle_orientation[9] == 0 and measured.collapsed >= 1
    assert np.isfinite(measured.l2_stretch)


def test_bad_uvs_are_refused():
    vertices, triangles = shapes.grid()
    with pytest.raises(errors.UVError):
        distortion(vertices, triangles, np.zeros((3, 2)))
    with pytest.raises(errors.UVError):
        distortion(vertices, triangles, np.full((len(vertices), 2), np.nan))


def test_any_uvs_are_measured_island_by_island():
    islands = [shapes.random_disk(seed) for seed in range(3)]
    maps = [vertices[:, :2] * [k + 1, 1] + 0.1 * np.sin(3 * vertices[:, :2]) for k, (vertices, _) in enumerate(islands)]
    maps[1] *= [-5, 5]  # mirrored, and larger than the others
    points, uv = (
        np.concatenate([values[triangles] for values, (_, triangles) in zip(each, islands, strict=True)])
        for each in ([vertices for vertices, _ in islands], maps)
    )
    island = np.repeat(np.arange(3), [len(triangles) for _, triangles in islands])
    measured, whole, mirrored, *_ = measure_corners(points, uv, island)
    seen = np.where(mirrored[island, None, None], (-1, 1), 1) * uv
    assert whole.to_dict() == pytest.approx(measure_corners(points, seen).whole.to_dict(), rel=1e-9)
    assert mirrored.tolist() == [False, True, False]
    maps[1] = maps[1] * [-1, 1]
    for its, (vertices, triangles), of_map in zip(measured, islands, maps, strict=True):
        expected = distortion(vertices, triangles, of_map)
        assert its.to_dict() == pytest.approx(expected.to_dict(), rel=1e-9)
        assert its.triangle_stretch == pytest.approx(expected.triangle_stretch, rel=1e-9)
        assert its.triangle_log_area == pytest.approx(expected.triangle_log_area, abs=1e-9)


def test_any_uvs_are_measured_where_nothing_hangs_together():
    vertices, triangles = shapes.grid(4, 4)
    points, uv = vertices[triangles], vertices[triangles][..., :2].copy()
    uv[7] = uv[7, ::-1]
    uv[9] = uv[9, 0]
    points[11] = points[11, 0]
    (measured,), *_ = measure_corners(points, uv)
    assert measured.triangle_orientation.tolist().index(-1) == 7 and measured.flips == 1
    assert measured.triangle_orientation.tolist().index(0) == 9 and measured.collapsed == 1
    assert np.isfinite(measured.l2_stretch)


def test_an_island_without_area_in_space_is_measured_as_nothing():
    vertices, triangles = shapes.grid(2, 2)
    (nothing,), *_ = measure_corners(np.zeros((len(triangles), 3, 3)), vertices[triangles][..., :2])
    assert nothing.flips == nothing.collapsed == nothing.l2_stretch == 0


def test_any_uvs_that_are_no_numbers_are_refused():
    vertices, triangles = shapes.grid(2, 2)
    with pytest.raises(errors.UVError):
        measure_corners(vertices[triangles], np.full((len(triangles), 3, 2), np.nan))
    with pytest.raises(errors.ShapeError):
        measure_corners(vertices[triangles], np.zeros((3, 3, 2)))
