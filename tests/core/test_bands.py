# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Surface, bands
from qh_unwrap.core.bands import Banded, IndefiniteError, are_narrow, widths
from qh_unwrap.core.errors import SingularError
from qh_unwrap.core.patterns import Unknowns, places
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.systems import Constrained

from . import shapes
from .test_systems import laplacian_of, random_blocks


def ribbon_and_sheet():
    return Surface(*joined(*zip(shapes.grid(60, 1), shapes.grid(12, 12), strict=True)))


def narrow_pieces(surface, group=None):
    return are_narrow(widths(places(surface.order), surface.edges, group), len(surface.vertices), group)


def test_what_is_narrow_does_not_depend_on_its_company(monkeypatch):
    monkeypatch.setattr(bands, "_WIDEST", 6)
    surface = ribbon_and_sheet()
    assert narrow_pieces(surface, surface.vertex_piece).tolist() == [True, False]
    for k in (0, 1):
        alone = surface.one(k)
        assert (narrow_pieces(alone) == (k == 0)).all()


def test_pieces_are_solved_in_company_as_they_are_alone(monkeypatch):
    monkeypatch.setattr(bands, "_WIDEST", 6)
    surface = ribbon_and_sheet()
    n = len(surface.vertices)
    beside, own, _ = random_blocks(surface.edges, n, 1)
    gradient = np.random.default_rng(2).normal(size=(n, 2))
    system = Constrained(surface.order, surface.edges, np.zeros(n, bool), gradient, group=surface.vertex_piece)
    together = system.newton_direction(gradient, beside, own, 1e-12)
    for k in (0, 1):
        alone, rows = surface.one(k), surface.vertex_piece == k
        edges = rows[surface.edges[:, 0]]
        system = Constrained(alone.order, alone.edges, np.zeros(rows.sum(), bool), gradient[rows])
        its = [each[edges] for each in beside], [each[rows] for each in own]
        np.testing.assert_allclose(together[rows], system.newton_direction(gradient[rows], *its, 1e-12), atol=1e-9)


@pytest.mark.parametrize("alike", [True, False])
def test_matrices_that_are_not_positive_definite_are_solved_another_way(alike):
    surface = Surface(*shapes.grid(5, 5))
    n = len(surface.vertices)
    held = np.zeros((n, 2), bool)
    held[0] = True
    held[3, 0] = not alike or held[3, 1]
    values, weights = np.random.default_rng(3).normal(size=(n, 2)), -np.ones((2, len(surface.edges)))
    system = Constrained(surface.order, surface.edges, held, values)
    matrix = laplacian_of(surface.edges, weights, n)
    np.testing.assert_allclose((matrix @ system.solve(weights))[~held.any(axis=1)], 0, atol=1e-9)

    beside, own, _ = random_blocks(surface.edges, n, 4)
    own[0][5] = 0.0  # so that the blocks at a vertex's own place are not positive definite
    gradient = np.random.default_rng(5).normal(size=(n, 2))
    with pytest.raises(IndefiniteError):
        Banded(system.unknowns, surface.order, surface.edges).newton_direction(gradient, beside, own, 0.0)
    one, other = system.newton_direction(gradient, beside, own, 1e-9), system.next_direction(gradient[::-1], 1e-9)
    for found in (one, other):
        assert np.isfinite(found).all() and not found[held].any() and found.any()


def test_what_is_tied_to_something_far_away_is_no_band(monkeypatch):
    monkeypatch.setattr(bands, "_WIDEST", 6)
    made = []
    monkeypatch.setattr(bands._Bands, "factorized", lambda *given: made.append(given) or (lambda rhs: rhs))
    surface = ribbon_and_sheet()
    n = len(surface.vertices)
    held, (beside, own, _) = np.arange(n) % 60 == 0, random_blocks(surface.edges, n, 1)
    for tied in (None, 0, 1):
        partner = np.column_stack([np.arange(n), np.arange(n)])
        if tied is not None:  # the ends of the ribbon
            partner[[1, 58], tied] = 58, 1
        system = Constrained(surface.order, surface.edges, held, np.zeros((n, 2)), partner, surface.vertex_piece)
        made.clear()
        system.newton_direction(np.ones((n, 2)), beside, own, 1e-3)
        assert len(made) == (tied is None)


def test_who_is_held_in_one_coordinate_alone_changes_no_others_equations(monkeypatch):
    monkeypatch.setattr(bands, "_WIDEST", -1)
    surface = ribbon_and_sheet()
    n = len(surface.vertices)
    held = np.zeros((n, 2), bool)
    held[surface.vertex_starts] = True
    beside, own, _ = random_blocks(surface.edges, n, 2)
    gradient = np.random.default_rng(3).normal(size=(n, 2))
    found = []
    for also in (held[7, 0], True):
        held[7, 0] = also
        system = Constrained(surface.order, surface.edges, held, np.zeros((n, 2)), group=surface.vertex_piece)
        found.append(system.newton_direction(gradient, beside, own, 0.1))
        found.append(system.next_direction(gradient, 0.1))
    for one, other in zip(found[:2], found[2:], strict=True):
        np.testing.assert_allclose(one[surface.vertex_piece == 1], other[surface.vertex_piece == 1], rtol=1e-12)


