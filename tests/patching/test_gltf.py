# SPDX-License-Identifier: GPL-3.0-or-later
"""Other texture coordinates in glTF files, and everything else as it was."""

import copy
import json

import numpy as np
import pytest
from gltf_files import Builder, Parsed, box, grid, rich

from qh_unwrap.patching.formats import opened
from qh_unwrap.patching.original import Change, Layer, PatchError

OWN = b"ACME", b"\1\2\3\4"  # a chunk that nobody knows


def each_face_alone(mesh, seed=0):
    """(c, 2) UVs that no two corners share."""
    return np.random.default_rng(seed).random((len(mesh.corner_vertex), 2)).astype(np.float32)


def one_per_vertex(mesh):
    return np.float32(0.3) * mesh.corner_points[:, ::2]


def patch(path, output, uvs, faces=None, number=0, is_new=False):
    """Patch the meshes with these names; returns what is in the output."""
    original = opened(path)
    changes = []
    for mesh in original.meshes:
        if mesh.name in uvs:
            changed = np.ones(len(mesh.sizes), dtype=bool) if faces is None else faces
            uv = uvs[mesh.name](mesh)
            old = original.uv(mesh, Layer(number, "", is_new))
            if old is not None and not is_new:
                uv = np.where(np.repeat(changed, 3)[:, None], uv, old)
            changes.append(Change(mesh, Layer(number, "", is_new), uv, changed))
    original.write(output, output, changes)
    found = Parsed(output)
    found.check()
    again = opened(output)
    for change in changes:
        (mesh,) = [each for each in again.meshes if each.name == change.mesh.name]
        assert np.array_equal(mesh.corner_points, change.mesh.corner_points)
        assert np.abs(again.uv(mesh, change.layer) - change.uv).max() <= 6e-8
    return found


def by_corners(parsed, primitive, skip=()):
    """All attributes and morph targets of the corners, by their names, as bytes; sparse ones are left out."""
    index = parsed.array(primitive["indices"]).ravel()
    groups = [primitive["attributes"], *primitive.get("targets", ())]
    return {
        (number, name): parsed.array(accessor)[index].tobytes()
        for number, group in enumerate(groups)
        for name, accessor in group.items()
        if name not in skip and "sparse" not in parsed.json["accessors"][accessor]
    }


def test_what_splits_nothing_changes_nothing_but_the_coordinates(tmp_path):
    path = rich().write(tmp_path / "in.glb", chunks=[OWN], indent=1)
    before = Parsed(path)
    after = patch(path, tmp_path / "out.glb", {"Körper": one_per_vertex})
    assert after.text == before.text and after.chunks[2:] == [OWN]
    old, new = (np.frombuffer(each.buffers[0], dtype=np.uint8) for each in (before, after))
    number = before.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    accessor = before.json["accessors"][number]
    view = before.json["bufferViews"][accessor["bufferView"]]
    start = view["byteOffset"] + accessor["byteOffset"]
    places = start + view["byteStride"] * np.arange(accessor["count"])[:, None] + np.arange(8)
    assert set(np.flatnonzero(old != new)) <= set(places.ravel())


@pytest.mark.parametrize("number", [0, 1])
def test_what_is_split_keeps_all_its_attributes(tmp_path, number):
    path = rich().write(tmp_path / "in.glb", chunks=[OWN], indent=1)
    before = Parsed(path)
    after = patch(path, tmp_path / "out.glb", {"Körper": each_face_alone}, number=number)
    for old, new in zip(before.primitives()[:2], after.primitives()[:2], strict=True):
        assert len(after.array(new["indices"])) == len(before.array(old["indices"]))
        assert old["attributes"].keys() == new["attributes"].keys() and len(new["targets"]) == 2
        skip = (f"TEXCOORD_{number}",)
        was, is_now = by_corners(before, old, skip), by_corners(after, new, skip)
        assert was.items() <= is_now.items()
    first, second = after.primitives()[:2]
    assert first["attributes"] == second["attributes"], "they still share their vertices"
    sparse = after.array(first["targets"][1]["POSITION"])[:36]
    assert np.flatnonzero(sparse.any(axis=1)).tolist() == [1, 3, 20]
    assert after.primitives()[2] == before.primitives()[2]
    assert np.array_equal(
        after.array(after.primitives()[2]["indices"]), before.array(before.primitives()[2]["indices"])
    )
    for name in before.json.keys() - {"accessors", "bufferViews", "buffers", "meshes"}:
        assert after.json[name] == before.json[name], name
    assert after.json["meshes"][0]["extras"] == before.json["meshes"][0]["extras"]
    assert '"price": 100.0' in after.text and after.chunks[2:] == [OWN]
    temperature = after.json["accessors"][first["attributes"]["_TEMPERATURE"]]
    assert temperature["name"] == "warm" and len(after.json["accessors"]) <= len(before.json["accessors"]) + 7


