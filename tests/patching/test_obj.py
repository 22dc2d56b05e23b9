# SPDX-License-Identifier: GPL-3.0-or-later
"""Other UVs in OBJ files, and every other byte as it was."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from qh_unwrap.patching.formats import opened
from qh_unwrap.patching.original import Change, Layer, PatchError

LAYER = Layer(0, "UVMap", is_new=False)
ODD = b"""# made by hand \\
  and going on
mtllib  some stuff.mtl
v 0 0.000 0\t1 0 0
v  1.0e0 0 0 # right
v 1 1 0\r
v 0 1 0
g left right
vt 0.50 0.5 0
vt 1 0
vt 1 1
vt .25
s 1
usemtl  Paint
f 1/1/1 2/2/1 3/3/1 \\
  4/4/1
l 1/2 2/3
o \xc3\x9cber
v 0 0 1
v 1 0 1
v 1 1 1
f -3 -2 -1
f -3//1 -1//1 1//1 # the same again
vt 7 7
f -3/-1 -2/-1 -1/-1
f 5/5 6/1 7/2
p 1
# the end"""


def reading(data):
    """An independent reading: of every face its points and UVs, by their values, and all other text without `vt`."""
    data = re.sub(rb"\\[ \t\r]*\n", lambda match: b"\0" + match[0][:-1] + b"\1", data)
    points, uvs, faces, others = [], [], [], []
    for line in data.split(b"\n"):
        code, _, comment = line.partition(b"#")
        words = re.sub(rb"[\0\1\\]", b" ", code).split()
        if words[:1] == [b"vt"]:
            uvs.append(tuple(np.float32([*words[1:3], b"0"][:2])))
            continue
        if words[:1] == [b"v"]:
            points.append(words[1:])
        if words[:1] in ([b"f"], [b"l"]):
            face = []
            for word in words[1:]:
                vertex, uv, *_ = [*word.split(b"/"), b"", b""]
                vertex, uv = int(vertex), int(uv or 0)
                face.append(
                    (vertex - 1 if vertex > 0 else vertex + len(points), uvs[uv - 1 if uv > 0 else uv] if uv else None)
                )
            faces.append((words[0], face))
            line = re.sub(rb"(?<![^\s])(-?\d+)(?:/(?:-?\d*))?(/-?\d+)?(?!\S)", rb"\1<\2>", code) + comment
        others.append(line)
    return faces, others


def patched(path, uvs, changed=None):
    """The new text, where the meshes get these UVs (one array each), or only the faces that changed."""
    original = opened(path)
    changes = []
    for number, mesh in enumerate(original.meshes):
        if number in uvs:
            faces = np.ones(len(mesh.sizes), dtype=bool) if changed is None else changed[number]
            changes.append(Change(mesh, LAYER, np.float32(uvs[number]), faces))
    output = path.with_name("out.obj")
    original.write(output, output, changes)
    return output.read_bytes()


def write(folder, data):
    path = folder / "in.obj"
    path.write_bytes(data)
    return path


def test_nothing_new_changes_nothing(tmp_path):
    assert patched(write(tmp_path, ODD), {}) == ODD


def test_every_kind_of_line(tmp_path):
    uvs = {0: np.arange(8).reshape(4, 2) / 8, 1: np.arange(24).reshape(12, 2) / 32}
    path = write(tmp_path, ODD)
    text = patched(path, uvs)
    faces, others = reading(text)
    old_faces, old_others = reading(ODD)
    assert others == old_others
    assert [[corner[0] for corner in face] for _, face in faces] == [
        [corner[0] for corner in face] for _, face in old_faces
    ]
    found = [uv for kind, face in faces if kind == b"f" for _, uv in face]
    assert np.array_equal(found, np.float32(np.concatenate([uvs[0], uvs[1]])))
    (line,), (old_line,) = ([face for kind, face in each if kind == b"l"] for each in (faces, old_faces))
    assert line == old_line
    assert b"f -3/-" in text and b"f -3/-12/1 " not in text, "relative numbers stay relative"


