# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as they come: faces inside out, one-sided bands, faces on top of each other, seams marked on good maps."""

import bpy  # isort: skip
import numpy as np
import pytest
from scenes import add_grid, changes, mesh_object, snapshot, uvs
from scipy.spatial import Delaunay

from qh_unwrap import last_report
from qh_unwrap.addon import layout, mesh_arrays
from qh_unwrap.core.islands import attached


def sheet(size=6):
    """Points and quads of a bumpy square."""
    x, y = np.meshgrid(np.linspace(0, 1, size + 1), np.linspace(0, 1, size + 1), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), (0.3 * np.sin(3 * x) * np.cos(2 * y + 0.4)).ravel()])
    corner = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    return points, np.column_stack([corner, corner + size + 1, corner + size + 2, corner + 1]).tolist()


def unwrapped(points, faces, uv=None, seams=(), pins=(), **options):
    """The object, after its unwrap, and the report on its islands; `pins` are corners."""
    obj = mesh_object("Mesh", points, faces)
    if uv is not None:
        layer = obj.data.uv_layers.new(name="UVMap")
        layer.uv.foreach_set("vector", np.asarray(uv, dtype=np.float32).ravel())
    for edge in obj.data.edges:
        edge.use_seam = tuple(sorted(edge.vertices)) in seams
    if len(pins):
        pinned = obj.data.attributes.new(".pn.UVMap", 'BOOLEAN', 'CORNER')
        pinned.data.foreach_set("value", np.isin(np.arange(len(obj.data.loops)), pins))
    before = snapshot(obj)
    assert bpy.ops.uv.qh_unwrap(**options) == {'FINISHED'}
    assert changes(before, snapshot(obj)) <= {"UVMap", "active UV map"}, "nothing but the UVs"
    return obj, last_report()


def of_corners(faces, values):
    """The values of the vertices at the faces' corners."""
    return np.asarray(values)[np.concatenate(faces)]


def by_vertex(faces, uv):
    """The UVs of the vertices, which have one each."""
    found = np.zeros((np.concatenate(faces).max() + 1, 2), dtype=np.float32)
    found[np.concatenate(faces)] = uv
    assert (found[np.concatenate(faces)] == uv).all()
    return found


def signed_area(corners):
    x, y = corners.T
    return (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2


# Winding


@pytest.mark.parametrize("flipped", [[7], [0], [7, 8, 13, 14], range(1, 36, 2)])
def test_faces_that_are_inside_out_do_not_matter(flipped):
    points, faces = sheet()
    straight, _ = unwrapped(points, faces)
    expected = by_vertex(faces, uvs(straight))
    mixed = [[face[0], *face[:0:-1]] if k in flipped else face for k, face in enumerate(faces)]
    obj, (report,) = unwrapped(points, mixed)
    text = f"{len(flipped)} face{' is' if len(flipped) == 1 else 's are'} inside out: turned for the unwrap"
    assert report["warnings"] == [text] and report["injective"] and report["after"]["flips"] == 0
    found = by_vertex(mixed, uvs(obj))
    assert np.abs(found - expected).max() < 1e-2
    assert sum(signed_area(corners) for corners in found[np.array(faces)]) > 0, "it is not mirrored"


def test_the_majority_is_not_mirrored():
    points, faces = sheet()
    mixed = [[face[0], *face[:0:-1]] if k < 20 else face for k, face in enumerate(faces)]
    obj, (report,) = unwrapped(points, mixed)
    assert report["warnings"] == ["16 faces are inside out: turned for the unwrap"]
    areas = [signed_area(corners) for corners in by_vertex(mixed, uvs(obj))[np.array(mixed)]]
    assert sum(area > 0 for area in areas) == 20


@pytest.mark.parametrize("triangulated", [False, True])
def test_a_moebius_band_is_cut_and_certified(triangulated):
    around, across = 40, 3
    angle, height = np.meshgrid(
        2 * np.pi * np.arange(around) / around, np.linspace(-0.4, 0.4, across + 1), indexing="ij"
    )
    radius = 2 + height * np.cos(angle / 2)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height * np.sin(angle / 2)], axis=2)

    def vertex(i, j):
        return i * (across + 1) + j if i < around else across - j

    faces = [
        [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]
        for i in range(around)
        for j in range(across)
    ]
    if triangulated:
        faces = [triangle for a, b, c, d in faces for triangle in ([a, b, c], [a, c, d])]
    obj, (report,) = unwrapped(points.reshape(-1, 3), faces)
    assert report["injective"] and report["after"]["flips"] == 0
    (warning,) = report["warnings"]
    assert warning.startswith("it is one-sided, like a Möbius band: cut at ")
    assert warning.endswith(" edges; mark a seam across it to choose where")
    kept = uvs(obj)
    bpy.ops.uv.qh_unwrap(boundary='KEEP')
    assert last_report()[0]["injective"], "it is cut at the same place again"
    assert np.ptp(uvs(obj), axis=0) == pytest.approx(np.ptp(kept, axis=0), rel=1e-4)


