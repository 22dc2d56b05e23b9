# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from qh_unwrap.core import Surface, solver, triangles
from qh_unwrap.core.solver import Dirichlet, System, nested_dissection
from qh_unwrap.core.weights import cotangent, mean_value

from . import shapes
from .test_tensor import seeds


@given(seeds)
def test_solutions_equal_dense_ones(seed):
    surface = Surface(*shapes.bump(seed))
    n = len(surface.vertices)
    rng = np.random.default_rng(seed)
    held = np.zeros(n, bool)
    held[surface.loops[0]] = True
    held[rng.integers(n, size=3)] = True
    values = rng.random((n, 2))
    dirichlet = Dirichlet(surface.order, surface.edges, held, values)
    for weights in (cotangent(surface), mean_value(surface)):
        matrix = np.zeros((n, n))
        i, j = surface.edges.T
        matrix[i, j], matrix[j, i] = -weights
        matrix -= np.diag(matrix.sum(axis=1))
        expected = values.copy()
        expected[~held] = np.linalg.solve(matrix[~held][:, ~held], -matrix[~held][:, held] @ values[held])
        np.testing.assert_allclose(dirichlet.solve(weights), expected, atol=1e-10)
        np.testing.assert_allclose(dirichlet.diagonal(weights), np.diag(matrix), rtol=1e-12)


def test_everything_held():
    surface = Surface(*shapes.grid(1, 1))
    values = np.random.default_rng(0).random((4, 2))
    dirichlet = Dirichlet(surface.order, surface.edges, np.ones(4, bool), values)
    np.testing.assert_array_equal(dirichlet.solve(cotangent(surface)), values)


def solved(system, beside, diagonal, rhs, residual):
    """Blocks are given as (k, 2, 2) for the edges and (n, 2, 2)."""
    rows = [
        np.array([a + d, a - d, b + c, c - b]) / 2
        for (a, b), (c, d) in (blocks.transpose(1, 2, 0) for blocks in (beside, diagonal))
    ]
    return system.solve_blocks(system.block_matrix(rows[0], rows[1][:3]), rhs, residual)


def scalar(values):
    return np.asarray(values)[:, None, None] * np.eye(2)


@pytest.mark.parametrize("at_once", [10, 8192])
def test_systems_of_blocks_are_solved_roughly(monkeypatch, at_once):
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
        solution = solved(System(surface.order, surface.edges), off, diagonal, rhs, roughly)
        residual = np.einsum("iajb,jb->ia", matrix, solution) - rhs
        assert np.linalg.norm(residual) <= roughly * np.linalg.norm(rhs)
        assert (solution * rhs).sum() > 0


def test_an_earlier_factorization_serves_or_is_replaced(monkeypatch):
    monkeypatch.setattr(solver, "_LARGE", 0)
    surface = Surface(*shapes.bump(2))
    n = len(surface.vertices)
    rng = np.random.default_rng(2)
    system = System(surface.order, surface.edges)
    made = []
    factors = system._factors
    monkeypatch.setattr(system, "_factors", lambda *entries, **how: made.append(1) or factors(*entries, **how))
    i, j = surface.edges.T
    rhs = rng.normal(size=(n, 2))
    first, near, far = (10 ** (spread * rng.random(len(i))) for spread in (0, 0.01, 6))
    for weight, count in ((first, 1), (near, 1), (far, 2), (far, 3), (far, 3)):
        diagonal = 1e-3 + np.bincount(i, weight, n) + np.bincount(j, weight, n)
        solution = solved(system, scalar(-weight), scalar(diagonal), rhs, 1e-6)
        product = diagonal[:, None] * solution
        np.subtract.at(product, i, weight[:, None] * solution[j])
        np.subtract.at(product, j, weight[:, None] * solution[i])
        assert np.linalg.norm(product - rhs) < 2e-6 * np.linalg.norm(rhs)
        assert len(made) == count