def test_lines_stay_where_each_uv_stays_one(tmp_path):
    """With the same seams only `vt` lines change, each in its place, with what else is in it."""
    data = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0 5 # a\r\nvt  1\t0\nvt 1 1\nvt 0 1\nvt 9 9\n"
    data += b"f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    new = np.float32([(0.125, 0), (0.5, 0.25), (1 / 3, 2)])
    text = patched(write(tmp_path, data), {0: [*new, new[0], new[2], (5, 1e-8)]})
    expected = data.replace(b"vt 0 0 5", b"vt 0.125 0.0 5").replace(b"vt  1\t0", b"vt  0.5\t0.25")
    assert text == expected.replace(b"vt 1 1", b"vt 0.33333334 2.0").replace(b"vt 0 1", b"vt 5.0 0.00000001")


def test_new_lines_stand_before_what_needs_them(tmp_path):
    """And take the line ends of their neighbours; without any UVs they come after the points."""
    data = b"v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nusemtl A\r\nf 1 2 3\r\nf 3 2 1"
    text = patched(write(tmp_path, data), {0: np.zeros((6, 2))})
    assert text == data.replace(b"0\r\nusemtl", b"0\r\n" + b"vt 0.0 0.0\r\n" * 3 + b"usemtl").replace(
        b"f 1 2 3\r\nf 3 2 1", b"f 1/1 2/2 3/3\r\nf 3/3 2/2 1/1"
    )


def test_two_faces_share_a_uv_where_point_and_value_are_the_same(tmp_path):
    """Whether UVs hang together is told by their numbers: also where a face that changed meets one that did not."""
    data = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 3 3\nvt 4 4\nf 1/1 2/2 3/3\nf 1/4 3/5 4/4\n"
    text = patched(write(tmp_path, data), {0: [(7, 7)] * 3 + [(0, 0), (1, 1), (0, 1)]}, {0: np.array([False, True])})
    assert text == data.replace(b"f 1/4 3/5 4/4", b"f 1/1 3/3 4/4").replace(b"vt 3 3", b"vt 0.0 1.0")


def test_faces_that_did_not_change_keep_all_their_bytes(tmp_path):
    path = write(tmp_path, ODD)
    before = opened(path)
    mesh = before.meshes[1]
    changed = np.arange(len(mesh.sizes)) == 2
    uv = np.full((len(mesh.corner_vertex), 2), 0.5)
    lines = patched(path, {1: uv}, {1: changed}).split(b"\n")
    old = ODD.split(b"\n")
    assert [line for line in old if line not in lines] == [b"f -3/-1 -2/-1 -1/-1"]


@pytest.mark.parametrize(
    "data", [b"v 0 0 0\nf 1 2 3\n", b"v 0 0\nf 1 1 1\n", b"v 0 0 0\nf 1 1 x\n", b"v 0 0 0\nf 1/1 1/1 1/1\nvt 0 0\n"]
)
def test_what_is_broken_is_refused(tmp_path, data):
    with pytest.raises(PatchError):
        opened(write(tmp_path, data))


def test_materials_and_their_images_come_along(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "images").mkdir()
    (tmp_path / "some stuff.mtl").write_text("newmtl Paint\nmap_Kd -s 1 1 1 images/a b.png\nbump gone.png\n")
    (tmp_path / "images" / "a b.png").write_bytes(b"picture")
    original, output = opened(write(tmp_path, ODD)), tmp_path / "far" / "out.obj"
    original.write(output, output, [])
    assert (tmp_path / "far" / "some stuff.mtl").is_file() and (tmp_path / "far" / "images" / "a b.png").is_file()
    assert output.read_bytes() == ODD
    (tmp_path / "up.mtl").write_text("newmtl Paint\n")
    (tmp_path / "in").mkdir()
    original = opened(write(tmp_path / "in", b"mtllib ../up.mtl\n" + ODD))
    with pytest.raises(PatchError, match=r"up\.mtl"):
        original.write(output, output, [])


