# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices at the same place count as one for the unwrap, and the mesh stays as it is."""

import json

import bpy  # isort: skip
import numpy as np
import pytest
from scenes import add_cube, add_grid, changes, edit_mode, mesh_object, snapshot, uvs

from qh_unwrap import last_report
from qh_unwrap.addon import files, mesh_arrays
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.cli import main
from qh_unwrap.core.initial import fit


def sheet(size=6, height=0.3):
    """Points and quads of a bumpy square."""
    x, y = np.meshgrid(np.linspace(0, 1, size + 1), np.linspace(0, 1, size + 1), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), (height * np.sin(3 * x) * np.cos(2 * y + 0.4)).ravel()])
    corner = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    return points, np.column_stack([corner, corner + size + 1, corner + size + 2, corner + 1]).tolist()


def split(points, faces, parts=None):
    """The same, with vertices of its own for each part of the faces, (f,), or else for each face."""
    number, apart = {}, []
    for face, part in zip(faces, range(len(faces)) if parts is None else parts, strict=True):
        apart.append([number.setdefault((v, part), len(number)) for v in face])
    return np.asarray(points)[[v for v, _ in number]], apart


def unwrap(obj, **options):
    """Unwrap it with welding, see that nothing but UVs changes, and return the report on its islands."""
    before = snapshot(obj)
    assert bpy.ops.uv.qh_unwrap(**{"weld": True} | options) == {'FINISHED'}
    assert changes(before, snapshot(obj)) <= _CHANGES | (_CHANGES_OF_EDIT_MODE if obj.mode == 'EDIT' else set())
    return last_report()


_CHANGES = {"UVMap", "active UV map"}
_CHANGES_OF_EDIT_MODE = {  # by Blender itself, which leaves it for a moment: with a new map, and with shape keys
    ".uv_select_vert",
    ".uv_select_edge",
    ".uv_select_face",
    "shape layers",
}


def mark(obj, chosen):
    """Mark the edges as seams for which `chosen` says so of the points where they end."""
    for edge in obj.data.edges:
        edge.use_seam = bool(chosen(*(np.array(obj.data.vertices[v].co) for v in edge.vertices)))


def assert_same(found, expected, tolerance=1e-5):
    """UVs by corner, up to a similarity."""
    fitted = fit(found.astype(float), np.ones(len(found), bool), expected.astype(float))
    assert np.abs(fitted - expected).max() < tolerance * np.ptp(expected, axis=0).max()


def corner_normals(obj):
    return np.array([normal.vector for normal in obj.data.corner_normals])


# Files


@pytest.fixture
def half_pipe(tmp_path):
    """Its path as a .glb: a half pipe, smooth but for one edge along it that is sharp."""
    obj = add_grid(8, "Pipe")
    for vertex in obj.data.vertices:
        angle = np.pi / 2 * vertex.co.x
        vertex.co = np.sin(angle), vertex.co.y, np.cos(angle)
    obj.data.polygons.foreach_set("use_smooth", [True] * 64)
    for edge in obj.data.edges:
        edge.use_edge_sharp = all(abs(obj.data.vertices[v].co.x) < 1e-6 for v in edge.vertices)
    assert sum(edge.use_edge_sharp for edge in obj.data.edges) == 8
    path = tmp_path / "in.glb"
    files.save(path)
    return path


@pytest.mark.parametrize("target", [".glb", ".blend"])
@pytest.mark.parametrize("source", [".glb", ".blend"])
def test_a_sharp_edge_stays_sharp_and_parts_nothing(tmp_path, half_pipe, source, target):
    path, numbers = tmp_path / f"out{target}", tmp_path / "numbers.json"
    (old,) = files.load(half_pipe)
    if source == ".blend":
        half_pipe = tmp_path / "in.blend"
        files.save(half_pipe)
    count, normals = len(old.data.vertices), corner_normals(old)
    assert count == 90, "the sharp edge is split"
    weld = ["--weld"] if source == ".blend" else []
    assert main([str(half_pipe), "-o", str(path), "--json", str(numbers), *weld]) == 0
    document = json.loads(numbers.read_text())
    assert document["settings"]["weld"] is True
    (island,) = document["islands"]
    assert island["injective"] and island["faces"] == 128
    (new,) = files.load(path)
    assert len(new.data.vertices) == count
    assert np.abs(corner_normals(new) - normals).max() < 1e-6
    assert len(np.unique(np.round(uvs(new), 5), axis=0)) == 81


