# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import Settings, Surface, unwrap
from qh_unwrap.core.energy import energies

from . import shapes


def tube(sides, length, capped):
    """A tube of radius 1, open at the bottom, and at the top if it is not capped."""
    rings = max(2, round(length * sides / (2 * np.pi)))
    level, around = np.meshgrid(np.arange(rings + 1), np.arange(sides), indexing="ij")
    angle = 2 * np.pi * around / sides
    vertices = np.column_stack([np.cos(angle).ravel(), np.sin(angle).ravel(), length / rings * level.ravel()])
    start = (sides * level + around)[:-1].ravel()
    end = (sides * level + (around + 1) % sides)[:-1].ravel()
    triangles = np.vstack(
        [np.column_stack([start, end, end + sides]), np.column_stack([start, end + sides, start + sides])]
    )
    if capped:
        rim = sides * rings + np.arange(sides)
        triangles = np.vstack([triangles, np.column_stack([rim, np.roll(rim, -1), np.full(sides, len(vertices))])])
        vertices = np.vstack([vertices, [0, 0, length]])
    return vertices, triangles


def by_rings(vertices, length):
    """The linear layout: every ring as far outside the next one as it lies below it."""
    radius = np.where(np.hypot(*vertices[:, :2].T) > 0, 1 + length - vertices[:, 2], 0)
    angle = np.arctan2(vertices[:, 1], vertices[:, 0])
    return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("sides", [16, 32])
@pytest.mark.parametrize("length", [25, 50, 100, 200])
@pytest.mark.parametrize("capped", [True, False])
def test_tubes_end_certified_near_or_below_the_linear_layout(sides, length, capped):
    vertices, triangles = tube(sides, length, capped)
    linear = by_rings(vertices, length)
    surface = Surface(vertices, triangles)
    result = unwrap(vertices, triangles)
    assert result.report.injective and not result.report.after.collapsed
    assert energies(surface, result.uv, 0.25)[0] < 1.01 * energies(surface, linear, 0.25)[0]


@pytest.mark.parametrize("boundary", ["CIRCLE", "RECTANGLE"])
def test_tubes_within_a_convex_outline_have_no_flips(boundary):
    result = unwrap(*tube(16, 60, True), Settings(boundary=boundary))
    assert result.report.injective


def test_a_plate_with_a_tower():
    vertices, triangles = shapes.grid(20, 20, width=8, height=8)
    middle = vertices[:, :2] - 4
    high = np.flatnonzero(np.abs(middle).max(axis=1) < 1e-6)
    assert len(high) == 1
    radius = np.linalg.norm(middle, axis=1)
    vertices[:, 2] = 50 * np.clip(1.2 - radius, 0, None)
    result = unwrap(vertices, triangles)
    assert result.report.injective


def test_a_tree_of_tubes():
    """Two capped tubes on a plate, side by side."""
    vertices, triangles = shapes.grid(30, 20, width=6, height=4)
    x, y = vertices[:, 0], vertices[:, 1]
    for centre in (1.6, 4.4):
        inside = np.hypot(x - centre, y - 2)
        vertices[:, 2] += 40 * np.clip(1 - inside, 0, None)
    result = unwrap(vertices, triangles)
    assert result.report.injective


def test_rings_are_a_start_like_others():
    vertices, triangles = tube(16, 20, True)
    for boundary in ("FREE", "CIRCLE"):
        start = unwrap(vertices, triangles, Settings(boundary=boundary, initial="RINGS", iterations=0, refine=0))
        assert start.report.injective
        assert start.report.after.symmetric_dirichlet < 10
