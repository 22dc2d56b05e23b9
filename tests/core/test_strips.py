# SPDX-License-Identifier: GPL-3.0-or-later
"""Long narrow strips, which wind over themselves when laid flat."""

import numpy as np
import pytest

from qh_unwrap.core import Surface, unwrap
from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.energy import energies
from qh_unwrap.core.strips import strip_outlines

from . import shapes

EVERYTHING = np.ones(1, bool)


def eared(count):
    """Stairs of so many quads with a triangle more at every third step, on the outer side."""
    vertices, triangles = shapes.stairs(count)
    one = 2 * np.arange(0, count, 3) + 1
    tips = (vertices[one] + vertices[one + 2]) / 2 * (1.1, 1.1, 1)
    more = np.column_stack([one, one + 2, len(vertices) + np.arange(len(one))])
    return np.vstack([vertices, tips]), np.vstack([triangles, more])


@pytest.mark.parametrize("across", [1, 2])
def test_a_strip_is_laid_straight_one_to_one(across):
    vertices, triangles = shapes.stairs(1000, across)
    surface = Surface(vertices, triangles)
    found, places = strip_outlines(surface, EVERYTHING)
    assert found.all()
    places = places[surface.loops[0]]
    long, wide = np.ptp(places[:, 0]), 2 * np.median(np.abs(places[:, 1]))
    assert long * wide == pytest.approx(1, rel=1e-3)  # the strip's area
    assert long == pytest.approx(surface.outline_lengths[0] / 2)
    assert is_injective(places, np.empty((0, 3), int), [np.arange(len(places))])


def test_triangles_that_stand_out_are_not_flattened():
    vertices, triangles = eared(600)
    surface = Surface(vertices, triangles)
    found, places = strip_outlines(surface, EVERYTHING)
    assert found.all()
    # All vertices are on the outline.
    assert len(surface.loops[0]) == len(vertices)
    assert energies(surface, places, 0.25)[0] < 2
    result = unwrap(vertices, triangles)
    assert result.report.injective and result.report.converged


def legs(count):
    """A triangle with a strip of so many quads along each of its sides."""
    angle = 2 * np.pi * np.arange(3) / 3
    vertices, triangles = [np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])], [[[0, 1, 2]]]
    for one, other in ((0, 1), (1, 2), (2, 0)):
        outward = vertices[0][one] + vertices[0][other]
        start = 3 + 2 * count * one
        number = np.vstack([[[one, other]], start + np.arange(2 * count).reshape(-1, 2)])
        vertices.append((vertices[0][[one, other]] + np.arange(1, count + 1)[:, None, None] * outward).reshape(-1, 3))
        (a, b), (c, d) = number[:-1].T, number[1:].T
        triangles += [np.column_stack([b, a, c]), np.column_stack([b, c, d])]
    return np.vstack(vertices), np.vstack(triangles)


def test_what_is_short_or_branches_is_no_strip():
    for mesh in (shapes.stairs(60), shapes.grid(20, 20)):
        assert not strip_outlines(Surface(*mesh), EVERYTHING)[0].any()
    vertices, triangles = legs(500)
    for seed in range(8):  # of three legs as long, any may be taken for a strip's sides
        order = np.random.default_rng(seed).permutation(len(vertices))
        branching = Surface(vertices[order], np.argsort(order)[triangles])
        assert not strip_outlines(branching, EVERYTHING)[0].any()


@pytest.mark.parametrize("mirror", [1, -1])
def test_a_single_edge_is_no_side_of_a_strip(mirror):
    count = 40
    along = np.linspace(0, 1, count)
    vertices = np.column_stack([along, mirror * 1e-3 * along * (1 - along), 0 * along])
    k = np.arange(1, count - 1)
    triangles = np.column_stack([0 * k, k + 1, k])[:, ::mirror]
    assert not strip_outlines(Surface(vertices, triangles), EVERYTHING)[0].any()


def test_sides_of_a_strip_may_have_different_lengths():
    vertices, triangles = shapes.stairs(2000, width=1)  # one is twice as long as the other
    assert strip_outlines(Surface(vertices, triangles), EVERYTHING)[0].all()
    report = unwrap(vertices, triangles).report
    assert report.injective and report.converged and report.iterations <= 10


def test_a_strip_that_was_not_asked_for_is_none():
    assert not strip_outlines(Surface(*shapes.stairs(1000)), ~EVERYTHING)[0].any()


@pytest.mark.parametrize("across", [1, 2])
def test_long_stairs_end_at_the_least_energy_in_a_few_steps(across):
    result = unwrap(*shapes.stairs(1000, across))
    report = result.report
    assert report.injective and report.converged
    assert report.iterations <= 10
    assert report.after.symmetric_dirichlet < 1.03


def test_a_strip_with_a_hole():
    vertices, triangles = shapes.stairs(1000, 3)
    inner = 6 * 500 + 2 + np.array([0, 1])  # the two triangles of a quad in the middle of the strip
    kept = np.ones(len(triangles), bool)
    kept[[inner[0] // 2, len(triangles) // 2 + inner[0] // 2]] = False
    surface = Surface(vertices, triangles[kept])
    assert len(surface.loops) == 2
    result = unwrap(vertices, triangles[kept])
    assert result.report.injective and result.report.converged