@pytest.mark.parametrize(
    ("suffix", "arguments", "expected"),
    [
        (".glb", [], True),
        (".gltf", [], True),
        (".ply", [], True),
        (".stl", [], True),
        (".blend", [], False),
        (".obj", [], False),
        (".glb", ["--no-weld"], False),
        (".obj", ["--weld"], True),
    ],
)
def test_welded_by_default_is_what_files_split(tmp_path, suffix, arguments, expected):
    add_grid(3)
    source, numbers = tmp_path / f"in{suffix}", tmp_path / "numbers.json"
    if suffix == ".stl":
        bpy.ops.wm.stl_export(filepath=str(source))
    else:
        files.save(source)
    assert main([str(source), "--json", str(numbers), *arguments]) == 0
    document = json.loads(numbers.read_text())
    assert document["settings"]["weld"] is expected
    split_by_format = suffix in {".glb", ".gltf"} and not expected
    assert len(document["islands"]) == (9 if split_by_format else 1)


def test_cuts_of_the_map_become_seams_on_all_edges_there(tmp_path):
    add_cube()
    source, target = tmp_path / "in.glb", tmp_path / "out.blend"
    numbers, picture = tmp_path / "numbers.json", tmp_path / "picture.png"
    files.save(source)
    assert main([str(source), "--cut", "never"]) == 3, "closed"
    written = ["-o", str(target), "--json", str(numbers), "--preview", str(picture)]
    assert main([str(source), "--seams-from-islands", *written]) == 0
    (island,) = json.loads(numbers.read_text())["islands"]
    assert island["faces"] == 12 and island["injective"] and picture.exists()
    (obj,) = files.load(target)
    assert len(obj.data.vertices) == 24
    assert sum(edge.use_seam for edge in obj.data.edges) == 14, "both edges at each of the seven of the cross"


# Like a mesh that was joined by hand


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
@pytest.mark.parametrize("gap", [0, 1e-7])
@pytest.mark.parametrize("seed", range(3))
def test_same_uvs_as_of_the_mesh_joined_by_hand(seed, gap, mode):
    rng = np.random.default_rng(seed)
    points, faces = sheet(8)
    apart, parted = split(points, faces, None if seed == 0 else rng.integers(3, size=len(faces)))
    apart += gap * rng.uniform(-1, 1, apart.shape)
    whole = mesh_object("Whole", points, faces)
    mark(whole, lambda a, b: max(a[0], b[0]) < 0.3 and abs(a[1] - b[1]) < 1e-3 and abs(a[1] - 0.5) < 1e-3)
    assert sum(edge.use_seam for edge in whole.data.edges) == 2
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    obj = mesh_object("Split", apart, parted)
    mark(obj, lambda a, b: max(a[0], b[0]) < 0.3 and abs(a[1] - b[1]) < 1e-3 and abs(a[1] - 0.5) < 1e-3)
    if mode == 'EDIT':
        edit_mode()
    (report,) = unwrap(obj)
    assert report["injective"] and report["faces"] == 64
    assert_same(uvs(obj), uvs(whole), 1e-5 if gap == 0 else 1e-4)


def test_a_cube_of_24_vertices_with_seams_marked_by_hand():
    cube = add_cube()
    points = np.array([vertex.co for vertex in cube.data.vertices])
    faces = [list(polygon.vertices) for polygon in cube.data.polygons]
    apart, parted = split(points, faces)
    assert len(apart) == 24
    obj = mesh_object("Split", apart, parted)
    with pytest.raises(RuntimeError, match="closed"):
        bpy.ops.uv.qh_unwrap(weld=True)

    marked = set()
    for edge in obj.data.edges:  # of the two edges at a place only the first
        a, b = sorted(tuple(obj.data.vertices[v].co) for v in edge.vertices)
        upright, in_front = a[2] != b[2], a[1] < 0 and b[1] < 0
        cut = (in_front and a[0] < 0) if upright else not in_front
        edge.use_seam = cut and (a, b) not in marked
        marked.add((a, b))
    assert sum(edge.use_seam for edge in obj.data.edges) == 7
    (report,) = unwrap(obj)
    assert report["injective"] and report["faces"] == 6
    assert len(np.unique(np.round(uvs(obj), 4), axis=0)) == 14


