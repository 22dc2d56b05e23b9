# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qh_unwrap.core import Surface
from qh_unwrap.core.tensor import jacobian, plane_tensor, scalar_tensor, surface_tensor
from qh_unwrap.core.triangles import signed_areas
from qh_unwrap.core.weights import cotangent

from . import shapes

unit = st.floats(0, 1)
powers = st.floats(0.05, 2)
seeds = st.integers(0, 10**6)
settings.register_profile("core", deadline=None, derandomize=True, max_examples=30)
settings.load_profile("core")


def deformed(seed, strength=0.5):
    """A surface and an irregular map of it without flips."""
    vertices, triangles = shapes.bump(seed)
    x, y, _ = vertices.T
    uv = np.column_stack([x + 0.3 * strength * np.sin(2 * y) + 0.2 * y, 0.6 * y + 0.2 * strength * x * x])
    return Surface(vertices, triangles), uv


@given(seeds, unit, powers)
def test_isometries_and_similarities_give_the_identity(seed, balance, power):
    vertices, triangles = shapes.random_disk(seed)
    turn = shapes.rotation(seed)
    surface = Surface(7 * vertices @ turn.T + 3, triangles)
    uv = 0.01 * vertices[:, :2] @ [[0.6, 0.8], [-0.8, 0.6]] + 5
    identity = np.array([[1.0], [1.0], [0.0]]) * np.ones(len(triangles))
    np.testing.assert_allclose(surface_tensor(surface, uv, balance, power), identity, atol=1e-9)
    np.testing.assert_allclose(plane_tensor(surface, uv, balance, power), identity, atol=1e-9)


@given(seeds, unit, powers)
def test_the_operator_on_the_surface_equals_that_on_the_plane(seed, balance, power):
    surface, uv = deformed(seed)
    on_surface = cotangent(surface, surface_tensor(surface, uv, balance, power))[0]
    on_plane = cotangent(surface, plane_tensor(surface, uv, balance, power), uv[surface.triangles])[0]
    np.testing.assert_allclose(on_surface, on_plane, rtol=1e-9, atol=1e-10 * np.abs(on_plane).max())


def matrix_power(matrix, exponent):
    values, vectors = np.linalg.eigh(matrix)
    return vectors @ np.diag(values**exponent) @ vectors.T


@pytest.mark.parametrize("balance, power", [(0.5, 1), (0.25, 1), (0, 1), (1, 1), (0.4, 0.7)])
def test_the_plane_tensor_is_the_first_fundamental_form_to_a_power(balance, power):
    surface, uv = deformed(1)
    J = np.linalg.inv(jacobian(surface, uv).transpose(2, 0, 1))
    scale = signed_areas(uv[surface.triangles]).sum()  # the surface's area is 1
    for k in range(0, len(J), 17):
        form = J[k].T @ J[k] * scale
        expected = matrix_power(np.linalg.det(form) ** (balance - 0.5) * matrix_power(form, -balance), power)
        a, b, c = plane_tensor(surface, uv, balance, power)[:, k]
        np.testing.assert_allclose([[a, c], [c, b]], expected, rtol=1e-9)
        assert scalar_tensor(surface, uv, balance, power)[k] == pytest.approx(np.sqrt(np.linalg.det(expected)))


def test_balance_one_is_the_laplacian_of_the_surface_whatever_the_map():
    surface, uv = deformed(2)
    np.testing.assert_allclose(cotangent(surface, surface_tensor(surface, uv, 1)), cotangent(surface), atol=1e-12)


def test_collapsed_triangles_give_finite_positive_tensors():
    surface, uv = deformed(4)
    for bad in (np.zeros_like(uv), np.ones_like(uv) * [1, 0] * uv, np.where(np.arange(len(uv))[:, None] % 3, uv, 0)):
        for balance in (0, 0.25, 0.5, 1):
            for tensor in (surface_tensor(surface, bad, balance), plane_tensor(surface, bad, balance)):
                assert np.isfinite(tensor).all()
                a, b, c = tensor
                assert (a * b - c * c > 0).all() and (a > 0).all()
