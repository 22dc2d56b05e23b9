# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import (
    RelaxSettings,
    Settings,
    Shape,
    StraightenSettings,
    distortion,
    errors,
    relax_islands,
    straighten_islands,
    unwrap,
)
from qh_unwrap.core.relaxing import rim
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.straightening import Polygons, rectangle, straight_lines
from qh_unwrap.core.triangles import signed_areas

from . import borders, shapes

SHEAR = np.array([[1.3, 0.4], [0.1, 0.7]])


def sheared(seed=0):
    """A bump, and a map of it that is sheared."""
    vertices, triangles = shapes.bump(seed)
    return vertices, triangles, unwrap(vertices, triangles, Settings(refine=0)).uv @ SHEAR.T


def relaxed(shape, **settings):
    (result,) = finished(relax_islands([shape], RelaxSettings(**settings)))
    return result


def outline_of(vertices, triangles):
    pinned = np.zeros(len(vertices), bool)
    pinned[rim(triangles, len(vertices))] = True
    return pinned


def energy(vertices, triangles, uv):
    return distortion(vertices, triangles, uv).symmetric_dirichlet


def test_what_is_pinned_stays_and_the_energy_falls_from_step_to_step():
    vertices, triangles, uv = sheared()
    pinned, now, values = outline_of(vertices, triangles), uv, [energy(vertices, triangles, uv)]
    for _ in range(6):
        result = relaxed(Shape(vertices, triangles, now, pinned), steps=1)
        assert np.array_equal(result.uv[pinned], uv[pinned]) and result.report.injective
        now = result.uv
        values.append(energy(vertices, triangles, now))
    assert (np.diff(values) <= 1e-12).all() and values[1] < values[0] - 0.01
    far = relaxed(Shape(vertices, triangles, uv, pinned), steps=100)
    assert values[-1] == pytest.approx(energy(vertices, triangles, far.uv), rel=2e-3)


@pytest.mark.parametrize("mirror", [1, -1])
def test_a_loose_island_keeps_its_place_size_turn_and_mirroring(mirror):
    vertices, triangles, uv = sheared()
    uv = uv * (mirror, 1) * 3 + (5, -2)
    result = relaxed(Shape(vertices, triangles, uv), move_outline=True)
    assert result.report.mirrored == (mirror < 0) and result.report.injective
    assert result.report.after.symmetric_dirichlet < result.report.before.symmetric_dirichlet - 0.05
    before, after = (signed_areas(each[triangles]).sum() for each in (uv, result.uv))
    assert after == pytest.approx(before)
    turn = np.vdot((uv - uv.mean(axis=0)) @ (1, 1j), (result.uv - result.uv.mean(axis=0)) @ (1, 1j))
    assert abs(np.angle(turn)) < 0.1
    again = relaxed(Shape(vertices, triangles, result.uv), move_outline=True)
    assert np.abs(again.uv - result.uv).max() < 0.02


@pytest.mark.parametrize(("direction", "kept"), [("U", 1), ("V", 0)])
def test_one_direction(direction, kept):
    vertices, triangles, uv = sheared()
    pinned = outline_of(vertices, triangles)
    held = relaxed(Shape(vertices, triangles, uv, pinned), direction=direction)
    free = relaxed(Shape(vertices, triangles, uv), direction=direction, move_outline=True)
    for result in (held, free):
        assert np.array_equal(result.uv[:, kept], uv[:, kept]) and result.report.injective
    assert energy(vertices, triangles, free.uv) < energy(vertices, triangles, held.uv) < energy(vertices, triangles, uv)


def test_a_blend_of_valid_maps_is_valid():
    vertices, triangles, uv = sheared()
    pinned = outline_of(vertices, triangles)
    far = relaxed(Shape(vertices, triangles, uv, pinned)).uv
    half = relaxed(Shape(vertices, triangles, uv, pinned), blend=0.5)
    assert np.allclose(half.uv, (uv + far) / 2) and half.report.injective
    assert np.array_equal(relaxed(Shape(vertices, triangles, uv, pinned), blend=0.0).uv, uv)


def test_a_tangled_map_comes_right_and_one_without_room_is_an_error():
    vertices, triangles, uv, count = borders.tangled("general", 3)
    pinned = np.arange(len(uv)) < count
    assert relaxed(Shape(vertices, triangles, uv, pinned)).report.injective
    uv[:count] = uv[:count][::-1] if count % 2 else np.roll(uv[:count], 1, axis=0)
    uv[[0, 3]] = uv[[3, 0]]
    result = relaxed(Shape(vertices, triangles, uv, pinned))
    assert isinstance(result, errors.UVError) and "crosses itself" in str(result)


def test_flips_are_an_error_where_one_coordinate_stays():
    vertices, triangles, uv, _ = borders.tangled("convex", 0)
    result = relaxed(Shape(vertices, triangles, uv), direction="U")
    assert isinstance(result, errors.UVError) and "in both directions first" in str(result)


def quads(size=8):
    """A hilly grid of quads: vertices, triangles, a turned map, and its `Polygons`."""
    side = np.arange(size + 1) / size
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    vertices = np.column_stack([x, y, 0.2 * np.sin(4 * x) * np.cos(3 * y)])
    first = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    faces = np.column_stack([first, first + 1, first + size + 2, first + size + 1])
    triangles = np.vstack([faces[:, :3], faces[:, [0, 2, 3]]])
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    polygons = Polygons(faces.ravel(), np.roll(faces, -1, axis=1).ravel(), np.repeat(np.arange(len(faces)), 4))
    return vertices, triangles, vertices[:, :2] @ turn.T, polygons