@pytest.mark.parametrize("options", [{}, {"boundary": 'CIRCLE'}, {"boundary": 'KEEP'}, {"placement": 'PACK'}])
@pytest.mark.parametrize("seed", range(4))
def test_without_vertices_at_one_place_it_changes_nothing(seed, options):
    rng = np.random.default_rng(seed)
    points, faces = sheet(9)
    points += 0.02 * rng.uniform(-1, 1, points.shape)
    faces = [faces[k] for k in rng.permutation(81) if seed % 2 == 0 or rng.random() < 0.95]
    obj = mesh_object("Mesh", points, faces)
    layer = obj.data.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", points[np.concatenate(faces), :2].astype(np.float32).ravel())
    for edge in obj.data.edges:
        edge.use_seam = rng.random() < 0.05 and options.get("boundary") != 'KEEP'
    old, found = uvs(obj), []
    for weld in (False, True):
        obj.data.uv_layers.active.uv.foreach_set("vector", old.ravel())
        unwrap(obj, weld=weld, **options)
        found.append((uvs(obj).tobytes(), last_report()))
    assert found[0] == found[1]


def test_a_large_soup_of_triangles_is_one_island():
    points, quads = sheet(130)
    triangles = [triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]
    apart, parted = split(points, triangles)
    assert len(apart) == 101_400
    obj = mesh_object("Soup", apart, parted)
    (report,) = unwrap(obj)
    assert report["injective"] and report["faces"] == len(triangles)


# What stays apart


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_both_sides_of_a_card_get_uvs(mode):
    points, faces = sheet(2)
    obj = mesh_object("Card", np.vstack([points, points]), faces + [[v + 9 for v in face[::-1]] for face in faces])
    if mode == 'EDIT':
        edit_mode()
    front, back = unwrap(obj)
    assert (front["faces"], back["faces"]) == (4, 4) and front["injective"] and back["injective"]
    assert not front["warnings"] and not back["warnings"]
    assert len(obj.data.polygons) == 8
    assert len(np.unique(np.round(uvs(obj), 5), axis=0)) == 18, "beside each other"


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
@pytest.mark.parametrize("parts", [None, "key", "vertex group"])
def test_lips_that_a_shape_key_parts_stay_two(parts, mode):
    """A band around a mouth, whose lips lie on each other in the Basis."""
    points, faces = sheet(6, height=0.1)
    upper = [max(face) >= 4 * 7 for face in faces]  # the rows from the middle on
    lips = range(3 * 7 + 2, 3 * 7 + 5)
    apart = np.vstack([points, points[list(lips)]])
    own = {v: len(points) + k for k, v in enumerate(lips)}
    parted = [[own.get(v, v) if is_upper else v for v in face] for face, is_upper in zip(faces, upper, strict=True)]
    obj = mesh_object("Face", apart, parted)
    obj.shape_key_add(name="Basis")
    if parts:
        key = obj.shape_key_add(name="Open")
        moved = list(own.values()) + (list(lips) if parts == "vertex group" else [])
        for v in moved:
            key.data[v].co.x += 0.1
        if parts == "vertex group":
            obj.vertex_groups.new(name="Upper").add(list(own.values()), 1.0, 'REPLACE')
            key.vertex_group, key.value = "Upper", 1.0
    bpy.context.view_layer.update()
    if mode == 'EDIT':
        edit_mode()
    (report,) = unwrap(obj)
    assert report["injective"] and report["faces"] == 36
    corner = np.concatenate(parted)
    there = [{tuple(uv) for uv in np.round(uvs(obj)[corner == v], 6)} for v in (3 * 7 + 3, own[3 * 7 + 3])]
    assert (there[0] == there[1]) is (parts is None)


