# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of more importance get as much more room as they ask for, without flips."""

import numpy as np
import pytest

from qh_unwrap.core import Settings, Shape, errors, unwrap, unwrap_islands
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.triangles import areas_in_space, signed_areas

from . import shapes
from .overlaps import is_clean


def _meshes():
    return {
        "bump": shapes.bump(0, 600, 60),
        "hemisphere": shapes.hemisphere(10),
        "plane": shapes.grid(20, 20),
    }


def unwrapped(vertices, triangles, importance, settings=None, **others):
    (result,) = finished(unwrap_islands([Shape(vertices, triangles, importance=importance, **others)], settings))
    return result


def spot(vertices, triangles):
    """1 on the triangles of a region, 0 on others: by the weights of vertices, so that its rim lies between."""
    x, y, _ = vertices.T
    inside = (x - x.mean() + 0.3 * (y - y.mean()) > 0.1 * np.ptp(x)).astype(float)
    return inside[triangles].mean(axis=1)


def ratio(vertices, triangles, uv, weight):
    """The area in the map by that in space where the weight is 1, by the same where it is 0."""
    in_space, in_map = areas_in_space(vertices, triangles), signed_areas(uv[triangles])
    (more, in_space_more), (less, in_space_less) = (
        (in_map[weight == value].sum(), in_space[weight == value].sum()) for value in (1, 0)
    )
    return more / in_space_more / (less / in_space_less)


@pytest.mark.parametrize("name", _meshes())
@pytest.mark.parametrize("factor", [4.0, 0.25])
def test_a_region_becomes_as_much_larger_as_its_factor(name, factor):
    vertices, triangles = _meshes()[name]
    weight = spot(vertices, triangles)
    result = unwrapped(vertices, triangles, factor**weight)
    found = ratio(vertices, triangles, result.uv, weight)
    assert 3 < (found if factor > 1 else 1 / found) < 4.2
    assert result.report.injective and is_clean(result.uv, triangles)


@pytest.mark.parametrize("boundary", ["FREE", "CIRCLE"])
def test_importance_that_is_the_same_everywhere_changes_nothing(boundary):
    vertices, triangles = shapes.bump(1)
    settings = Settings(boundary=boundary)
    expected = unwrap(vertices, triangles, settings).uv
    for value in (1.0, 7.0):
        result = unwrapped(vertices, triangles, np.full(len(triangles), value), settings)
        assert np.array_equal(result.uv, expected)


def test_measures_are_beside_the_true_surface():
    vertices, triangles = shapes.grid(10, 10)
    weight = spot(vertices, triangles)
    result = unwrapped(vertices, triangles, 4.0**weight)
    assert result.report.after.area > 0.3 and result.report.after.symmetric_dirichlet > 1.05
    assert result.report.after.triangle_log_area[weight == 1].mean() > 0.3


def test_it_counts_in_the_iteration_without_refinement():
    vertices, triangles = shapes.hemisphere(8)
    weight = spot(vertices, triangles)
    plain, weighted = (
        unwrapped(vertices, triangles, importance, Settings(boundary="CIRCLE", refine=0))
        for importance in (None, 4.0**weight)
    )
    assert ratio(vertices, triangles, weighted.uv, weight) > 2 * ratio(vertices, triangles, plain.uv, weight)


def test_it_counts_where_a_map_is_relaxed():
    vertices, triangles = shapes.bump(2)
    weight = spot(vertices, triangles)
    start = unwrap(vertices, triangles).uv
    relax = Settings(initial="CURRENT", iterations=0)
    found = unwrapped(vertices, triangles, 4.0**weight, relax, uv=start)
    assert found.report.injective and ratio(vertices, triangles, found.uv, weight) > 3


def test_each_shape_has_its_own():
    meshes = list(_meshes().values())
    its = [4.0 ** spot(*meshes[0]), None, 4.0 ** spot(*meshes[2])]
    together = finished(unwrap_islands([Shape(*mesh, importance=each) for mesh, each in zip(meshes, its, strict=True)]))
    for result, mesh, importance in zip(together, meshes, its, strict=True):
        assert np.allclose(result.uv, unwrapped(*mesh, importance).uv, atol=1e-9)


@pytest.mark.parametrize("importance", [np.ones(3), np.array([np.nan]), np.array([0.0]), np.array([-1.0])])
def test_bad_importance_is_the_error_of_its_shape(importance):
    vertices, triangles = shapes.grid(2, 2)
    if len(importance) == 1:
        importance = np.append(np.ones(len(triangles) - 1), importance)
    bad, good = finished(
        unwrap_islands([Shape(vertices, triangles, importance=importance), Shape(vertices, triangles)])
    )
    assert isinstance(bad, errors.ShapeError) and good.report.injective


def test_large_meshes_that_are_sorted_have_theirs_at_the_right_triangles():
    vertices, triangles = shapes.grid(200, 200)
    weight = (vertices[:, 0] > 0.7).astype(float)[triangles].mean(axis=1)
    result = unwrapped(vertices, triangles, 2.0**weight, Settings(iterations=0, refine=1))
    assert ratio(vertices, triangles, result.uv, weight) > 1.2
