# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from scipy.optimize import check_grad

from qh_unwrap.core import Settings, Surface, unwrap
from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.domain import Fixed, Held
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.untangling import _Bent, untangled

from . import borders, shapes


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", borders.KINDS)
def test_a_tangled_map_comes_out_without_flips_and_its_border_stays(kind, seed):
    vertices, triangles, uv, count = borders.tangled(kind, seed)
    result = unwrap(vertices, triangles, Settings(boundary="KEEP"), uv=uv)
    assert np.array_equal(result.uv[:count], uv[:count])
    assert result.report.injective
    assert is_injective(result.uv, triangles, [np.arange(count)])


def test_a_border_that_leaves_no_room_is_not_called_valid():
    # The corner's triangle has two sides on the border, which turns inward there.
    vertices, triangles = shapes.grid(4, 4)
    uv = vertices[:, :2].copy()
    ear = triangles[(np.bincount(triangles.ravel())[triangles] == 1).any(axis=1)][0]
    corner = ear[np.bincount(triangles.ravel())[ear] == 1][0]
    uv[corner] += 1.2 * (0.5 - uv[corner])
    report = unwrap(vertices, triangles, Settings(boundary="KEEP"), uv=uv).report
    assert not report.injective and report.after.flips


def test_pins_that_are_dragged_far_end_without_flips():
    vertices, triangles = shapes.bump(3, inner=400, outer=60)
    uv = unwrap(vertices, triangles).uv
    pinned = np.zeros(len(uv), bool)
    pinned[[0, 100, 200]] = True
    uv[0] += (0.35, -0.35)
    result = unwrap(vertices, triangles, uv=uv, pinned=pinned)
    assert result.report.injective
    assert np.array_equal(result.uv[pinned], uv[pinned])


def test_where_nothing_is_flipped_nothing_moves():
    vertices, triangles = shapes.bump(0)
    surface, uv = Surface(vertices, triangles), vertices[:, :2]
    domain = Held(surface, Fixed(np.zeros(uv.shape, bool), uv))
    map_, sound = finished(untangled(domain, uv))
    assert sound.all() and np.array_equal(map_, uv)


@pytest.mark.parametrize("bent", [1.0, 1e-2])
def test_the_bent_energys_derivatives_are_those_of_its_values(bent):
    vertices, triangles = shapes.bump(1, inner=20, outer=10)
    surface = Surface(vertices, triangles)
    uv = np.random.default_rng(1).random((len(vertices), 2))
    domain = Held(surface, Fixed(np.zeros(uv.shape, bool), uv))
    energy = _Bent(domain, uv, np.ones(1), np.array([bent]))

    def value(x):
        return energy.value(energy.jacobian(x.reshape(-1, 2)))[0]

    def gradient(x):
        by_corner = energy.gradient(energy.jacobian(x.reshape(-1, 2)))
        return np.array([np.bincount(energy.corners.ravel(), its.ravel(), len(uv)) for its in by_corner]).T.ravel()

    size = np.linalg.norm(gradient(uv.ravel()))
    assert check_grad(value, gradient, uv.ravel(), epsilon=1e-7) < 1e-4 * size