def test_a_key_that_is_being_edited_counts():
    points, faces = split(*sheet(2))
    obj = mesh_object("Mesh", points, faces)
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Open")
    obj.active_shape_key_index = 1
    edit_mode(lambda _, face: face == 0)
    assert len(unwrap(obj)) == 1
    bpy.ops.transform.translate(value=(0.1, 0, 0))
    bpy.ops.mesh.select_all(action='SELECT')
    assert [report["faces"] for report in unwrap(obj)] == [1, 3]


def test_a_face_that_welding_would_collapse():
    points, faces = split(*sheet(4))
    points = np.vstack([points, points[0], points[0], points[1]])
    obj = mesh_object("Mesh", points, [*faces, [64, 65, 66]])
    whole, collapsed = unwrap(obj)
    assert whole["faces"] == 16 and whole["injective"]
    assert collapsed["faces"] == 1 and "zero area" in collapsed["error"]


# What is read downstream


def test_a_map_that_is_cut_along_welded_edges():
    points, faces = sheet(4)
    parts = [max(face) > 14 for face in faces]
    apart, parted = split(points, faces, parts)
    obj = mesh_object("Mesh", apart, parted)
    values = apart[np.concatenate(parted), :2] + np.repeat(parts, 4)[:, None] * (0.5, 0)
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", values.astype(np.float32).ravel())
    with pytest.raises(RuntimeError, match="cut where there is no seam: mark seams along the cuts, or turn Weld off"):
        bpy.ops.uv.qh_unwrap(weld=True, boundary='KEEP')
    assert len(unwrap(obj, weld=False, boundary='KEEP')) == 2
    files.mark_cuts([obj], MeshOptions())
    assert not any(edge.use_seam for edge in obj.data.edges)
    files.mark_cuts([obj], MeshOptions(weld=True))
    assert sum(edge.use_seam for edge in obj.data.edges) == 8
    assert len(unwrap(obj, boundary='KEEP')) == 2


def test_what_is_selected_hangs_on_the_rest_across_welded_edges(uv_editor):
    points, faces = split(*sheet(4))
    obj = mesh_object("Mesh", points, faces)
    values = points[:, :2].astype(np.float32)
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", values.ravel())
    edit_mode(lambda _, face: face < 8)
    bpy.context.scene.tool_settings.use_uv_select_sync = True
    with bpy.context.temp_override(**uv_editor):
        (report,) = unwrap(obj)
    assert report["faces"] == 8 and report["injective"]
    middle = np.abs(points[:, 0] - 0.5) < 1e-6
    assert np.abs(uvs(obj)[middle] - values[middle]).max() < 1e-6 and (uvs(obj)[32:] == values[32:]).all()
    assert not np.array_equal(uvs(obj)[:32], values[:32])


def test_a_pin_on_one_of_them_pins_all():
    points, faces = split(*sheet(4))
    obj = mesh_object("Mesh", points, faces)
    values = points[:, :2].astype(np.float32)
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", values.ravel())
    pinned = obj.data.attributes.new(".pn.UVMap", 'BOOLEAN', 'CORNER')
    corner = int(np.flatnonzero(np.abs(points[:, :2] - (0.5, 0.5)).max(axis=1) < 1e-6)[2])
    other = 0
    pinned.data.foreach_set("value", np.isin(np.arange(64), [corner, other]))
    (report,) = unwrap(obj)
    there = np.abs(points[:, :2] - (0.5, 0.5)).max(axis=1) < 1e-6
    assert there.sum() == 4 and (uvs(obj)[there] == values[there]).all() and report["injective"]


def test_modifiers_do_not_part_what_is_welded():
    points, faces = split(*sheet(4), [k % 8 < 4 for k in range(16)])
    obj = mesh_object("Mesh", points, faces)
    obj.modifiers.new("Subdivision", 'SUBSURF')
    (report,) = unwrap(obj, use_subsurf_data=True)
    assert report["faces"] == 16 and report["injective"]


def test_nothing_is_welded_unless_wanted():
    points, faces = split(*sheet(2))
    mesh = mesh_arrays.read(mesh_object("Mesh", points, faces))
    assert mesh.welded_edge is None and np.array_equal(mesh.corner_vertex, np.arange(16))