# Doubled faces


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("number", [14, 0])
def test_a_doubled_face_takes_the_uvs_of_its_twin(way, number):
    points, faces = sheet()
    straight, _ = unwrapped(points, faces)
    expected = by_vertex(faces, uvs(straight))
    again = [*faces, np.roll(faces[number][::way], 1).tolist()]
    obj, (report,) = unwrapped(points, again)
    assert (by_vertex(again, uvs(obj)) == expected).all()
    assert report["warnings"] == ["1 doubled face takes the UVs of its twin, and is not counted as an overlap"]
    assert report["face_indices"] == list(range(37)) and report["injective"] and report["after"]["flips"] == 0


@pytest.mark.parametrize("triangulated", [False, True])
def test_a_double_sided_sheet_is_one_clean_island(triangulated):
    points, faces = sheet()
    if triangulated:
        faces = [triangle for a, b, c, d in faces for triangle in ([a, b, c], [a, c, d])]
    both = [*faces, *(face[::-1] for face in faces)]
    obj, (report,) = unwrapped(points, both)
    count = len(faces)
    text = f"{count} doubled faces take the UVs of their twins, and are not counted as overlaps"
    assert report["warnings"] == [text] and report["injective"]
    assert report["face_indices"] == list(range(2 * count))
    straight, _ = unwrapped(points, faces)
    assert (by_vertex(both, uvs(obj)) == by_vertex(faces, uvs(straight))).all()


def test_doubled_faces_inside_out_are_turned_with_their_twins():
    points, faces = sheet()
    faces[3] = faces[3][::-1]
    again = [*faces, faces[3], faces[3][::-1]]
    _, (report,) = unwrapped(points, again)
    assert report["warnings"] == [
        "1 face is inside out: turned for the unwrap",
        "2 doubled faces take the UVs of their twins, and are not counted as overlaps",
    ]
    assert report["injective"] and report["after"]["flips"] == 0


def test_what_blender_draws_of_a_doubled_face_is_judged():
    """A quad that is an arrowhead in the map: cut along its other diagonal, one half of it is flipped."""
    points = [(0, 0, 0), (1, -0.3, 0.2), (2, 0, 0), (1, 1, 0)]
    uv = [(0, 0), (1, 0.6), (2, 0), (1, 1)]
    for double, flips in (([1, 2, 3, 0], 0), ([0, 1, 2, 3], 1)):
        faces = [[1, 2, 3, 0], double]
        _, (report,) = unwrapped(points, faces, of_corners(faces, uv), boundary='KEEP')
        assert (report["after"]["flips"], report["injective"]) == (flips, not flips)


def test_pins_of_a_doubled_face_count_and_its_uvs_do_not():
    points, faces = sheet()
    again = [*faces, faces[0][::-1], faces[35][::-1]]
    uv = of_corners(again, points[:, :2])
    uv[144:] += 7  # the doubles lie elsewhere
    pins = [144, 145, 148]  # corners of the doubles
    obj, (report,) = unwrapped(points, again, uv, pins=pins)
    pinned = [again[36][0], again[36][1], again[37][0]]
    found = by_vertex(again, uvs(obj))
    assert (found[pinned] == points[pinned, :2].astype(np.float32)).all()
    assert report["injective"] and report["before"]["flips"] == 0
    free = by_vertex(faces, uvs(unwrapped(points, faces)[0]))
    assert np.abs(found - free).max() > 1e-4