def test_faces_that_did_not_change_keep_their_coordinates_to_the_bit(tmp_path):
    path = rich().write(tmp_path / "in.glb")
    before, faces = Parsed(path), np.arange(50) < 20
    after = patch(path, tmp_path / "out.glb", {"Körper": each_face_alone}, faces)
    for number, (old, new) in enumerate(zip(before.primitives()[:2], after.primitives()[:2], strict=True)):
        kept = ~faces[25 * number :][:25]
        was, is_now = (
            each.array(part["attributes"]["TEXCOORD_0"])[each.array(part["indices"]).ravel()].reshape(-1, 6)
            for each, part in ((before, old), (after, new))
        )
        assert np.array_equal(was[kept].view(np.uint32), is_now[kept].view(np.uint32))
        assert kept.all() or (was[~kept] != is_now[~kept]).all()


def test_a_primitive_that_did_not_change_keeps_its_accessors(tmp_path):
    path = rich().write(tmp_path / "in.glb")
    before = Parsed(path)
    after = patch(path, tmp_path / "out.glb", {"Körper": each_face_alone}, np.arange(50) < 25)
    old, new = before.primitives()[1], after.primitives()[1]
    assert old == new and by_corners(before, old) == by_corners(after, new)


def test_the_file_grows_by_what_is_split_alone(tmp_path):
    """What nobody reads any more is left out, and patching again and again adds nothing."""
    made = Builder()
    points, texcoords, triangles = grid(20)
    image = made.view(b"\x89PNG" + bytes(range(100)))
    attributes = dict(POSITION=made.accessor(points, bounds=True), TEXCOORD_0=made.accessor(texcoords))
    made.mesh(dict(attributes=attributes, indices=made.accessor(triangles.ravel().astype(np.uint16))))
    made.json["images"] = [dict(bufferView=image, mimeType="image/png")]
    last = made.accessor(np.float32((1, 2, 3)))
    path = made.write(tmp_path / "0.glb")
    once = patch(path, tmp_path / "1.glb", {"Mesh": each_face_alone})
    corners = 3 * len(triangles)
    assert len(once.buffers[0]) <= corners * (12 + 8 + 2) + 108 + 12 + 8
    for number in range(1, 4):
        found = patch(tmp_path / f"{number}.glb", tmp_path / f"{number + 1}.glb", {"Mesh": each_face_alone})
    assert len(found.buffers[0]) == len(once.buffers[0])
    view = found.json["bufferViews"][image]
    assert found.buffers[0][view["byteOffset"] :][:104] == b"\x89PNG" + bytes(range(100))
    assert found.array(last).ravel().tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("size", "kind", "wanted"), [(4, np.uint8, 5121), (10, np.uint8, 5123), (110, np.uint16, 5125)]
)
def test_indices_get_wider_where_they_have_to(tmp_path, size, kind, wanted):
    made = Builder()
    points, texcoords, triangles = grid(size)
    attributes = dict(POSITION=made.accessor(points, bounds=True), TEXCOORD_0=made.accessor(texcoords))
    made.mesh(dict(attributes=attributes, indices=made.accessor(triangles.ravel().astype(kind), bounds=True)))
    after = patch(made.write(tmp_path / "in.glb"), tmp_path / "out.glb", {"Mesh": each_face_alone})
    assert after.json["accessors"][after.primitives()[0]["indices"]]["componentType"] == wanted


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("normalized", [True, False])
def test_coordinates_of_whole_numbers_become_floats(tmp_path, kind, normalized):
    made = Builder()
    points, texcoords, triangles = grid()
    stored = np.round(texcoords * np.iinfo(kind).max).astype(kind)
    quantized = made.accessor(np.round(points * 50).astype(np.int8), bounds=True)
    attributes = dict(POSITION=quantized, TEXCOORD_0=made.accessor(stored, normalized=normalized))
    made.mesh(dict(attributes=attributes, indices=made.accessor(triangles.ravel().astype(np.uint8))))
    made.json |= {key: ["KHR_mesh_quantization"] for key in ("extensionsUsed", "extensionsRequired")}
    path = made.write(tmp_path / "in.glb")
    after = patch(path, tmp_path / "out.glb", {"Mesh": each_face_alone}, np.arange(32) < 9)
    accessor = after.json["accessors"][after.primitives()[0]["attributes"]["TEXCOORD_0"]]
    assert accessor["componentType"] == 5126 and "normalized" not in accessor
    kept = after.array(after.primitives()[0]["attributes"]["TEXCOORD_0"])[after.array(after.primitives()[0]["indices"])]
    expected = stored[triangles].astype(np.float32) / np.float32(np.iinfo(kind).max if normalized else 1)
    assert np.array_equal(kept.reshape(-1, 3, 2)[9:], expected[9:])