def test_indefinite_pieces_leave_the_others_as_they_are():
    meshes = [shapes.bump(k, inner=30, outer=12) for k in range(5)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    n, piece = len(surface.vertices), surface.vertex_piece
    held, values = np.isin(np.arange(n), surface.vertex_starts), np.random.default_rng(7).normal(size=(n, 2))
    beside, own, _ = random_blocks(surface.edges, n, 8)
    system = Constrained(surface.order, surface.edges, held, values, group=piece)
    sound = system.newton_direction(values, beside, own, 1e-9)
    weights = np.ones((2, len(surface.edges)))
    solved = system.solve(weights)
    bad = (piece == 1) | (piece == 3)
    own[0] = np.where(bad, 0.0, own[0])
    weights[:, bad[surface.edges[:, 0]]] = -1.0
    for found, before in (
        (system.newton_direction(values, beside, own, 1e-9), sound),
        (system.solve(weights), solved),
    ):
        assert np.isfinite(found).all()
        np.testing.assert_array_equal(found[~bad], before[~bad])
    np.testing.assert_allclose(found[bad], solved[bad], atol=1e-9)  # the sign of all weights does not matter
    other = system.next_direction(values[::-1], 1e-9)
    assert np.isfinite(other).all() and other[~bad & ~held].all()


def test_what_is_not_finite_is_not_solved():
    surface = Surface(*shapes.grid(4, 4))
    n = len(surface.vertices)
    everything = [Unknowns(surface.order, np.zeros(n, bool))]
    beside, own, _ = random_blocks(surface.edges, n, 6)
    for value in (np.nan, np.inf):
        own[0][7] = value
        with pytest.raises(IndefiniteError):
            Banded(everything, surface.order, surface.edges).newton_direction(np.zeros((n, 2)), beside, own, 0.0)


@pytest.mark.parametrize("tied", [False, True])
def test_matrices_that_are_not_symmetric_are_solved_as_bands(monkeypatch, tied):
    meshes = [shapes.grid(40, 1), shapes.grid(9, 9), shapes.bump(3, inner=30, outer=12)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    n, rng = len(surface.vertices), np.random.default_rng(11)
    held, partner = np.isin(np.arange(n), surface.vertex_starts), np.arange(n)
    if tied:
        partner[[5, 7]] = 7, 5  # neighbours in the ribbon, and others
        partner[[90, 96]] = 96, 90
    weights = rng.uniform(1e-6, 1, (2, len(surface.edges))) ** 3
    values = rng.normal(size=(n, 2))
    both = np.column_stack([partner, partner])
    found = []
    for narrow in (True, False):
        monkeypatch.setattr(bands, "_WIDEST", 128 if narrow else -1)
        system = Constrained(surface.order, surface.edges, held, values, both, surface.vertex_piece)
        found.append(system.solve(weights))
        assert ("_everything" in vars(system)) != narrow
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-12)
    if not tied:
        matrix = laplacian_of(surface.edges, weights, n)
        np.testing.assert_allclose((matrix @ found[0])[~held], 0, atol=1e-12)


def test_a_solution_lies_between_its_neighbours_however_much_it_shrinks():
    # As in a harmonic map of a long tube, far beyond single precision
    length = 200
    surface = Surface(*shapes.grid(length, 1))
    held = surface.vertices[:, 0] < surface.vertices[:, 0].min() + 1e-9
    i, j = surface.edges.T
    inward = surface.vertices[i, 0] < surface.vertices[j, 0]
    weights = np.where(inward, [[1.0], [9.0]], [[9.0], [1.0]])
    values = np.column_stack([np.arange(len(held)), -np.arange(len(held))]).astype(float)
    found = Constrained(surface.order, surface.edges, held, values).solve(weights)
    assert np.isfinite(found).all()
    low, high = values[held].min(axis=0), values[held].max(axis=0)
    assert (found >= low - 1e-9).all() and (found <= high + 1e-9).all()


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_one_piece_without_a_solution_is_told(bad):
    surface = ribbon_and_sheet()
    n = len(surface.vertices)
    held = np.isin(np.arange(n), surface.vertex_starts)
    weights = np.random.default_rng(12).uniform(0.5, 1, (2, len(surface.edges)))
    weights[:, surface.vertex_piece[surface.edges[:, 0]] == 1] = bad
    system = Constrained(surface.order, surface.edges, held, np.ones((n, 2)), group=surface.vertex_piece)
    with pytest.raises(SingularError), np.errstate(invalid="ignore"):
        system.solve(weights)