def test_a_kept_outline_is_that_of_the_first_faces():
    points, faces = sheet()
    again = [*faces, *(face[::-1] for face in faces)]
    uv = of_corners(again, points[:, :2])
    uv[144:] *= 0.3
    obj, (report,) = unwrapped(points, again, uv, boundary='KEEP')
    assert report["injective"]
    rim = (np.isin(points[:, :2], (0, 1))).any(axis=1)
    assert (by_vertex(again, uvs(obj))[rim] == points[rim, :2].astype(np.float32)).all()


# Slits


def seam_edges(first, count):
    """That many edges along a row of the sheet of 12 quads a side."""
    return {(first + k, first + k + 1) for k in range(count)}


@pytest.mark.parametrize("seams", [seam_edges(6 * 13, 6), seam_edges(6 * 13 + 3, 5)])
@pytest.mark.parametrize("options", [{"boundary": 'KEEP'}, {"pins": [0, 575]}])
def test_a_slit_that_stays_closed_is_no_overlap(seams, options):
    points, faces = sheet(12)
    points[:, 2] = 0
    _, (report,) = unwrapped(points, faces, of_corners(faces, points[:, :2]), seams, **options)
    assert report["injective"] and "it touches itself along a seam, and covers nothing twice" in report["warnings"]
    assert not any("overlaps" in warning for warning in report["warnings"])


def test_what_touches_elsewhere_is_not_certified():
    """A point of the outline lies on the place of another one, to which no seam joins it."""
    points, faces = sheet(12)
    values = points[:, :2].copy()
    values[6] = values[12 * 13 + 6]
    _, (report,) = unwrapped(points, faces, of_corners(faces, values), boundary='KEEP')
    assert not report["injective"]


# Maps of any size


@pytest.mark.parametrize(("scale", "tile"), [(1e-5, 0), (1e-3, 9), (1, 9), (1, 100), (100, 0)])
def test_a_map_of_any_size_anywhere_is_kept(scale, tile):
    points, faces = sheet()
    values = points[:, :2] * scale + (tile, 0)
    obj, (report,) = unwrapped(points, faces, of_corners(faces, values), boundary='KEEP')
    assert report["injective"]
    rim = np.isin(points[:, :2], (0, 1)).any(axis=1)
    assert (by_vertex(faces, uvs(obj))[rim] == values[rim].astype(np.float32)).all()
    cut = of_corners(faces, values)
    cut[72:] += 0.2 * scale
    with pytest.raises(RuntimeError, match="cut where there is no seam"):
        unwrapped(points, faces, cut, boundary='KEEP')


def test_selected_faces_of_a_small_map_hang_on_the_others_only_where_it_is_whole():
    obj = add_grid(4)
    layer = obj.data.uv_layers.active.uv
    whole = uvs(obj) * np.float32(1e-5)
    selected = np.arange(16) < 8
    for gap, expected in ((0, True), (2e-6, False)):
        moved = whole.copy()
        moved[32:] += np.float32(gap)
        layer.foreach_set("vector", moved.ravel())
        mesh = mesh_arrays.read(obj)
        found = attached(mesh.corner_vertex, mesh.corner_edge, mesh.face_start, mesh.seam, selected, mesh.uv)
        assert found.any() == expected


# Sizes


@pytest.mark.parametrize("size", [1e-18, 1e-6, 1e6, 1e12, 1e19, 1e30])
@pytest.mark.parametrize("placement", ["ORIGINAL", "PACK"])
def test_a_mesh_of_any_size_gets_the_same_uvs(size, placement):
    points, faces = sheet()
    expected = uvs(unwrapped(points, faces, placement=placement)[0])
    obj, (report,) = unwrapped(points * size, faces, placement=placement)
    assert report["injective"]
    np.testing.assert_allclose(uvs(obj), expected, atol=1e-4)


@pytest.mark.parametrize("placement", ["ORIGINAL", "PACK"])
def test_what_would_vanish_beside_the_others_is_packed_larger(placement):
    points, faces = sheet()
    both = np.vstack([1e-6 * points, 1e6 * points])
    _, reports = unwrapped(both, faces + [[c + len(points) for c in face] for face in faces], placement=placement)
    assert [report["injective"] for report in reports] == [True, True]
    assert [len(report["warnings"]) for report in reports] == [1, 0]


