# SPDX-License-Identifier: GPL-3.0-or-later
"""The published measures beside a second computation, triangle by triangle, from their printed formulas."""

import math

import numpy as np
import pytest

from qh_unwrap.core.published import published, published_of_islands

from . import shapes


def second_opinion(points, uv):
    """The same measures from the formulas in docs/checking.md, in plain Python and by NumPy's own decomposition."""
    jacobians, in_space, in_map, signs, angles = [], [], [], [], []
    for (p, q, r), flat in zip(points, uv, strict=True):
        first = (q - p) / np.linalg.norm(q - p)
        normal = np.cross(q - p, r - p)
        second = np.cross(normal / np.linalg.norm(normal), first)
        frame = np.array([[first @ (q - p), first @ (r - p)], [second @ (q - p), second @ (r - p)]])
        edges = np.array([flat[1] - flat[0], flat[2] - flat[0]]).T
        jacobians.append(edges @ np.linalg.inv(frame))
        in_space.append(np.linalg.norm(normal) / 2)
        signs.append(np.linalg.det(edges))
        in_map.append(abs(np.linalg.det(edges)) / 2)
        angles.append(sum(abs(a - b) for a, b in zip(_angles((p, q, r)), _angles(flat), strict=True)))
    total, total_in_map = math.fsum(in_space), math.fsum(in_map)
    areas, map_areas = np.array(in_space) / total, np.array(in_map) / total_in_map
    scaled = np.array([np.linalg.svd(J)[1] for J in jacobians]) * math.sqrt(total / total_in_map)
    box = np.ptp(uv.reshape(-1, 2), axis=0).max()
    flipped = sum(sign < 0 for sign in signs) / len(signs)
    return dict(
        max_area_distortion=max(a / b + b / a for a, b in zip(areas, map_areas, strict=True)) - 2,
        average_area_discrepancy=math.fsum(abs(areas - map_areas)),
        max_angle_distortion=max(s / t + t / s for s, t in scaled) - 2,
        average_angle_discrepancy=math.fsum(areas * angles),
        min_singular_value=scaled.min(),
        max_singular_value=scaled.max(),
        proportion_flipped=min(flipped, 1 - flipped),
        resolution=max(1 / np.linalg.svd(J / box)[1].min() for J in jacobians),
        symmetric_dirichlet_energy=math.fsum(areas * (scaled**2 + scaled**-2).sum(axis=1)) / 2,
    )


def _angles(corners):
    """By the law of cosines."""
    for k in range(3):
        a, b, c = (np.linalg.norm(corners[i] - corners[j]) for i, j in ((k - 2, k - 1), (k, k - 1), (k, k - 2)))
        yield math.acos(max(-1, min(1, (b * b + c * c - a * a) / (2 * b * c))))


def _meshes():
    for seed in range(3):
        vertices, triangles = shapes.bump(seed)
        yield vertices * (1 + seed), triangles, vertices[:, :2] * (2, 1) + 0.1 * np.sin(5 * vertices[:, :2])
    vertices, triangles = shapes.hemisphere(5)
    yield vertices, triangles, np.random.default_rng(0).random((len(vertices), 2))  # half of it flipped
    vertices, triangles = shapes.strip(9, 30, 1.0)
    yield vertices, triangles, -vertices[:, :2] * (1, 0.3) + vertices[:, :2] ** 2


@pytest.mark.parametrize("mesh", range(5))
def test_they_agree_with_the_printed_formulas(mesh):
    vertices, triangles, uv = list(_meshes())[mesh]
    points, corners = vertices[triangles], uv[triangles]
    assert published(points, corners).to_dict() == pytest.approx(second_opinion(points, corners), rel=1e-9, abs=1e-12)


def test_an_isometry_is_ideal():
    vertices, triangles = shapes.grid(3, 3)
    found = published(5 * vertices[triangles], vertices[triangles][..., :2])
    ideal = dict.fromkeys(found.to_dict(), 0) | dict(
        min_singular_value=1, max_singular_value=1, symmetric_dirichlet_energy=2, resolution=5
    )
    assert found.to_dict() == pytest.approx(ideal, abs=1e-12)


def test_what_is_collapsed_is_infinite_and_what_is_nothing_is_left_out():
    vertices, triangles = shapes.grid(3, 3)
    points, uv = vertices[triangles], vertices[triangles][..., :2].copy()
    points[3] = points[3, 0]
    without = np.arange(len(points)) != 3
    assert published(points, uv) == published(points[without], uv[without])
    uv[5] = uv[5, 0]
    found = published(points, uv)
    assert found.max_angle_distortion == found.max_area_distortion == found.resolution == np.inf
    assert found.min_singular_value == 0 and np.isfinite(found.average_angle_discrepancy)
    assert published(points, 0 * uv) is None


def test_islands_are_measured_each_as_if_alone():
    meshes = list(_meshes())[:3]
    points = [vertices[triangles] for vertices, triangles, _ in meshes]
    uvs = [uv[triangles] for _, triangles, uv in meshes]
    uvs[1] = 0 * uvs[1]
    island = np.repeat(np.arange(3), [len(each) for each in points])
    found = published_of_islands(np.concatenate(points), np.concatenate(uvs), island, 3)
    assert found.of(1) is None
    for k in (0, 2):
        assert found.of(k).to_dict() == pytest.approx(published(points[k], uvs[k]).to_dict(), rel=1e-12)
