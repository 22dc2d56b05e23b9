# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import (
    Result,
    Settings,
    Shape,
    Surface,
    course,
    distortion,
    errors,
    unwrap,
    unwrap_islands,
    unwrapping,
)
from qh_unwrap.core.delaunay import triangulate
from qh_unwrap.core.initial import fit
from qh_unwrap.core.stepping import finished

from . import shapes
from .overlaps import is_clean
from .patches import Patches

SAME = 1e-4  # of an island's size, what may lie between two unwraps of it


def together(islands, **settings):
    """The results of islands, (vertices, triangles) or more of what makes a shape."""
    return finished(unwrap_islands([Shape(*island) for island in islands], Settings(**settings)))


def apart(uv, other):
    """The largest distance of a vertex in two maps, one brought to the other by a similarity, by their size."""
    fitted = fit(uv, np.ones(len(uv), bool), other)
    return np.linalg.norm(fitted - other, axis=1).max() / np.ptp(other, axis=0).max()


def assert_alike(result, alone):
    one, other = result.report, alone.report
    assert (one.injective, one.warnings) == (other.injective, other.warnings)
    if other.converged:
        assert (one.iterations, one.converged) == (other.iterations, True)
        assert apart(result.uv, alone.uv) < SAME
    else:  # on so long a way rounding grows
        assert one.after.symmetric_dirichlet == pytest.approx(other.after.symmetric_dirichlet, rel=5e-3)


@pytest.fixture(scope="module")
def small():
    """Random disks of up to 150 triangles, and some with a hole."""
    patches = Patches()
    return [patches(seed, largest=150)[1:] for seed in range(120)] + [shapes.ring(12, k) for k in (1, 2, 4)]


@pytest.fixture(scope="module")
def curved():
    """Islands of many sizes that take different ways: flat, hilly, ragged, with holes; none of them symmetric."""
    patches = Patches()
    made = [shapes.bump(k, inner=20 * k, outer=12 + 2 * k, height=0.4 * k) for k in range(1, 6)]
    made += [shapes.random_disk(1), skewed(*shapes.ring(20, 3)), skewed(*shapes.hemisphere(5))]
    made.append(shapes.developable("spiral"))
    return made + [patches(seed, largest=400)[1:] for seed in range(300, 320)]


def skewed(vertices, triangles):
    x, y, z = vertices.T
    return np.column_stack([x + 0.1 * np.sin(y + 1), 1.2 * y + 0.1 * x * x, z + 0.3 * np.sin(3 * x) * y]), triangles


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"refine": 0},
        # How exactly an island is solved still depends on company.
        {"initial": "MEAN_VALUE"},
        # A flat island is refined that needs nothing, if others do.
        {"boundary": "CIRCLE"},
        {"boundary": "CIRCLE", "fill_holes": False, "balance": 0.5},
        {"boundary": "OUTLINE", "weights": "MEAN_VALUE"},
        {"boundary": "CIRCLE", "weights": "STRETCH", "iterations": 3},
    ],
    ids=str,
)
def test_every_island_is_as_it_is_alone(curved, settings):
    order = np.random.default_rng(0).permutation(len(curved))
    results, shuffled = together(curved, **settings), together([curved[k] for k in order], **settings)
    for k, mesh in enumerate(curved):
        alone = unwrap(*mesh, Settings(**settings))
        for result in (results[k], shuffled[np.flatnonzero(order == k)[0]]):
            assert_alike(result, alone)


def test_pins_and_kept_outlines_are_those_of_each_island(curved):
    islands = []
    for k, (vertices, triangles) in enumerate(curved[:6]):
        uv = vertices[:, :2] @ [[0.8, 0.6], [-0.6, 0.8]] * [(-1) ** k, 1] + k
        pinned = np.zeros(len(uv), bool)
        pinned[[1, 5, 9]] = k % 2
        islands.append((vertices, triangles, uv, pinned))
    for boundary in ("FREE", "KEEP"):
        for island, result in zip(islands, together(islands, boundary=boundary), strict=True):
            alone = unwrap(*island[:2], Settings(boundary=boundary), *island[2:])
            np.testing.assert_array_equal(result.uv[island[3]], island[2][island[3]])
            assert result.report.mirrored == alone.report.mirrored
            assert np.abs(result.uv - alone.uv).max() < SAME * np.ptp(alone.uv, axis=0).max()


def test_small_islands_are_certified_and_as_they_are_alone(small):
    results = together(small)
    assert sum(result.report.converged for result in results) > 0.9 * len(small)
    for (vertices, triangles), result in zip(small, results, strict=True):
        assert all(np.array_equal(*pair) for pair in zip(result.loops, Surface(vertices, triangles).loops, strict=True))
        assert result.report.injective and is_clean(result.uv, triangles)
        measured = distortion(vertices, triangles, result.uv)
        assert measured.to_dict() == pytest.approx(result.report.after.to_dict(), rel=1e-9)
        assert_alike(result, unwrap(vertices, triangles))


def test_what_goes_together_does_not_change_the_result(small):
    for one, other in zip(together(small[:7]), together(small), strict=False):
        assert apart(one.uv, other.uv) < SAME