@pytest.mark.parametrize("seed", range(2, 6))
def test_what_rounding_would_flip_is_opened(seed, monkeypatch):
    """Thin triangles of an island that comes to lie so far away that single precision has few digits for them."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.random((80, 2)), np.zeros(80)])
    faces = Delaunay(points[:, :2]).simplices.tolist()
    monkeypatch.setattr(layout.placing, "upright", lambda islands, uv, up: uv + (150_000, 0))
    monkeypatch.setattr(layout.packing, "pack", lambda islands, uv, *_: uv)
    opened, (report,) = unwrapped(points, faces)
    assert report["injective"]
    assert uvs(opened)[:, 0].min() > 75_000


@pytest.mark.parametrize(("size", "radius", "angle"), [(3, 2, 2), (6, 5, 1), (4, 3, 1), (6, 3, 3)])
def test_a_slit_in_a_rolled_sheet_is_closed(size, radius, angle):
    """Flat again, its sides lie on each other but for rounding."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(size + 1.0), np.arange(size + 1.0), indexing="ij"))
    cos, sin = np.cos(angle), np.sin(angle)
    rolled = np.column_stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)])
    points = rolled @ [(cos, sin, 0), (-sin, cos, 0), (0, 0, 1)]
    _, faces = sheet(size)
    across = size + 1
    seams = {(across, across + 1), (across + 1, 2 * across + 1)}
    _, (report,) = unwrapped(points, faces, seams=seams)
    assert report["injective"]
    assert report["warnings"] == ["it touches itself along a seam, and covers nothing twice"]


def test_a_doubled_face_that_is_cut_otherwise_says_what_to_do():
    points = [(8, 2, 1), (8, 1, 1), (8, 1, 0.6), (8, 0.7, 0), (7, 0, 0)]
    _, (report,) = unwrapped(points, [(1, 2, 3, 4, 0), (3, 4, 0, 1, 2)])
    assert not report["injective"]
    assert any("delete the doubles, or triangulate both" in text for text in report["warnings"])


def test_what_ends_with_flips_has_a_word():
    """A tube of three sides, a hundred times as long as wide, closed but for one face."""
    angle = 2 * np.pi * np.arange(3) / 3
    points = [(np.cos(a), 0.01 * np.sin(a), 0.7 * level) for level in range(13) for a in angle]
    points += [(0, 0, 0), (0, 0, 8.4)]
    faces = [
        (3 * j + i, 3 * j + (i + 1) % 3, 3 * j + 3 + (i + 1) % 3, 3 * j + 3 + i) for j in range(12) for i in range(3)
    ]
    faces += [(36 + i, 36 + (i + 1) % 3, 40) for i in range(3)] + [((i + 1) % 3, i, 39) for i in range(3)]
    del faces[np.random.default_rng(0).choice(len(faces), 1, replace=False)[0]]
    _, (report,) = unwrapped(points, faces)
    assert report["injective"] or any("mark a seam along it" in text for text in report["warnings"])
    assert report["injective"] or report["after"]["flips"]


def test_a_map_that_covers_nothing_twice_is_not_given_up_for_one_that_does():
    points = [(1, 0, 0), (0.3, 1, 0), (-1, 0.6, 0), (-1, 0.8, 2), (0, -1, 2), (1, 0, 4), (0.4, -1, 4), (0, 1, 6)]
    faces = [(0, 7, 1), (1, 7, 3, 2), (2, 3, 4), (4, 7, 0), (4, 3, 6), (4, 6, 5, 7)]
    rough = dict(iterations=20, refine=0)
    _, (report,) = unwrapped(points, faces, **rough)
    assert not report["injective"], "it is a case in point"
    obj, (report,) = unwrapped(points, faces)
    assert report["injective"]
    before = uvs(obj)
    obj, (report,) = unwrapped(points, faces, before, **rough)
    assert report["injective"] and any("stay as they were" in text for text in report["warnings"])
    np.testing.assert_allclose(uvs(obj), before, atol=1e-6)
    obj, _ = unwrapped(points, faces, before, **rough, repair=False)
    assert not np.allclose(uvs(obj), before, atol=0.1), "which is wanted as it comes"
