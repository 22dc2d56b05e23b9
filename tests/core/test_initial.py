# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Settings, Surface, distortion, starts, unwrap
from qh_unwrap.core.certificate import certified_pieces
from qh_unwrap.core.flattening import Flattening, conformal
from qh_unwrap.core.initial import fit, project
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.triangles import signed_areas

from . import shapes
from .patches import Patches


def cone(seed):
    """A developable patch: three quarters of a disk rolled to a cone."""
    vertices, triangles = shapes.random_disk(seed)
    x, y, _ = vertices.T + np.array([[1.5], [0], [0]])
    radius, angle = np.hypot(x, y), np.arctan2(y, x) * 4 / 3
    tilt = 3 / 4
    return (
        np.column_stack([tilt * radius * np.cos(angle), tilt * radius * np.sin(angle), np.sqrt(1 - tilt**2) * radius]),
        triangles,
        np.column_stack([x, y]),
    )


def test_conformal_map_of_a_flat_patch_is_a_similarity():
    vertices, triangles = shapes.random_disk(1)
    measured = distortion(vertices @ shapes.rotation(3).T, triangles, conformal(Surface(vertices, triangles)))
    assert measured.symmetric_dirichlet == pytest.approx(1, abs=1e-9)
    assert measured.flips == 0


def test_conformal_map_keeps_angles_and_orientation_of_a_curved_patch():
    vertices, triangles = shapes.bump(2, inner=1500, outer=120)
    surface = Surface(vertices, triangles)
    measured = distortion(vertices, triangles, conformal(surface))
    assert measured.angle < 1.05
    assert measured.flips == 0


def test_conformal_map_of_nearly_developable_triangles():
    vertices, triangles, flat = cone(4)
    measured = distortion(vertices, triangles, conformal(Surface(vertices, triangles)))
    assert measured.angle < distortion(vertices, triangles, flat).angle + 1e-6


def test_conformal_map_with_holes():
    vertices, triangles = shapes.ring()
    uv = conformal(Surface(vertices, triangles))
    assert distortion(vertices, triangles, uv).symmetric_dirichlet == pytest.approx(1, abs=1e-9)


def test_an_outline_that_would_cross_itself_is_opened():
    vertices, triangles = shapes.stairs(35, 2)  # more than once around, and so they would lie in the plane
    surface = Surface(vertices, triangles)
    flattening = Flattening(surface)
    assert flattening.crossed().all() and not certified_pieces(surface, flattening.map()).any()
    uv = conformal(surface)
    assert certified_pieces(surface, uv).all()
    assert distortion(vertices, triangles, uv).symmetric_dirichlet < 1.6


@pytest.mark.parametrize("mesh", [(33, 1), (35, 2), (40, 1)])
def test_what_is_opened_is_mirrored_with_its_surface(mesh):
    vertices, triangles = shapes.stairs(*mesh)
    vertices *= 1 + 0.1 * np.random.default_rng(0).random((len(vertices), 1))  # not symmetric by itself
    order = np.random.default_rng(1).permutation(len(vertices))
    here = conformal(Surface(vertices, triangles))
    there = conformal(Surface(vertices[order] * [-1, 1, 1], np.argsort(order)[triangles[:, ::-1]]))
    apart = np.linalg.norm(here[order][:, None] - here[order], axis=2) - np.linalg.norm(there[:, None] - there, axis=2)
    assert np.abs(apart).max() < 1e-9 * np.ptp(here)


def test_what_does_not_cross_itself_is_not_opened():
    for mesh in (shapes.random_disk(1), shapes.grid(), shapes.stairs(20, 2)):
        flattening = Flattening(Surface(*mesh))
        assert not flattening.crossed().any()
        np.testing.assert_array_equal(conformal(Surface(*mesh)), flattening.map())


def test_what_half_a_circle_does_not_open_stays_as_it_is():
    flattening = Flattening(Surface(*shapes.stairs(400)))  # around twelve times
    np.testing.assert_array_equal(flattening.opened(flattening.crossed()), flattening.map())
    assert distortion(*shapes.stairs(400), flattening.map()).symmetric_dirichlet < 1.01


