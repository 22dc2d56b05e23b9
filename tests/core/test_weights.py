# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from qh_unwrap.core import Settings, Surface
from qh_unwrap.core.triangles import corner_angles, signed_areas
from qh_unwrap.core.weights import _appendix_a, cotangent, mean_value, scheme, uniform

from . import shapes
from .test_tensor import deformed, seeds

tensors = st.tuples(st.floats(0.1, 10), st.floats(0.1, 10), st.floats(-0.95, 0.95)).map(
    lambda abc: np.array([abc[0], abc[1], abc[2] * np.sqrt(abc[0] * abc[1])])
)


def residual(surface, weights, values):
    """The sum of w_ij (f_i - f_j) at every inner vertex, by the sum of |w_ij|."""
    i, j = surface.edges.T
    n = len(surface.vertices)
    total = np.bincount(i, weights[0] * (values[i] - values[j]), n)
    total += np.bincount(j, weights[1] * (values[j] - values[i]), n)
    size = np.bincount(i, abs(weights[0]), n) + np.bincount(j, abs(weights[1]), n)
    inner = np.ones(n, bool)
    for loop in surface.loops:
        inner[loop] = False
    return np.abs(total / size)[inner]


@given(seeds, tensors)
def test_constant_tensors_reproduce_linear_functions(seed, tensor):
    vertices, triangles = shapes.random_disk(seed)
    surface = Surface(vertices, triangles)
    flat = surface.vertices[:, :2]
    # The tensor in the frame of each triangle of `flat`, whose first axis runs along its longest edge.
    turn = np.linalg.solve(
        (surface.rest[:, 1:] - surface.rest[:, :1]), (flat[triangles][:, 1:] - flat[triangles][:, :1])
    )  # rows of flat coordinates times `turn` are rows of plane coordinates
    a, b, c = tensor
    local = np.einsum("mij,jk,mlk->mil", turn, np.array([[a, c], [c, b]]), turn)
    on_surface = np.array([local[:, 0, 0], local[:, 1, 1], local[:, 0, 1]])
    everywhere = tensor[:, None] * np.ones(len(triangles))
    linear = flat @ [2.0, -3.0] + 1
    for weights in (
        cotangent(surface),
        cotangent(surface, on_surface),
        mean_value(surface),
        mean_value(surface, everywhere, flat[triangles]),
        mean_value(surface, everywhere[0], flat[triangles]),
    ):
        assert residual(surface, weights, linear).max() < 1e-12


def test_cotangent_weights_are_cotangents():
    surface = Surface(*shapes.bump(5))
    cot = 1 / np.tan(corner_angles(surface.rest))
    expected = np.zeros(len(surface.edges))
    np.add.at(expected, surface.triangle_edges, np.roll(cot, -2, axis=1) / 2)
    np.testing.assert_allclose(cotangent(surface), [expected, expected], rtol=1e-9, atol=1e-12)


def test_equation_12_as_the_paper_writes_it():
    surface, _ = deformed(6)
    rng = np.random.default_rng(6)
    tensor = rng.random((3, len(surface.triangles))) + np.array([[1], [1], [0]])
    corners = surface.rest
    area = signed_areas(corners)
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    expected = np.zeros(len(surface.edges))
    for t, (a, b, c) in enumerate(tensor.T):
        for k in range(3):
            i, j, apex = corners[t, k], corners[t, (k + 1) % 3], corners[t, (k + 2) % 3]
            to_i, to_apex = quarter @ (i - apex), quarter @ (apex - j)
            expected[surface.triangle_edges[t, k]] -= to_i @ np.array([[a, c], [c, b]]) @ to_apex / (4 * area[t])
    np.testing.assert_allclose(cotangent(surface, tensor)[0], expected, rtol=1e-9, atol=1e-10)


@given(tensors, st.floats(0.02, 3.1))
def test_appendix_a_is_the_integral_of_the_flux(tensor, gamma):
    a, b, c = tensor

    def normal_part(phi):
        return a * np.cos(phi) ** 2 + b * np.sin(phi) ** 2 + 2 * c * np.sin(phi) * np.cos(phi)

    first, _ = quad(lambda phi: np.sin(gamma - phi) / np.sin(gamma) * normal_part(phi), 0, gamma)
    assert _appendix_a(a, b, c, np.sin(gamma), np.tan(gamma / 2)) == pytest.approx(first, rel=1e-9)
    # The other edge sees the triangle in a mirror: its frame runs along that edge, and its normal inwards.
    cos, sin = np.cos(gamma), np.sin(gamma)
    turned = np.array([[cos, sin], [sin, -cos]]) @ [[a, c], [c, b]] @ np.array([[cos, sin], [sin, -cos]])
    second, _ = quad(lambda phi: np.sin(phi) / np.sin(gamma) * normal_part(phi), 0, gamma)
    ours = _appendix_a(turned[0, 0], turned[1, 1], turned[0, 1], sin, np.tan(gamma / 2))
    assert ours == pytest.approx(second, rel=1e-9)
    tan = np.tan(gamma / 2)
    printed = ((a + 2 * b) * tan + 2 * c * sin**2 + (a - b) * sin * cos) / 3  # the paper's second bracket
    assert printed == pytest.approx(second, rel=1e-9)


def test_mean_value_weights_of_floater():
    vertices, triangles = shapes.random_disk(8)
    surface = Surface(vertices, triangles)
    weights = mean_value(surface)
    points = surface.vertices[:, :2]
    for edge, (i, j) in enumerate(surface.edges.tolist()):
        total = 0.0
        for triangle in triangles.tolist():
            if i in triangle and j in triangle:
                k = next(v for v in triangle if v not in (i, j))
                p, q = points[j] - points[i], points[k] - points[i]
                angle = np.arccos(p @ q / np.linalg.norm(p) / np.linalg.norm(q))
                total += np.tan(angle / 2) / np.linalg.norm(p)
        assert weights[0, edge] == pytest.approx(total, rel=1e-7)


@given(seeds, st.floats(0, 0.5))
def test_mean_value_weights_are_positive_even_on_folded_maps(seed, balance):
    surface, uv = deformed(seed)
    rng = np.random.default_rng(seed)
    uv[rng.random(len(uv)) < 0.3] *= -1  # folds
    uv[surface.triangles[0]] = uv[surface.triangles[0, 0]]  # and a collapsed triangle
    (weights,) = scheme(Settings(boundary="CIRCLE", weights="MEAN_VALUE", balance=balance))([surface], uv)
    assert np.isfinite(weights).all() and (weights > 0).all()
    assert (mean_value(surface) > 0).all() and (uniform(surface) > 0).all()


def test_stretch_weights_accumulate():
    surface, uv = deformed(9)
    update = scheme(Settings(boundary="CIRCLE", weights="STRETCH"))
    (once,) = update([surface], uv)
    (twice,) = update([surface], uv)
    np.testing.assert_allclose(twice / once, once / mean_value(surface), rtol=1e-12)
