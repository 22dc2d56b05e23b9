# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Settings, Surface, distortion, unwrap, unwrap_together
from qh_unwrap.core.descent import energies
from qh_unwrap.core.distortion import measure, measure_pieces
from qh_unwrap.core.initial import conformal, project
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.quasi_harmonic import energy
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.validity import are_injective, is_injective

from . import shapes
from .blender import triangulate
from .overlaps import is_clean
from .patches import Patches


def together(islands, **settings):
    """The results of islands (vertices, triangles, uv)."""
    return finished(unwrap_together(islands, Settings(**settings)))


@pytest.fixture(scope="module")
def small():
    """Random disks of up to 150 triangles."""
    patches = Patches()
    return [(*patches(seed, largest=150)[1:], None) for seed in range(120)]


def test_pieces_of_a_surface_are_as_they_are_alone(small):
    vertices, triangles, _ = zip(*small, strict=True)
    surface = Surface(*joined(vertices, triangles))
    uv = {make: make(surface) for make in (project, conformal)}
    pieces = {make: np.split(uv[make], surface.vertex_starts[1:]) for make in uv}
    measured = {make: measure_pieces(surface, uv[make]) for make in uv}
    energy_of = {make: energies(surface, uv[make], 0.3) for make in uv}
    where = surface.triangles, surface.piece, surface.loops, surface.loop_piece
    injective = {make: are_injective(uv[make], *where) for make in uv}
    for k, (vertices, triangles, _) in enumerate(small):
        alone = Surface(vertices, triangles)
        for make in uv:
            np.testing.assert_allclose(distances(pieces[make][k]), distances(make(alone)), rtol=1e-5, atol=1e-7)
            itself = measure(alone, pieces[make][k])
            assert measured[make][k].to_dict() == pytest.approx(itself.to_dict(), rel=1e-9)
            assert injective[make][k] == is_injective(pieces[make][k], alone.triangles, alone.loops)
            if itself.flips + itself.collapsed == 0:
                assert energy_of[make][k] == pytest.approx(energy(alone, pieces[make][k], 0.3), rel=1e-9)


def distances(points):
    return np.linalg.norm(points[:, None] - points, axis=2)


def test_small_islands_together_are_certified_and_as_good_as_alone(small):
    results = together(small)
    assert sum(result is not None for result in results) > 0.8 * len(small)
    for (vertices, triangles, _), result in zip(small, results, strict=True):
        if result is None:
            continue
        assert all(np.array_equal(*pair) for pair in zip(result.loops, Surface(vertices, triangles).loops, strict=True))
        assert result.report.injective and result.report.converged and is_clean(result.uv, triangles)
        measured = distortion(vertices, triangles, result.uv)
        assert measured.to_dict() == pytest.approx(result.report.after.to_dict(), rel=1e-9)
        alone = unwrap(vertices, triangles, triangulate=triangulate).report.after
        assert measured.symmetric_dirichlet < 1.01 * alone.symmetric_dirichlet


def test_what_does_not_suit_is_left_alone():
    good = (*shapes.bump(1), None)
    tetrahedron = np.eye(4)[:, :3], np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]), None
    large = (*shapes.bump(2, inner=300), None)
    ring = (*shapes.ring(), None)
    flat = np.zeros((3, 3)), np.array([[0, 1, 2]]), None
    apart = np.random.default_rng(0).random((6, 3)), np.array([[0, 1, 2], [3, 4, 5]]), None
    islands = [good, tetrahedron, large, good, ring, flat, good, apart]
    assert [result is not None for result in together(islands)] == [True, False, False, True, False, False, True, False]
    assert together([]) == []
    for settings in ({"boundary": "CIRCLE"}, {"initial": "CURRENT"}, {"refine": 0}, {"iterations": 0}):
        assert together([good], **settings) == [None]


def test_what_goes_together_hardly_changes_the_result(small):
    everything = together(small)
    some = together(small[:7])
    for one, other in zip(some, everything, strict=False):
        assert (one is None) == (other is None)
        if one:
            np.testing.assert_allclose(distances(one.uv), distances(other.uv), atol=0.02)


def test_given_uvs_are_measured_first():
    vertices, triangles = shapes.bump(3)
    uv = vertices[:, :2] * [2, 1]
    given, new = together([(vertices, triangles, uv), (vertices, triangles, None)])
    assert given.report.before.to_dict() == distortion(vertices, triangles, uv).to_dict()
    assert new.report.before is None