def straightened(mesh, straight):
    vertices, triangles, uv, _ = mesh
    shape = Shape(vertices, triangles, straight.values, straight.held, start=uv)
    (result,) = finished(straighten_islands([shape], StraightenSettings()))
    assert np.array_equal(result.uv[straight.held], straight.values[straight.held])
    assert result.report.injective
    assert result.report.before.symmetric_dirichlet == pytest.approx(energy(vertices, triangles, uv))
    return result.uv


def test_loops_go_straight_on_over_crossings():
    mesh = vertices, _, uv, polygons = quads()
    nothing = np.zeros(uv.shape, bool)
    row, column = (polygons.start // 9 == polygons.end // 9), (polygons.start % 9 == polygons.end % 9)
    selected = (row & (polygons.start // 9 == 4)) | (column & (polygons.start % 9 == 2))
    straight = straight_lines(polygons, vertices, uv, selected, nothing)
    assert straight.held.sum(axis=0).tolist() == [9, 9]
    new = straightened(mesh, straight).reshape(9, 9, 2)
    assert len(np.unique(new[4, :, 1])) == 1 and len(np.unique(new[:, 2, 0])) == 1


def test_two_rows_are_two_lines_and_parallel_ones_that_meet_are_one():
    vertices, _, uv, polygons = quads()
    nothing = np.zeros(uv.shape, bool)
    row = polygons.start // 9 == polygons.end // 9
    both = row & np.isin(polygons.start // 9, (2, 6))
    straight = straight_lines(polygons, vertices, uv, both, nothing)
    assert len(np.unique(straight.values[straight.held[:, 1], 1])) == 2
    corner = (row & (polygons.start // 9 == 4)) | ((polygons.start % 9 == polygons.end % 9) & (polygons.start % 9 == 4))
    together = straight_lines(polygons, vertices, uv, corner, nothing, along="U")
    assert len(np.unique(together.values[together.held[:, 1], 1])) == 1, "they cross, so they are one line"


def test_lines_that_would_flatten_a_triangle_are_an_error():
    vertices, triangles, uv, polygons = quads()
    around = np.isin(polygons.face, [27])
    straight = straight_lines(polygons, vertices, uv, around, np.zeros(uv.shape, bool), along="U")
    shape = Shape(vertices, triangles, straight.values, straight.held, start=uv)
    (result,) = finished(straighten_islands([shape]))
    assert isinstance(result, errors.UVError) and "2 of its triangles would become flat" in str(result)


def test_a_closed_loop_cannot_be_straight():
    vertices, _, uv, polygons = quads()
    square = {30, 31, 32, 41, 50, 49, 48, 39}
    selected = np.isin(polygons.start, list(square)) & np.isin(polygons.end, list(square))
    # Its corners end lines: four of them.
    assert straight_lines(polygons, vertices, uv, selected, np.zeros(uv.shape, bool)).held.sum() == 12
    around = 12
    angle = 2 * np.pi * np.arange(around) / around
    tube = np.vstack([np.column_stack([np.cos(angle), np.sin(angle), np.full(around, z)]) for z in (0, 1, 2)])
    faces = np.array(
        [
            (around * j + i, around * j + (i + 1) % around, around * (j + 1) + (i + 1) % around, around * (j + 1) + i)
            for j in range(2)
            for i in range(around)
        ]
    )
    polygons = Polygons(faces.ravel(), np.roll(faces, -1, axis=1).ravel(), np.repeat(np.arange(len(faces)), 4))
    selected = (polygons.start // around == 1) & (polygons.end // around == 1)
    ring = tube[:, :2] * (1 + tube[:, 2:])
    with pytest.raises(errors.UVError, match="closed cannot become straight"):
        straight_lines(polygons, tube, ring, selected, np.zeros(ring.shape, bool))


def test_a_grid_becomes_a_rectangle_with_straight_rows():
    mesh = vertices, _, uv, polygons = quads()
    chosen = np.isin(polygons.face, [8 * j + i for j in range(2, 6) for i in range(1, 7)])
    straight = rectangle(polygons, vertices, uv, chosen, np.zeros(uv.shape, bool))
    assert straight.held.all(axis=1).sum() == 5 * 7
    new = straightened(mesh, straight).reshape(9, 9, 2)[2:7, 1:8]
    assert all(len(np.unique(new[k, :, 1])) == 1 for k in range(5)) and len(np.unique(new[..., 0])) == 7


def test_of_what_is_no_grid_the_border_becomes_a_rectangle_between_pins():
    vertices, triangles = shapes.grid(6, 4, width=3, height=2)
    uv = vertices[:, :2] @ SHEAR.T
    polygons = Polygons(
        triangles.ravel(), np.roll(triangles, -1, axis=1).ravel(), np.repeat(np.arange(len(triangles)), 3)
    )
    pinned = np.zeros(uv.shape, bool)
    with pytest.raises(errors.BoundaryError, match="it has 2 corners"):
        rectangle(polygons, vertices, uv, np.ones(len(polygons.start), bool), pinned)
    uv = vertices[:, :2] * 0.5
    pinned[[0, 6, 28, 34]] = True
    straight = rectangle(polygons, vertices, uv, np.ones(len(polygons.start), bool), pinned)
    assert straight.held.all(axis=1).sum() == 20
    assert np.array_equal(straight.values[[0, 6, 28, 34]], uv[[0, 6, 28, 34]])
    assert np.ptp(straight.values[straight.held[:, 0]], axis=0) == pytest.approx([1.5, 1.0])