def test_a_missing_set_is_appended_with_those_before_it(tmp_path):
    made = Builder()
    points, triangles = box()
    attributes = dict(POSITION=made.accessor(points, bounds=True))
    made.mesh(dict(attributes=attributes, indices=made.accessor(triangles.ravel().astype(np.uint16))), name="Box")
    path = made.write(tmp_path / "in.glb")
    after = patch(path, tmp_path / "out.glb", {"Box": each_face_alone}, number=1, is_new=True)
    attributes = after.primitives()[0]["attributes"]
    assert list(attributes) == ["POSITION", "TEXCOORD_0", "TEXCOORD_1"]
    assert not after.array(attributes["TEXCOORD_0"]).any()


@pytest.mark.parametrize("mode", [5, 6])
def test_strips_and_fans(tmp_path, mode):
    made = Builder()
    points, texcoords, _ = grid(3)
    index = np.array([0, 1, 5, 6, 10] if mode == 5 else [5, 0, 1, 6, 10, 9, 8], dtype=np.uint8)
    attributes = dict(POSITION=made.accessor(points, bounds=True), TEXCOORD_0=made.accessor(texcoords))
    made.mesh(dict(attributes=attributes, indices=made.accessor(index), mode=mode))
    path = made.write(tmp_path / "in.glb")
    same = patch(path, tmp_path / "same.glb", {"Mesh": one_per_vertex})
    assert same.primitives()[0]["mode"] == mode and np.array_equal(
        same.array(same.primitives()[0]["indices"]).ravel(), index
    )
    assert patch(path, tmp_path / "split.glb", {"Mesh": each_face_alone}).primitives()[0]["mode"] == 4


def test_points_and_lines_stay(tmp_path):
    made = Builder()
    points, texcoords, triangles = grid()
    attributes = dict(POSITION=made.accessor(points, bounds=True), TEXCOORD_0=made.accessor(texcoords))
    lines = dict(attributes=dict(attributes), indices=made.accessor(np.arange(4, dtype=np.uint8)), mode=1)
    made.mesh(lines, dict(attributes=attributes, indices=made.accessor(triangles.ravel().astype(np.uint8))))
    path = made.write(tmp_path / "in.glb")
    before, after = Parsed(path), patch(path, tmp_path / "out.glb", {"Mesh": each_face_alone})
    assert after.primitives()[0] == before.primitives()[0]
    assert by_corners(after, after.primitives()[0]) == by_corners(before, before.primitives()[0])


def test_without_indices(tmp_path):
    made = Builder()
    points, texcoords, triangles = grid()
    attributes = dict(POSITION=made.accessor(points[triangles.ravel()], bounds=True))
    made.mesh(dict(attributes=attributes | dict(TEXCOORD_0=made.accessor(texcoords[triangles.ravel()]))))
    path = made.write(tmp_path / "in.glb")
    assert patch(path, tmp_path / "out.glb", {"Mesh": each_face_alone}).text == Parsed(path).text


