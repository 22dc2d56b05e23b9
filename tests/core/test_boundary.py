# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from qh_unwrap.core import Settings, Surface, errors
from qh_unwrap.core.boundary import held_vertices
from qh_unwrap.core.loops import edge_lengths

from . import shapes


def places(surface, **settings):
    pinned = settings.pop("pinned", None)
    held, values, warnings = held_vertices(surface, Settings(**settings), pinned=pinned)
    assert held.sum() == len(surface.loops[0]) and held[surface.loops[0]].all()
    return values[surface.loops[0]], warnings


def assert_convex_and_counter_clockwise(points, strictly):
    ahead = np.roll(points, -1, axis=0) - points
    after = np.roll(ahead, -1, axis=0)
    turn = ahead[:, 0] * after[:, 1] - ahead[:, 1] * after[:, 0]
    assert (turn > 0).all() if strictly else (turn > -1e-12).all()


def test_circle_is_spaced_by_arc_length():
    surface = Surface(*shapes.bump(1))
    points, _ = places(surface, boundary="CIRCLE")
    np.testing.assert_allclose(np.linalg.norm(points - 0.5, axis=1), 0.5, rtol=1e-12)
    assert_convex_and_counter_clockwise(points, strictly=True)
    chord = edge_lengths(points)
    arc = 2 * np.arcsin(chord)
    length = edge_lengths(surface.vertices[surface.loops[0]])
    np.testing.assert_allclose(arc / (2 * np.pi), length / length.sum(), rtol=1e-9)


@pytest.mark.parametrize("aspect, shape", [(1, (1, 1)), (2, (1, 0.5)), (0.25, (0.25, 1)), (0, (1, 2 / 3))])
def test_a_rectangle_finds_the_corners_of_one(aspect, shape):
    vertices, triangles = shapes.grid(9, 6, width=3, height=2)
    vertices[:, 2] = 0.3 * np.sin(vertices[:, 0])
    bent = np.column_stack([np.interp(vertices[:, 0], [0, 3], [0, 3]), vertices[:, 1:]])
    surface = Surface(bent @ shapes.rotation(5).T, triangles)
    points, _ = places(surface, boundary="RECTANGLE", aspect=aspect)
    np.testing.assert_allclose(np.ptp(points, axis=0), shape, atol=0.05 if aspect == 0 else 0.03)
    loop = surface.loops[0].tolist()
    corners = [loop.index(k) for k in (0, 9, len(vertices) - 1, len(vertices) - 10)]
    for corner in corners:  # on two sides at once
        x, y = points[corner] / shape
        assert min(x, 1 - x) < 0.03 and min(y, 1 - y) < 0.03


def test_pins_choose_the_corners():
    surface = Surface(*shapes.bump(2))
    loop = surface.loops[0]
    pinned = np.zeros(len(surface.vertices), bool)
    chosen = loop[[1, 5, 12, 20]]
    pinned[chosen] = True
    points, _ = places(surface, boundary="RECTANGLE", pinned=pinned)
    found = {tuple(np.round(point, 9)) for point in points[[1, 5, 12, 20]]}
    assert found == {(0, 0), (1, 0), (1, 1), (0, 1)}
    pinned[loop[2]] = True
    with pytest.raises(errors.PinError):
        places(surface, boundary="RECTANGLE", pinned=pinned)


def test_a_rectangle_needs_four_vertices():
    with pytest.raises(errors.BoundaryError):
        places(Surface(np.eye(3), [[0, 1, 2]]), boundary="RECTANGLE")


def test_sides_are_bowed_only_where_an_edge_would_collapse():
    vertices, triangles = shapes.grid(5, 5)
    ear = len(vertices)  # one triangle on top of the lower side: its base joins two vertices of that side
    vertices = np.vstack([vertices, [0.5, -0.2, 0]])
    plain, warnings = places(Surface(vertices[:-1], triangles), boundary="RECTANGLE")
    assert not warnings
    assert_convex_and_counter_clockwise(plain, strictly=False)
    pinned = np.zeros(ear + 1, bool)
    pinned[[0, 5, 30, 35]] = True
    surface = Surface(vertices, np.vstack([triangles, [3, 2, ear]]))
    points, warnings = places(surface, boundary="RECTANGLE", pinned=pinned)
    assert len(warnings) == 1 and "bowed" in warnings[0]
    assert_convex_and_counter_clockwise(points, strictly=False)
    at = {v: points[k] for k, v in enumerate(surface.loops[0].tolist())}
    (ax, ay), (bx, by), (cx, cy) = at[3], at[2], at[ear]
    assert (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 1e-4


def test_outline_is_the_convex_hull_of_the_flat_view():
    vertices, triangles = shapes.random_disk(4)
    vertices[:, :2] *= [2, 1]
    surface = Surface(vertices, triangles)
    points, _ = places(surface, boundary="OUTLINE")
    assert_convex_and_counter_clockwise(points, strictly=False)
    flat = surface.vertices[surface.loops[0], :2]
    # A convex outline keeps its shape up to a similarity.
    ratio = edge_lengths(points) / edge_lengths(flat)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert points.min() >= 0 and points.max() == pytest.approx(1)


def test_an_outline_that_meets_its_hull_out_of_order_is_spread_along_it():
    # A ribbon wound up as a spiral staircase: from above the outline covers itself.
    turns, steps = 2.5, 60
    angle = np.linspace(0, 2 * np.pi * turns, steps)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0.1 * angle])
    vertices = np.vstack([0.6 * rim + [0, 0, 0.04] * angle[:, None], rim])
    k = np.arange(steps - 1)
    triangles = np.vstack([np.c_[k, k + steps, k + steps + 1], np.c_[k, k + steps + 1, k + 1]])
    surface = Surface(vertices, triangles)
    points, _ = places(surface, boundary="OUTLINE")
    assert_convex_and_counter_clockwise(points[ConvexHull(points).vertices], strictly=False)
    at = np.unwrap(np.arctan2(*(points - points.mean(axis=0)).T[::-1]))
    assert (np.diff(at) > 0).all() and at[-1] - at[0] < 2 * np.pi


def test_kept_boundaries():
    vertices, triangles = shapes.ring()
    surface = Surface(vertices, triangles)
    uv = vertices[:, :2] * [2, 1]
    pinned = np.zeros(len(uv), bool)
    pinned[2] = True
    held, values, _ = held_vertices(surface, Settings(boundary="KEEP"), uv, pinned)
    assert held.sum() == 33 and held[2]
    np.testing.assert_array_equal(values[held], uv[held])
    with pytest.raises(errors.UVError):
        held_vertices(surface, Settings(boundary="KEEP"))
    with pytest.raises(errors.PinError):
        held_vertices(surface, Settings(boundary="CIRCLE"), uv, pinned)
    with pytest.raises(errors.BoundaryError, match="no area"):
        held_vertices(surface, Settings(boundary="KEEP"), uv * [1, 0])
    crossed = uv.copy()
    a, b = surface.loops[0][[0, 5]]
    crossed[[a, b]] = crossed[[b, a]]
    with pytest.raises(errors.BoundaryError, match="crosses itself"):
        held_vertices(surface, Settings(boundary="KEEP"), crossed)
