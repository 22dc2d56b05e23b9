# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of which many vertices have been put in one place: systems on them must stay solvable."""

import numpy as np
import pytest

from qh_unwrap.core import Settings, unwrap

from . import shapes

_SETTINGS = {
    "circle": Settings(boundary="CIRCLE"),
    "circle, one iteration": Settings(boundary="CIRCLE", iterations=1, refine=10),
    "hull of a projection": Settings(boundary="OUTLINE", initial="PROJECTION", refine=10),
    "free from conformal": Settings(initial="CONFORMAL", iterations=1, refine=10, fill_holes=False),
}
_SHAPES = {
    "ring": shapes.ring(8, 2),
    "wide ring": shapes.ring(13, 4),
    "grid": shapes.grid(7, 5),
    "half-sphere": shapes.hemisphere(3),
}


def collapsed(vertices, triangles, seed, share):
    """The surface with a part of its vertices, chosen at random, where its first vertex is."""
    chosen = np.random.default_rng(seed).random(len(vertices)) < share
    return np.where(chosen[:, None], vertices[0], vertices), triangles


def cap(around=16):
    """A flat cone whose tip is a hole: as many vertices in one place as there are on the rim."""
    angle, k = 2 * np.pi * np.arange(around) / around, np.arange(around)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    following = (k + 1) % around
    outer, inner = (k, following, around + k), (following, around + following, around + k)
    return np.vstack([rim, np.tile([0, 0, 0.3], (around, 1))]), np.vstack(
        [np.column_stack(outer), np.column_stack(inner)]
    )


@pytest.mark.parametrize("seed, share", [(0, 0.3), (0, 0.5), (1, 0.5), (2, 0.3), (2, 0.5), (3, 0.5)])
@pytest.mark.parametrize("name", _SHAPES)
@pytest.mark.parametrize("settings", _SETTINGS.values(), ids=_SETTINGS)
def test_vertices_in_one_place(settings, name, seed, share):
    vertices, triangles = _SHAPES[name]
    result = unwrap(*collapsed(vertices, triangles, seed, share), settings, uv=vertices[:, :2])
    assert np.isfinite(result.uv).all() and np.isfinite(result.report.after.symmetric_dirichlet)
    assert any("zero area" in warning for warning in result.report.warnings)


@pytest.mark.parametrize(
    "settings",
    [
        # The refinement turns over faces without area that were not turned over before.
        pytest.param(its, id=name)
        for name, its in _SETTINGS.items()
    ],
)
def test_tip_of_a_cone_as_a_hole(settings):
    result = unwrap(*cap(), settings)
    assert np.isfinite(result.uv).all()
    assert (result.report.after.flips, result.report.after.collapsed) == (0, 0)
