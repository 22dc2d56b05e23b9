# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qh_unwrap.core import distortion, errors

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
