# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from qh_unwrap.core import Surface, bands, ordering, patterns
from qh_unwrap.core.ordering import elimination_order
from qh_unwrap.core.pieces import joined

from . import shapes


def widths_of(order, *graph):
    return bands.widths(patterns.places(order), *graph)


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
    order = elimination_order(surface.vertices, surface.edges)
    assert (np.sort(order) == np.arange(len(order))).all()
    assert fill(surface, order) < 0.8 * fill(surface)


def test_more_levels_than_short_integers_number_make_no_worse_order(monkeypatch):
    surface = Surface(*shapes.grid(200, 200))
    usual = fill(surface, elimination_order(surface.vertices, surface.edges))
    monkeypatch.setattr(ordering, "_LEAF", 1)
    order = elimination_order(surface.vertices, surface.edges)
    assert (np.sort(order) == np.arange(len(order))).all()
    assert fill(surface, order) < 1.02 * usual


def test_orders_of_tiny_and_edgeless_graphs():
    for n in range(6):
        order = elimination_order(np.random.default_rng(n).random((n, 3)), np.zeros((0, 2), int))
        assert sorted(order.tolist()) == list(range(n))
    same = np.zeros((50, 3))
    chain = np.column_stack([np.arange(49), np.arange(1, 50)])
    assert sorted(elimination_order(same, chain).tolist()) == list(range(50))


def test_each_grid_is_eliminated_row_by_row_if_it_is_numbered_so():
    vertices, _ = shapes.grid(16, 16)
    a = np.add.outer(17 * np.arange(16), np.arange(16)).ravel()
    b, c, d = a + 1, a + 18, a + 17
    one = np.random.default_rng(1).random(len(a)) < 0.5  # of both ways to halve a square
    triangles = np.vstack([np.array(each).T[its] for each, its in (([a, b, c], one), ([a, c, d], one))])
    triangles = np.vstack([triangles, *(np.array(each).T[~one] for each in ([a, b, d], [b, c, d]))])
    number = np.random.default_rng(0).permutation(len(vertices))
    shuffled = vertices[np.argsort(number)], number[triangles]
    surface = Surface(*joined(*zip((vertices, triangles), shuffled, (vertices, triangles), strict=True)))
    first, second, third = widths_of(surface.order, surface.edges, surface.vertex_piece)
    assert first == third == 18 < second < 40


@pytest.mark.parametrize("inner", [(40, 90, 20), (900, 60, 2500, 300)])
def test_pieces_are_eliminated_with_as_little_fill_as_alone(inner):
    meshes = [shapes.bump(k, inner=count, outer=20 + count // 20) for k, count in enumerate(inner)]
    batch = Surface(*joined(*zip(*meshes, strict=True)))
    order = elimination_order(batch.vertices, batch.edges, batch.vertex_piece)
    assert (np.sort(order) == np.arange(len(order))).all()
    assert (np.diff(batch.vertex_piece[order]) != 0).sum() == len(meshes) - 1, "a piece is done before the next begins"
    alone = 0
    for surface in (Surface(*mesh) for mesh in meshes):
        alone += fill(surface, elimination_order(surface.vertices, surface.edges))
    assert fill(batch, order) < 1.1 * alone


def test_narrow_pieces_are_eliminated_as_they_are_alone():
    meshes = [shapes.bump(k, inner=count, outer=12) for k, count in enumerate((30, 200, 3, 90, 30))]
    meshes += [shapes.grid(4, 9), shapes.grid(1, 60), shapes.ring(30, 4)]
    batch = Surface(*joined(*zip(*meshes, strict=True)))
    for k, mesh in enumerate(meshes):
        its = batch.order[batch.vertex_piece[batch.order] == k] - batch.vertex_starts[k]
        np.testing.assert_array_equal(its, Surface(*mesh).order)


def test_orders_of_graphs_that_fall_into_parts():
    edges = np.array([[0, 3], [1, 4], [4, 7], [2, 5], [5, 8]])  # and 6 has no neighbour
    order = ordering.local_order(9, edges)
    assert sorted(order.tolist()) == list(range(9))
    assert widths_of(order, edges)[0] == 1
    piece = np.arange(9) % 3
    order = ordering.local_order(9, edges, piece)
    assert (np.diff(piece[order]) >= 0).all() and widths_of(order, edges)[0] == 1
    order = ordering.local_order(10, edges, np.append(piece, 3))  # whose last piece is one vertex
    assert sorted(order.tolist()) == list(range(10)) and order[-1] == 9


def test_some_pieces_are_eliminated_as_all_are():
    meshes = [shapes.bump(k, inner=count, outer=20) for k, count in enumerate((300, 200, 400))]
    batch = Surface(*joined(*zip(*meshes, strict=True)))
    anew = batch.of(np.array([True, False, True])).order
    order = batch.order
    some = batch.of(np.array([True, False, True]))
    assert (np.sort(some.order) == np.sort(anew)).all()
    inner = batch.vertex_piece[order] != 1
    np.testing.assert_array_equal(some.vertices[some.order], batch.vertices[order][inner])


@pytest.mark.parametrize("shuffled", [False, True])
def test_however_a_regular_mesh_is_numbered_its_order_leaves_little_fill(shuffled):
    # halved again and again, as subdivision does: its vertices are numbered level by level
    vertices, triangles = shapes.grid(6, 6)
    for _ in range(4):
        vertices, triangles = shapes.subdivided(vertices, triangles)
    if shuffled:
        number = np.random.default_rng(0).permutation(len(vertices))
        vertices, triangles = vertices[np.argsort(number)], number[triangles]
    surface = Surface(vertices, triangles)
    order = elimination_order(surface.vertices, surface.edges)
    dissected = ordering.Dissection.of(surface.vertices, surface.edges).order
    assert fill(surface, order) < 1.1 * fill(surface, dissected)