def laplacian(surface, held, hanging=1.0):
    """A matrix that has the vertex `held` at zero, and hangs the others on it by weights of this size."""
    n = len(surface.vertices)
    weight = np.full(len(surface.edges), 1.0)
    weight[(surface.edges == held).any(axis=1)] = hanging
    i, j = surface.edges.T
    diagonal = np.bincount(i, weight, n) + np.bincount(j, weight, n)
    diagonal[held] += hanging
    matrix = coo_array((np.r_[-weight, -weight], (np.r_[i, j], np.r_[j, i])), shape=(n, n)).toarray()
    return weight, diagonal, matrix + np.diag(diagonal)


@pytest.mark.parametrize("hanging", [1.0, 1e-6])
def test_single_precision_gives_the_same_solutions_as_double(monkeypatch, hanging):
    monkeypatch.setattr(solver, "_HUGE", 0)
    surface = Surface(*shapes.bump(4))
    weight, diagonal, matrix = laplacian(surface, 7, hanging)
    made = []
    monkeypatch.setattr(solver, "splu", lambda matrix, **how: made.append(matrix.dtype) or splu(matrix, **how))
    solve = System(surface.order, surface.edges).factor(-weight, -weight, diagonal)
    rhs = matrix @ np.random.default_rng(4).normal(size=(len(matrix), 2))
    residual = matrix @ solve(rhs) - rhs
    assert np.linalg.norm(residual) <= 1e-9 * np.linalg.norm(rhs)
    assert made[0] == np.float32
    assert (made[-1] == np.float64) == (hanging < 1), "where single precision does not suffice"
    assert not solve(np.zeros((len(matrix), 2))).any()


@pytest.mark.parametrize("size", [1.0, 1e-60, 1e60])
def test_blocks_are_solved_whatever_their_size_in_single_precision(monkeypatch, size):
    monkeypatch.setattr(solver, "_LARGE", 0)
    surface = Surface(*shapes.bump(5))
    weight, diagonal, matrix = laplacian(surface, 3)
    rhs = np.random.default_rng(5).normal(size=(len(matrix), 2))
    system = System(surface.order, surface.edges)
    solution = solved(system, scalar(-size * weight), scalar(size * diagonal), rhs, 1e-6)
    assert np.linalg.norm(size * matrix @ solution - rhs) <= 1e-6 * np.linalg.norm(rhs)


def fill(surface, order=None):
    """Nonzeros of the factors in that order, or in SuperLU's own for any matrix."""
    i, j = surface.edges.T
    n = len(surface.vertices)
    laplacian = coo_array((-np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n, n)).tocsc()
    laplacian.setdiag(1.1 - laplacian.sum(axis=0))
    if order is not None:
        laplacian = laplacian[order][:, order].tocsc()
    ordering = "COLAMD" if order is None else "NATURAL"
    return splu(laplacian, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True}).nnz


def test_the_order_is_a_permutation_with_less_fill_than_the_generic_one():
    vertices, triangles = shapes.random_disk(3, inner=6000, outer=200)
    surface = Surface(vertices, triangles)
    order = nested_dissection(surface.vertices, surface.edges)
    assert (np.sort(order) == np.arange(len(order))).all()
    assert fill(surface, order) < 0.8 * fill(surface)


def test_more_levels_than_short_integers_number_make_no_worse_order(monkeypatch):
    surface = Surface(*shapes.grid(200, 200))
    usual = fill(surface, nested_dissection(surface.vertices, surface.edges))
    monkeypatch.setattr(solver, "_LEAF", 1)
    order = nested_dissection(surface.vertices, surface.edges)
    assert (np.sort(order) == np.arange(len(order))).all()
    assert fill(surface, order) < 1.02 * usual


def test_orders_of_tiny_and_edgeless_graphs():
    for n in range(6):
        order = nested_dissection(np.random.default_rng(n).random((n, 3)), np.zeros((0, 2), int))
        assert sorted(order.tolist()) == list(range(n))
    same = np.zeros((50, 3))
    chain = np.column_stack([np.arange(49), np.arange(1, 50)])
    assert sorted(nested_dissection(same, chain).tolist()) == list(range(50))