def test_projection_sees_the_front_of_a_flat_patch():
    vertices, triangles = shapes.random_disk(5)
    surface = Surface(vertices @ shapes.rotation(6).T + 4, triangles)
    uv = project(surface)
    assert (signed_areas(uv[triangles]) > 0).all()
    assert distortion(vertices, triangles, uv).symmetric_dirichlet == pytest.approx(1, abs=1e-9)


def test_fit_undoes_similarities_and_mirrors():
    rng = np.random.default_rng(7)
    points = rng.random((20, 2))
    chosen = np.arange(20) < 6
    for mirror in (1, -1):
        targets = 3 * (points * [mirror, 1]) @ [[0.8, 0.6], [-0.6, 0.8]] + 2
        np.testing.assert_allclose(fit(points, chosen, targets, mirror=True), targets, atol=1e-12)
    np.testing.assert_allclose(fit(np.zeros((20, 2)), chosen, targets)[0], targets[chosen].mean(axis=0))


def test_what_is_opened_is_so_in_any_company():
    meshes = shapes.stairs(2000), cut_ruffle(3, 41, 8), shapes.stairs(1500)  # the others cross themselves everywhere
    together = Surface(*joined(*zip(*meshes, strict=True)))
    its = conformal(together)[together.vertex_piece == 1]
    here = conformal(Surface(*meshes[1]))
    apart = np.linalg.norm(here[:, None] - here, axis=2) - np.linalg.norm(its[:, None] - its, axis=2)
    assert np.abs(apart).max() < 1e-9 * np.ptp(here)


def cut_ruffle(waves=9, around=161, across=25):
    """A disk with waves, cut open from its small hole to its rim by a cut whose sides are 1e-17 apart."""
    angle, radius = np.meshgrid(np.linspace(0, 2 * np.pi, around), np.linspace(0.02, 1, across), indexing="ij")
    height = 0.6 * radius * np.sin(waves * angle)
    vertices = np.column_stack([each.ravel() for each in (radius * np.cos(angle), radius * np.sin(angle), height)])
    corner = np.add.outer(across * np.arange(around - 1), np.arange(across - 1)).ravel()
    up = corner + across
    return vertices, np.vstack([np.column_stack([corner, up, up + 1]), np.column_stack([corner, up + 1, corner + 1])])


def test_a_start_is_certified_where_it_is_in_the_end():
    # Around zero 32-bit floats tell the sides of the cut apart, in the unit square they do not.
    report = unwrap(*cut_ruffle()).report
    assert report.injective and report.converged


def comb(size=60, every=4):
    """A flat plate of so many quads a side, with cuts of no width that reach from one side nearly to the other."""
    vertices, triangles = shapes.grid(size, size)
    row, column = np.divmod(np.arange(len(vertices)), size + 1)
    cut = (column % every == 0) & (column > 0) & (column < size) & (row < size - 3)
    right = column[triangles] < column[triangles].max(axis=1, keepdims=True)
    triangles = triangles + len(vertices) * (cut[triangles] & right)
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used % len(vertices)], triangles.reshape(-1, 3)


def test_what_must_be_opened_far_does_not_begin_with_that():
    report = unwrap(*comb()).report
    assert report.injective and report.after.symmetric_dirichlet < 1.005


def test_only_what_is_all_but_flat_is_projected(monkeypatch):
    def tried(*mesh):
        found = []
        monkeypatch.setattr(starts, "project", lambda surface: found.append(surface) or project(surface))
        finished(starts.best_start(Surface(*mesh), Settings()))
        return bool(found)

    vertices, triangles = shapes.random_disk(3)
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    assert tried(vertices @ turned.T, triangles)
    ring, of_ring = shapes.ring(20, 3)
    assert tried(ring * [1, 1, 0.01], of_ring) and not tried(*shapes.hemisphere(8))


@pytest.mark.parametrize("seed", [1063, 10511])
def test_what_is_folded_begins_with_its_shadow_where_nothing_else_is_good(seed):
    fan = Patches()(seed, largest=1500)[1:]
    report = unwrap(*fan).report
    assert report.converged and report.iterations < 10 and report.after.symmetric_dirichlet < 1.05