def test_only_what_cannot_be_unwrapped_has_errors(monkeypatch):
    monkeypatch.setattr(unwrapping, "_TOGETHER", 400)
    good, large, ring = shapes.bump(1), shapes.bump(2, inner=300), shapes.ring()
    flat = np.zeros((3, 3)), np.array([[0, 1, 2]])
    pieces = np.random.default_rng(0).random((6, 3)), np.array([[0, 1, 2], [3, 4, 5]])
    assert len(large[1]) > 400 > len(good[1])
    islands = [good, shapes.tetrahedron(), large, good, ring, flat, good, pieces, shapes.torus(open=True)]
    results = together(islands)
    kinds = [Result, errors.ClosedError, *[Result] * 3, errors.DegenerateError, Result, errors.DisconnectedError]
    assert [type(result) for result in results] == [*kinds, errors.GenusError]
    for mesh, result in zip(islands, results, strict=True):
        if isinstance(result, Result):
            assert result.report.injective and apart(result.uv, unwrap(*mesh).uv) < SAME
    assert together([]) == []


def test_triangles_of_uneven_length_are_the_fault_of_one_island():
    good = shapes.bump(1)
    results = together([good, (good[0], [[0, 1, 2], [0, 1]])])
    assert [type(result) for result in results] == [Result, errors.ShapeError]


def test_islands_whose_outlines_cannot_be_held_have_errors():
    square = shapes.grid(1, 1)
    triangle = np.eye(3), np.array([[0, 1, 2]])
    results = together([square, triangle, shapes.tetrahedron(), square], boundary="RECTANGLE")
    assert [type(result) for result in results] == [Result, errors.BoundaryError, errors.ClosedError, Result]
    results = together([square, (*square, square[0][:, :2])], boundary="KEEP")
    assert [type(result) for result in results] == [errors.UVError, Result]


@pytest.mark.parametrize("raised, named", [(MemoryError, errors.OutOfMemoryError), (KeyError, errors.InternalError)])
def test_whatever_goes_wrong_is_the_fault_of_one_island(raised, named, capsys):
    islands = [shapes.bump(k) for k in range(5)]
    islands[3] = shapes.bump(3, inner=150, outer=31)

    def fails(points, sides):
        if len(sides) == 31:
            raise raised
        return triangulate(points, sides)

    shapes_of = [Shape(*island) for island in islands]
    results = finished(unwrap_islands(shapes_of, Settings(refine=0), fails))
    assert [type(result) for result in results] == [*[Result] * 3, named, Result]
    assert ("KeyError" in capsys.readouterr().err) == (named is errors.InternalError)


def test_shares_rise_to_one():
    islands = [Shape(*shapes.bump(k, inner=60 * k)) for k in range(1, 5)]
    shares = list(unwrap_islands(islands))
    assert len(shares) > 4 and shares[-1] == pytest.approx(1)
    assert (np.diff([0.0, *shares]) > 0).all()


def test_settings_that_exclude_each_other_are_refused():
    with pytest.raises(errors.SettingsError, match="COTANGENT"):
        together([shapes.bump(1)], weights="MEAN_VALUE")


def test_given_uvs_are_measured_first():
    vertices, triangles = shapes.bump(3)
    uv = vertices[:, :2] * [2, 1]
    given, new = together([(vertices, triangles, uv), (vertices, triangles, None)])
    assert given.report.before.to_dict() == pytest.approx(distortion(vertices, triangles, uv).to_dict(), rel=1e-12)
    assert new.report.before is None


def test_what_bulges_far_is_drawn_near_within_its_outline():
    # In one batch with a flatter one, which needs fewer iterations, and a flat one, which needs none.
    islands = [shapes.bulb(length=10), shapes.bulb(length=14), shapes.grid()]

    def no_air(*_):
        raise AssertionError("air is not needed")

    results = finished(unwrap_islands([Shape(*island) for island in islands], Settings(), no_air))
    for island, result in zip(islands, results, strict=True):
        assert result.report.injective and result.report.converged
        assert_alike(result, unwrap(*island))
        in_air = unwrap(*island, Settings(initial="MEAN_VALUE"))
        energies = (each.report.after.symmetric_dirichlet for each in (result, in_air))
        assert next(energies) <= next(energies) * (1 + 1e-3)


def with_hole(vertices, triangles):
    return vertices, np.delete(triangles, len(triangles) // 2, axis=0)


def with_flat_face(vertices, triangles):
    a, b, c = triangles[len(triangles) // 2]
    m = len(vertices)
    rest = np.delete(triangles, len(triangles) // 2, axis=0)
    return np.vstack([vertices, (vertices[a] + vertices[b]) / 2]), np.vstack([rest, [(a, m, c), (m, b, c), (m, a, b)]])


@pytest.mark.parametrize(("change", "balance"), [(with_hole, 0.25), (with_flat_face, 0.25), (lambda *mesh: mesh, 0.1)])
def test_what_the_outline_would_spoil_is_not_held_by_it(monkeypatch, change, balance):
    def drawn_near(*_):
        raise AssertionError("it is held")

    monkeypatch.setattr(course.Course, "_drawn_near", drawn_near)
    assert unwrap(*change(*shapes.bulb()), Settings(balance=balance)).report.injective
