# SPDX-License-Identifier: GPL-3.0-or-later
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from qh_unwrap.core import Surface, bands, factors, sparse, triangles
from qh_unwrap.core.errors import SingularError
from qh_unwrap.core.factors import superlu
from qh_unwrap.core.patterns import Pattern, Unknowns
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.systems import Constrained
from qh_unwrap.core.weights import cotangent, mean_value

from . import shapes
from .test_tensor import seeds


@pytest.fixture
def any_form(monkeypatch):
    """No piece is so narrow that its matrix is taken for a band."""
    monkeypatch.setattr(bands, "_WIDEST", -1)


# How far apart neighbours may be in pieces that are bands: in all, in none, or in the smallest of three
WIDEST = {"bands": 10**9, "any form": -1, "both": 12}


def forms():
    return pytest.mark.parametrize("form", WIDEST)


def limited(form):
    return patch.object(bands, "_WIDEST", WIDEST[form])


def unconstrained(surface, **options):
    n = len(surface.vertices)
    return Constrained(surface.order, surface.edges, np.zeros(n, bool), np.zeros((n, 2)), **options)


def laplacian_of(edges, weights, n):
    """The dense matrix (n, n) whose product with f is the sum of w_ij (f_i - f_j)."""
    matrix = np.zeros((n, n))
    i, j = edges.T
    matrix[i, j], matrix[j, i] = -weights
    return matrix - np.diag(matrix.sum(axis=1))


@forms()
@given(seeds)
def test_solutions_equal_dense_ones(form, seed):
    with limited(form):
        check_solutions(seed)


def check_solutions(seed):
    surface = Surface(*shapes.bump(seed))
    n = len(surface.vertices)
    rng = np.random.default_rng(seed)
    held = np.zeros(n, bool)
    held[surface.loops[0]] = True
    held[rng.integers(n, size=3)] = True
    values = rng.random((n, 2))
    constrained = Constrained(surface.order, surface.edges, held, values)
    for weights in (cotangent(surface), mean_value(surface)):
        matrix = laplacian_of(surface.edges, weights, n)
        expected = values.copy()
        expected[~held] = np.linalg.solve(matrix[~held][:, ~held], -matrix[~held][:, held] @ values[held])
        np.testing.assert_allclose(constrained.solve(weights), expected, atol=1e-10)
        np.testing.assert_allclose(constrained.diagonal(weights), np.diag(matrix), rtol=1e-12)


def test_everything_held():
    surface = Surface(*shapes.grid(1, 1))
    values = np.random.default_rng(0).random((4, 2))
    constrained = Constrained(surface.order, surface.edges, np.ones(4, bool), values)
    np.testing.assert_array_equal(constrained.solve(cotangent(surface)), values)


@forms()
@pytest.mark.parametrize("alike", [True, False])
def test_nothing_moves_where_everything_is_held(alike, form):
    with limited(form):
        check_held(alike)


def check_held(alike):
    surface = Surface(*shapes.bump(1))
    n = len(surface.vertices)
    held = np.ones((n, 2), bool)
    if not alike:  # V may move
        held[20:, 1] = False
    beside, own, matrix = random_blocks(surface.edges, n, 1)
    gradient = np.random.default_rng(1).normal(size=(n, 2))
    direction = Constrained(surface.order, surface.edges, held, np.zeros((n, 2))).newton_direction(
        gradient, beside, own, 1e-10
    )
    free = ~held.ravel()
    expected = np.zeros(2 * n)
    expected[free] = np.linalg.solve(matrix[free][:, free], -gradient.ravel()[free])
    np.testing.assert_allclose(direction.ravel(), expected, atol=1e-9)


# Partners of partners are not all found yet.
CHAINED = [f"chained {how}" for how in ("alike", "apart")]
CONSTRAINTS = ("held alike", "held apart", "tied alike", "tied apart", "tied in U", *CHAINED)