def test_bytes_that_others_read_are_not_written_over(tmp_path):
    """Two sets in the same bytes, by two accessors; and an accessor that two meshes share."""
    made = Builder()
    points, texcoords, triangles = grid()
    view = made.view(texcoords.tobytes())
    position, index = made.accessor(points, bounds=True), made.accessor(triangles.ravel().astype(np.uint8))
    sets = [made.accessor(texcoords, view), made.accessor(texcoords, view)]
    for name, pair in (("A", sets), ("B", sets[1:])):
        attributes = dict(POSITION=position) | {f"TEXCOORD_{number}": each for number, each in enumerate(pair)}
        made.mesh(dict(attributes=attributes, indices=index), name=name)
    path = made.write(tmp_path / "in.glb")
    before = Parsed(path)
    for uv in (one_per_vertex, each_face_alone):
        after = patch(path, tmp_path / "out.glb", {"A": uv})
        old, new = (each.primitives() for each in (before, after))
        assert by_corners(before, old[1]) == by_corners(after, new[1])
        assert by_corners(before, old[0], ["TEXCOORD_0"]).items() <= by_corners(after, new[0], ["TEXCOORD_0"]).items()


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_what_is_compressed_is_refused(tmp_path, suffix):
    made = rich()
    made.json["meshes"][1]["primitives"][0]["extensions"] = dict(KHR_draco_mesh_compression=dict(bufferView=0))
    original = opened(made.write(tmp_path / f"draco{suffix}"))
    assert "KHR_draco_mesh_compression" in original.meshes[1].refusal and not original.meshes[0].refusal
    made = rich()
    made.json["bufferViews"][0]["extensions"] = dict(EXT_meshopt_compression={})
    assert "EXT_meshopt_compression" in opened(made.write(tmp_path / f"meshopt{suffix}")).meshes[0].refusal


@pytest.mark.parametrize("damage", ["cut", "index", "text"])
def test_what_is_broken_is_refused(tmp_path, damage):
    made = rich()
    if damage == "index":
        made.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 999
    path = made.write(tmp_path / "in.glb")
    data = path.read_bytes()
    if damage == "cut":
        path.write_bytes(data[:-100])
    elif damage == "text":
        path.write_bytes(data.replace(b'"asset"', b'"asset:'))
    with pytest.raises(PatchError):
        opened(path)


def test_a_separate_buffer(tmp_path):
    """The original's own stays; beside it the output has another one, elsewhere one with the same name."""
    path = rich().write(tmp_path / "in.gltf", indent=2)
    old = path.with_suffix(".bin").read_bytes()
    beside = patch(path, tmp_path / "out.gltf", {"Körper": one_per_vertex})
    assert beside.json["buffers"][0]["uri"] == "out.bin" and path.with_suffix(".bin").read_bytes() == old
    assert beside.text == path.read_text(encoding="utf-8").replace("in.bin", "out.bin")
    (tmp_path / "far").mkdir()
    assert patch(path, tmp_path / "far" / "out.gltf", {"Körper": one_per_vertex}).json["buffers"][0]["uri"] == "in.bin"
    assert (tmp_path / "far" / "in.bin").read_bytes() != old


def test_a_buffer_within_the_text(tmp_path):
    path = rich().write(tmp_path / "in.gltf", embedded=True)
    after = patch(path, tmp_path / "out.gltf", {"Körper": each_face_alone})
    assert after.json["buffers"][0]["uri"].startswith("data:application/octet-stream;base64,")
    assert [each.name for each in tmp_path.glob("*.bin")] == []


def test_images_come_along(tmp_path):
    made = rich()
    made.json["images"] = [dict(uri="maps/a%20b.png"), dict(uri="missing.png"), dict(uri="https://example.org/a.png")]
    path = made.write(tmp_path / "in.glb")
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "a b.png").write_bytes(b"picture")
    (tmp_path / "far").mkdir()
    patch(path, tmp_path / "far" / "out.glb", {"Körper": one_per_vertex})
    assert (tmp_path / "far" / "maps" / "a b.png").read_bytes() == b"picture"
    (tmp_path / "in").mkdir()
    path = made.write(tmp_path / "in" / "in.glb")
    made.json["images"][0]["uri"] = "../maps/a%20b.png"
    path = made.write(tmp_path / "in" / "in.glb")
    with pytest.raises(PatchError, match=r"\.\./maps/a b\.png"):
        patch(path, tmp_path / "far" / "out.glb", {"Körper": one_per_vertex})


def test_text_is_rewritten_where_it_has_to_be():
    from qh_unwrap.patching.json_text import rewritten

    text = '\n{"a" : [1.50, 2e3 , {"x":[ ]}],\r\n "b":{ }, "c":"ü\\u00e9", "d": [{"e":1},\t{"e":2.0}]} '
    old = json.loads(text)
    new = copy.deepcopy(old)
    assert rewritten(text, old, new) == text
    new["a"][2]["x"].append(5)
    new["b"]["k"], new["d"][0]["e"] = {"l": None}, 7
    new["d"].append(3)
    expected = text.replace("[ ]", "[5 ]").replace("{ }", '{"k":{"l":null} }').replace('"e":1', '"e":7')
    assert rewritten(text, old, new) == expected.replace('"e":2.0}', '"e":2.0},3')
