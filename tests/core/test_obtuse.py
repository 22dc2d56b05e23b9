# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np

from qh_unwrap.core import Settings, Surface, has_positive_weights, refine_obtuse, unwrap
from qh_unwrap.core.obtuse import negative_edges

from . import shapes


def test_refined_surfaces_have_positive_weights_and_the_same_shape():
    for seed in range(5):
        vertices, triangles = shapes.bump(seed)
        surface = Surface(vertices, triangles)
        assert not has_positive_weights(surface)
        refined, parents = refine_obtuse(surface)
        assert has_positive_weights(refined)
        moved = refined.vertices[: len(vertices)] - surface.vertices
        np.testing.assert_allclose(moved, moved[[0]] * np.ones((len(moved), 1)), atol=1e-12)  # about its own middle
        np.testing.assert_allclose(np.bincount(parents, refined.area), surface.area, rtol=1e-9)


def test_a_harmonic_map_of_the_refined_surface_has_no_flips():
    vertices, triangles = shapes.bump(3, inner=300)
    surface = Surface(vertices * [1, 0.2, 1], triangles)
    refined, _ = refine_obtuse(surface)
    result = unwrap(
        refined.vertices, refined.triangles, Settings(boundary="CIRCLE", initial="HARMONIC", iterations=0, refine=0)
    )
    assert result.report.after.flips == 0
    assert len(result.uv) > len(vertices)


def test_good_surfaces_are_left_alone_and_the_limit_holds():
    surface = Surface(*shapes.hemisphere())
    refined, parents = refine_obtuse(surface)
    assert refined is surface
    np.testing.assert_array_equal(parents, np.arange(len(surface.triangles)))
    vertices, triangles = shapes.bump(3)
    stretched = Surface(vertices * [1, 0.02, 1], triangles)
    stopped, _ = refine_obtuse(stretched, limit=1)
    assert negative_edges(stopped).any() and len(stopped.triangles) < 2.5 * len(triangles)