def constraints(kind, n, seed):
    """What is held (n, 2) bool, where (n, 2), and the partners (n, 2) or None."""
    rng = np.random.default_rng(seed)
    held = rng.random((n, 2)) < 0.2
    held[0] = True
    partner = np.column_stack([np.arange(n), np.arange(n)])
    for c in (0, 1):
        for one, other, third, fourth in rng.permutation(n)[: n // 8 * 4].reshape(-1, 4):
            partner[[one, third], c] = other, fourth
            if kind.startswith("chained"):  # three in a row, or all of them with one
                partner[fourth, c] = other if rng.random() < 0.5 else partner[one, c]
                partner[third, c] = rng.choice([fourth, other])
    if kind.endswith("alike"):
        held[:, 1], partner[:, 1] = held[:, 0], partner[:, 0]
    elif kind == "tied in U":
        partner[:, 1] = np.arange(n)
    return held, rng.random((n, 2)), None if kind.startswith("held") else partner


def freedom(held, values, partner):
    """For one coordinate, what is held (n,), where, and its partners: all positions are `known + basis @ unknowns`.

    Returns `known` (n,) and `basis` (n, f).
    """
    n = len(held)
    graph = coo_array((np.ones(n), (np.arange(n), np.arange(n) if partner is None else partner)), shape=(n, n))
    part = connected_components(graph, directed=False)[1]
    known, columns = values.copy(), []
    for k in range(part.max() + 1):
        if not held[part == k].any():  # they move together, and keep their distances wherever they are
            columns.append(part == k)
    return known, np.array(columns, float).reshape(-1, n).T


@forms()
@pytest.mark.parametrize("kind", CONSTRAINTS)
@given(seeds)
def test_constrained_solutions_equal_dense_ones(kind, form, seed):
    with limited(form):
        check_constrained_solutions(kind, seed)


def check_constrained_solutions(kind, seed):
    surface = Surface(*shapes.bump(seed))
    n = len(surface.vertices)
    held, values, partner = constraints(kind, n, seed)
    rng = np.random.default_rng(seed)
    weights, source = 0.1 + rng.random((2, len(surface.edges))), rng.normal(size=(n, 2))
    constrained = Constrained(surface.order, surface.edges, held, values, partner)
    assert constrained.alike == kind.endswith("alike")
    matrix = laplacian_of(surface.edges, weights, n)
    for found, sources in (
        (constrained.solve(weights), np.zeros((n, 2))),
        (constrained.factor(weights)(constrained.fixed, source), source),
    ):
        for c in (0, 1):
            known, basis = freedom(held[:, c], values[:, c], None if partner is None else partner[:, c])
            unknowns = np.linalg.solve(basis.T @ matrix @ basis, basis.T @ (sources[:, c] - matrix @ known))
            np.testing.assert_allclose(found[:, c], known + basis @ unknowns, atol=1e-9)


def random_blocks(edges, n, seed):
    """The rows of a positive definite matrix of blocks, beside its diagonal and on it, and the dense matrix."""
    rng = np.random.default_rng(seed)
    beside, own = rng.normal(size=(4, len(edges))), rng.random((3, n))
    own[0] += 30
    matrix = np.zeros((n, 2, n, 2))
    (m, d, s, a), (i, j), k = beside, edges.T, np.arange(n)
    block = np.array([[m + d, s - a], [s + a, m - d]])
    matrix[i, :, j], matrix[j, :, i] = block.transpose(2, 0, 1), block.transpose(2, 1, 0)
    matrix[k, :, k] = np.array([[own[0] + own[1], own[2]], [own[2], own[0] - own[1]]]).transpose(2, 0, 1)
    return beside, own, matrix.reshape(2 * n, 2 * n)


@forms()
@pytest.mark.parametrize("kind", CONSTRAINTS)
@pytest.mark.parametrize("pieces", [1, 3])
def test_constrained_directions_equal_dense_ones(kind, pieces, form):
    with limited(form):
        check_constrained_directions(kind, pieces)


def check_constrained_directions(kind, pieces):
    meshes = [shapes.bump(k, inner=20 * (k + 1), outer=12) for k in range(pieces)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    n = len(surface.vertices)
    parts = [constraints(kind, size, 7) for size in np.diff(surface.vertex_starts, append=n)]
    held, values = (np.vstack([part[k] for part in parts]) for k in (0, 1))
    partner = None
    if parts[0][2] is not None:
        partner = np.vstack([part[2] + start for part, start in zip(parts, surface.vertex_starts, strict=True)])
    beside, own, matrix = random_blocks(surface.edges, n, 7)
    gradient = np.random.default_rng(8).normal(size=(n, 2))
    constrained = Constrained(surface.order, surface.edges, held, values, partner, surface.vertex_piece)
    basis = np.zeros((n, 2, 0))
    for c in (0, 1):
        _, its = freedom(held[:, c], values[:, c], None if partner is None else partner[:, c])
        basis = np.concatenate([basis, its[:, None] * np.eye(2)[c, :, None]], axis=2)
    basis = basis.reshape(2 * n, -1)
    alike = np.zeros((n, 2, n, 2))
    (i, j), k = surface.edges.T, np.arange(n)
    for c in (0, 1):
        alike[i, c, j, c] = alike[j, c, i, c] = beside[0]
        alike[k, c, k, c] = own[0]
    other = np.random.default_rng(9).normal(size=(n, 2))
    for found, its, against in (
        (constrained.newton_direction(gradient, beside, own, 1e-10), matrix, gradient),
        (constrained.next_direction(other, 1e-10), matrix, other),
        (constrained.direction(gradient, beside[0], own[0]), alike.reshape(2 * n, 2 * n), gradient),
    ):
        unknowns = np.linalg.solve(basis.T @ its @ basis, -basis.T @ against.ravel())
        np.testing.assert_allclose(found.ravel(), basis @ unknowns, atol=1e-9)


def rows_of(beside, diagonal):
    """What `newton_direction` takes, of blocks (k, 2, 2) for the edges and (n, 2, 2)."""
    rows = [
        np.array([a + d, a - d, b + c, c - b]) / 2
        for (a, b), (c, d) in (blocks.transpose(1, 2, 0) for blocks in (beside, diagonal))
    ]
    return rows[0], rows[1][:3]


def scalar(values):
    return np.asarray(values)[:, None, None] * np.eye(2)


@pytest.mark.parametrize("at_once", [10, 8192])
def test_systems_of_blocks_are_solved_roughly(monkeypatch, at_once, any_form):
    monkeypatch.setattr(triangles, "_AT_ONCE", at_once)
    surface = Surface(*shapes.bump(1))
    n = len(surface.vertices)
    rng = np.random.default_rng(1)
    i, j = surface.edges.T
    off = rng.random((len(i), 2, 2))
    symmetric = rng.random((n, 2, 2))
    diagonal = 30 * np.eye(2) + symmetric + symmetric.swapaxes(1, 2)
    matrix = np.zeros((n, 2, n, 2))
    matrix[i, :, j], matrix[j, :, i] = off, off.swapaxes(1, 2)
    matrix[np.arange(n), :, np.arange(n)] = diagonal
    rhs = rng.normal(size=(n, 2))
    for roughly in (0.3, 1e-6):
        solution = unconstrained(surface).newton_direction(-rhs, *rows_of(off, diagonal), roughly)
        residual = np.einsum("iajb,jb->ia", matrix, solution) - rhs
        assert np.linalg.norm(residual) <= roughly * np.linalg.norm(rhs)
        assert (solution * rhs).sum() > 0


def test_every_piece_is_solved_to_its_own_residual(any_form):
    meshes = [shapes.bump(k, inner=20 * (k + 1), outer=12) for k in range(3)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    beside, own, matrix = random_blocks(surface.edges, len(surface.vertices), 3)
    gradient = np.random.default_rng(3).normal(size=(len(surface.vertices), 2))
    gradient *= 10.0 ** np.array([-6, 0, 6])[surface.vertex_piece, None]
    found = unconstrained(surface, group=surface.vertex_piece).newton_direction(gradient, beside, own, 1e-3)
    rest = (matrix @ found.ravel()).reshape(-1, 2) + gradient
    missed, size = (np.sqrt(surface.vertex_sums((each**2).sum(axis=1))) for each in (rest, gradient))
    assert (missed <= 1e-3 * size).all()


def test_an_earlier_factorization_serves_or_is_replaced(monkeypatch, any_form):
    monkeypatch.setattr(sparse, "_LARGE", 0)
    surface = Surface(*shapes.bump(2))
    n = len(surface.vertices)
    rng = np.random.default_rng(2)
    made = []
    system = unconstrained(surface, factorizer=lambda *given: made.append(1) or superlu(*given))
    i, j = surface.edges.T
    rhs = rng.normal(size=(n, 2))
    first, near, far = (10 ** (spread * rng.random(len(i))) for spread in (0, 0.01, 6))
    for weight, count in ((first, 1), (near, 1), (far, 2), (far, 3), (far, 3)):
        diagonal = 1e-3 + np.bincount(i, weight, n) + np.bincount(j, weight, n)
        solution = system.newton_direction(-rhs, *rows_of(scalar(-weight), scalar(diagonal)), 1e-6)
        product = diagonal[:, None] * solution
        np.subtract.at(product, i, weight[:, None] * solution[j])
        np.subtract.at(product, j, weight[:, None] * solution[i])
        assert np.linalg.norm(product - rhs) < 2e-6 * np.linalg.norm(rhs)
        assert len(made) == count


@pytest.mark.parametrize("hanging", [1.0, 1e-8])
def test_single_precision_gives_the_same_solutions_as_double(monkeypatch, hanging, any_form):
    monkeypatch.setattr(sparse, "_LARGE", 0)
    surface = Surface(*shapes.bump(4))
    n = len(surface.vertices)
    held = np.arange(n) == 7
    weights = np.ones((2, len(surface.edges)))
    weights[:, (surface.edges == 7).any(axis=1)] = hanging  # all hangs on the held vertex by weights of this size
    made = []
    monkeypatch.setattr(factors, "splu", lambda matrix, **how: made.append(matrix.dtype) or splu(matrix, **how))
    solve = Constrained(surface.order, surface.edges, held, np.zeros((n, 2))).factor(weights)
    matrix = laplacian_of(surface.edges, weights, n)[~held][:, ~held]
    sources = np.zeros((n, 2))
    sources[~held] = rhs = np.random.default_rng(4).normal(size=(n - 1, 2))
    solution = solve(np.zeros((n, 2)), sources)[~held]
    assert np.linalg.norm(matrix @ solution - rhs) <= 1e-9 * max(np.linalg.norm(rhs), np.linalg.norm(solution))
    assert made[0] == np.float32
    assert (made[-1] == np.float64) == (hanging < 1), "where single precision does not suffice"
    assert not solve(np.zeros((n, 2))).any()


@pytest.mark.parametrize("size", [1.0, 1e-60, 1e60])
def test_blocks_are_solved_whatever_their_size_in_single_precision(monkeypatch, size, any_form):
    monkeypatch.setattr(sparse, "_LARGE", 0)
    surface = Surface(*shapes.bump(5))
    n = len(surface.vertices)
    weight = np.ones(len(surface.edges))
    matrix = laplacian_of(surface.edges, np.ones((2, len(weight))), n)
    matrix[3, 3] += 1
    rhs = np.random.default_rng(5).normal(size=(n, 2))
    blocks = rows_of(scalar(-size * weight), scalar(size * np.diag(matrix)))
    solution = unconstrained(surface).newton_direction(-rhs, *blocks, 1e-6)
    assert np.linalg.norm(size * matrix @ solution - rhs) <= 1e-6 * np.linalg.norm(rhs)


@pytest.mark.parametrize("single", [True, False])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_matrices_that_are_not_finite_are_not_factorized(value, single):
    """SuperLU may crash on them, and all of Blender with it."""
    surface = Surface(*shapes.grid(4, 4))
    system = unconstrained(surface)
    weights = np.ones((2, len(surface.edges)))
    weights[:, 3] = value
    pattern = Pattern(Unknowns(surface.order, np.zeros(len(surface.vertices), bool)), surface.edges)
    matrix = pattern.matrix(-weights[0], -weights[1], system.diagonal(weights))
    with pytest.raises(SingularError):
        superlu(matrix, single)


def test_what_single_precision_cannot_hold_is_factorized_in_double():
    matrix = coo_array((np.array([1e200, 1.0]), (np.arange(2), np.arange(2))), shape=(2, 2)).tocsc()
    solution = superlu(matrix, True).solve(np.array([[1e200], [2.0]]))
    assert solution.ravel().tolist() == [1, 2]
