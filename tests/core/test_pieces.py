# SPDX-License-Identifier: GPL-3.0-or-later
"""Several pieces of one surface are treated as each of them is alone."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from qh_unwrap.core import Surface
from qh_unwrap.core.certificate import are_injective, certified_pieces, is_injective
from qh_unwrap.core.distortion import measure, measure_pieces
from qh_unwrap.core.domain import Fixed, Held
from qh_unwrap.core.energy import Barrier, energies, map_scale
from qh_unwrap.core.flattening import conformal
from qh_unwrap.core.initial import project
from qh_unwrap.core.pieces import components, first_of_parts, joined

from . import shapes
from .patches import Patches


@pytest.fixture(scope="module")
def meshes():
    """Random disks of up to 150 triangles, some with a hole, and some that wind over themselves when laid flat."""
    patches = Patches()
    more = [shapes.ring(12, k) for k in (1, 2, 4)] + [shapes.stairs(*k) for k in ((35, 1), (60, 1), (40, 2))]
    return [patches(seed, largest=150)[1:] for seed in range(120)] + more


@pytest.mark.parametrize("make", [project, conformal])
def test_maps_and_their_measures(meshes, make):
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    uv = make(surface)
    measured, energy = measure_pieces(surface, uv), energies(surface, uv, 0.3)
    injective = are_injective(uv, surface.triangles, surface.piece, surface.loops, surface.loop_piece)
    certified = certified_pieces(surface, uv)
    for k, (mesh, its_uv) in enumerate(zip(meshes, np.split(uv, surface.vertex_starts[1:]), strict=True)):
        alone = Surface(*mesh)
        np.testing.assert_allclose(distances(its_uv), distances(make(alone)), rtol=1e-5, atol=1e-7)
        itself = measure(alone, its_uv)
        assert measured[k].to_dict() == pytest.approx(itself.to_dict(), rel=1e-9)
        assert injective[k] == is_injective(its_uv, alone.triangles, alone.loops)
        assert certified[k] == certified_pieces(alone, its_uv)[0]
        if itself.flips + itself.collapsed == 0:
            assert energy[k] == pytest.approx(energies(alone, its_uv, 0.3)[0], rel=1e-9)


def distances(points):
    return np.linalg.norm(points[:, None] - points, axis=2)


def with_air_in_holes(surface):
    uv = surface.vertices[:, :2]
    return Held(surface, Fixed(np.zeros(uv.shape, bool), uv), surface.plugs(solid=False))


@pytest.mark.parametrize("balance", [0.1, 0.25, 0.8])
def test_the_energy_that_keeps_triangles_from_flipping(balance):
    meshes = [shapes.bump(1), shapes.ring(9, 2), shapes.bump(2, inner=200), shapes.ring(14, 1), shapes.bump(3, inner=5)]
    meshes = [(mesh[0] * size, mesh[1]) for mesh, size in zip(meshes, (1, 1e-3, 1e4, 1, 7), strict=True)]
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    domain = with_air_in_holes(surface)
    x, y, _ = surface.vertices.T
    uv = domain.start(np.column_stack([x + 0.1 * np.sin(2 * y), 0.7 * y + 0.1 * x * x]))
    size = 1.1 * map_scale(surface, uv)
    step = np.random.default_rng(4).normal(size=uv.shape)
    barrier = Barrier(domain, uv, balance, size)
    here, change = barrier.jacobian(uv), barrier.jacobian(step)
    value, longest, derivatives = barrier.value(here), barrier.longest_step(here, change), barrier.derivatives(here)
    assert np.isfinite(value).all()
    piece = domain.triangles.at(np.arange(len(meshes)))
    for k, mesh in enumerate(meshes):
        its_uv, its_step = (each[domain.vertex_piece == k] for each in (uv, step))
        alone = Barrier(with_air_in_holes(Surface(*mesh)), its_uv, balance, size[[k]])
        its_here = alone.jacobian(its_uv)
        assert alone.value(its_here)[0] == pytest.approx(value[k], rel=1e-9)
        assert alone.least[0] == pytest.approx(barrier.least[k], rel=1e-9)
        assert alone.longest_step(its_here, alone.jacobian(its_step))[0] == pytest.approx(longest[k], rel=1e-9)
        for values, its_values in zip(derivatives, alone.derivatives(its_here), strict=True):
            atol = 1e-9 * np.abs(its_values).max()
            np.testing.assert_allclose(values[:, piece == k], its_values, rtol=1e-7, atol=atol)
    mirrored = np.where((domain.vertex_piece == 2)[:, None], uv * [-1, 1], uv)
    value = barrier.value(barrier.jacobian(mirrored))
    assert np.isinf(value).tolist() == [False, False, True, False, False]


def test_a_chosen_piece_is_the_surface_that_it_was_made_of(meshes):
    surface = Surface(*joined(*zip(*meshes, strict=True)))
    chosen = np.arange(len(meshes)) % 5 == 0
    some = surface.of(chosen)
    expected = Surface(*joined(*zip(*[meshes[k] for k in np.flatnonzero(chosen)], strict=True)))
    for name in ("vertices", "triangles", "edges", "triangle_edges", "rest", "measure", "barrier", "piece"):
        np.testing.assert_allclose(getattr(some, name), getattr(expected, name), rtol=1e-9, atol=1e-12, err_msg=name)
    for name in ("vertex_piece", "vertex_starts", "triangle_starts", "on_boundary", "loop_piece"):
        np.testing.assert_array_equal(getattr(some, name), getattr(expected, name), err_msg=name)
    assert all(np.array_equal(*loops) for loops in zip(some.loops, expected.loops, strict=True))
    for k in (0, 7, len(meshes) - 1):
        one, alone = surface.one(k), Surface(*meshes[k])
        for name in ("vertices", "triangles", "edges", "triangle_edges", "rest", "on_boundary"):
            np.testing.assert_allclose(getattr(one, name), getattr(alone, name), rtol=1e-9, atol=1e-12, err_msg=name)
        assert all(np.array_equal(*loops) for loops in zip(one.loops, alone.loops, strict=True))


@pytest.mark.parametrize("count, links", [(1, 0), (7, 3), (50, 30), (50, 400), (3000, 2500), (3000, 9000)])
def test_parts_are_what_hangs_together(count, links):
    rng = np.random.default_rng(links)
    one, other = rng.integers(0, count, (2, links))
    found, part = components(count, one, other)
    graph = coo_array((np.ones(links), (one, other)), shape=(count, count))
    expected, expected_part = connected_components(graph, directed=False)
    assert found == expected
    assert (part == expected_part).all()
    # A chain in any order is one part.
    chain = rng.permutation(count)
    assert components(count, chain[:-1], chain[1:])[0] == 1
    assert (first_of_parts(count, chain[1:], chain[:-1]) == 0).all()