@some.composite
def files(draw):
    """OBJ text with a few objects, formatted at random, and new UVs for some of the faces."""
    end = draw(some.sampled_from([b"\n", b"\r\n"]))
    space = some.sampled_from([b" ", b"  ", b"\t", b" \\" + end + b" "])
    number = some.sampled_from([b"0", b"1", b"-1", b"0.50", b".5", b"1e-1", b"-2.", b"+3"])
    lines, points, uvs, faces = [], 0, 0, []

    def line(*words):
        text = words[0]
        for word in words[1:]:
            text += draw(space) + word
        lines.append(text + draw(some.sampled_from([b"", b" ", b" # note"])))

    for _ in range(draw(some.integers(1, 3))):
        line(b"o", draw(some.sampled_from([b"A", b"A", "Ö".encode()])))
        faces.append([])
        for _ in range(draw(some.integers(1, 3))):
            for _ in range(draw(some.integers(0 if points else 3, 4))):
                line(b"v", *(draw(number) for _ in range(draw(some.sampled_from([3, 4, 6])))))
                points += 1
            for _ in range(draw(some.integers(0, 4))):
                line(b"vt", *(draw(number) for _ in range(draw(some.integers(1, 3)))))
                uvs += 1
            line(b"vn", b"0", b"0", b"1")
            for _ in range(draw(some.integers(0, 3))):
                has_uv, has_normal = draw(some.booleans()) and uvs > 0, draw(some.booleans())
                corners = []
                for _ in range(draw(some.integers(3, 5))):
                    vertex = draw(some.integers(1, points))
                    text = b"%d" % (vertex if draw(some.booleans()) else vertex - 1 - points)
                    uv = draw(some.integers(1, uvs)) if has_uv else 0
                    if has_uv:
                        text += b"/%d" % (uv if draw(some.booleans()) else uv - 1 - uvs)
                    corners.append(text + (b"" if not has_normal else b"/1" if has_uv else b"//1"))
                line(draw(some.sampled_from([b"f", b"f", b" f"])), *corners)
                faces[-1].append(len(corners))
            if uvs and draw(some.booleans()):
                line(b"l", b"1/%d" % uvs, b"-1/-1")
            lines.append(draw(some.sampled_from([b"", b"s off", b"usemtl x", b"# f 1/1", b"g a b"])))
    faces = [each for each in faces if each]
    changed = {k: np.array([draw(some.booleans()) for _ in each], dtype=bool) for k, each in enumerate(faces)}
    value = some.sampled_from([0.0, 1.0, 0.5, 1 / 3, -2.0, 1e-9, 1e6])
    new = {k: np.array([(draw(value), draw(value)) for _ in range(sum(each))]) for k, each in enumerate(faces)}
    return end.join(lines) + draw(some.sampled_from([b"", end])), faces, new, changed


@settings(max_examples=200, deadline=None, derandomize=True)
@given(files())
def test_any_formatting(tmp_path_factory, made):
    data, sizes, new, changed = made
    text = patched(write(tmp_path_factory.mktemp("obj"), data), new, changed)
    faces, others = reading(text)
    old_faces, old_others = reading(data)
    assert others == old_others
    assert [face for kind, face in faces if kind == b"l"] == [face for kind, face in old_faces if kind == b"l"]
    found = [face for kind, face in faces if kind == b"f"]
    expected = [face for kind, face in old_faces if kind == b"f"]
    place = 0
    for number, each in enumerate(sizes):
        corner = 0
        for face, size in enumerate(each):
            if changed[number][face]:
                uv = [tuple(pair) for pair in np.float32(new[number][corner : corner + size])]
                expected[place] = [(vertex, pair) for (vertex, _), pair in zip(expected[place], uv, strict=True)]
            corner, place = corner + size, place + 1
    assert found == expected
