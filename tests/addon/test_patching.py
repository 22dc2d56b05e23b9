# SPDX-License-Identifier: GPL-3.0-or-later
"""Files patched by the command line: what Blender reads of them has the new UVs, and all else is as it was."""

import json
import os
import re
import subprocess
import sys

import bpy
import numpy as np
import pytest
from gltf_files import Builder, Parsed, grid, rich
from scenes import add_grid, uvs

import qh_unwrap
from qh_unwrap.addon import files, patches
from qh_unwrap.cli import main
from qh_unwrap.patching import formats

needs_usd = pytest.mark.skipif(bool(formats.lacks(".usd")), reason="needs usd-core")
OBJ = b"""# two panels and a triangle, which Blender reads as three objects
mtllib x.mtl
o Panel
v 0 0 0\r
v 1 0 0
v 1 1 0.5
v 0 1 0
f 1 2 3 4
o Panel
v 2 0 0
v 3 0 0.25
v 3 1 0
v 2 1 0
vt 0 0
f 5 5 6
f -4/1 -3/1 -2/1 -1/1
o \xd0\x94\xd0\xbe\xd0\xbc
v 5 0 0
v 6 0 0
v 5 1 0
f 9 10 11
"""
USD = """#usda 1.0
(
    customLayerData = { string maker = "hand" }
    defaultPrim = "World"
    endTimeCode = 10
    metersPerUnit = 0.01
    startTimeCode = 1
    timeCodesPerSecond = 30
    upAxis = "Y"
)

def Xform "World"
{
    custom string secret = "kept"

    def Xform "Left"
    {
        double3 xformOp:translate = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def Mesh "Geom"
        {
            int[] faceVertexCounts = [4, 3]
            int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 2]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 1)]
            texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0)] (
                interpolation = "vertex"
            )
            texCoord2h[] primvars:half = [(0, 0), (0.125, 0), (0.25, 0.5), (0, 1), (0.5, 0.5), (1, 0.5), (0.75, 1)] (
                interpolation = "faceVarying"
            )
            custom int[] secret.timeSamples = { 1: [1, 2], 2: [3] }
        }
    }

    def Xform "Right"
    {
        double3 xformOp:translate = (5, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]

        def Mesh "Geom"
        {
            uniform token orientation = "leftHanded"
            int[] faceVertexCounts = [4, 3]
            int[] faceVertexIndices = [3, 2, 1, 0, 2, 4, 1]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 1)]
            texCoord2f[] primvars:st = [(0, 1), (1, 1), (1, 0), (0, 0), (2, 0)] (
                interpolation = "faceVarying"
            )
            int[] primvars:st:indices = [0, 1, 2, 3, 1, 4, 2]
        }
    }
}
"""


def shown(name=None):
    """The UVs of the active or the named maps, by the place of the object's first corner."""
    return {place(obj): uvs(obj, name) for obj in bpy.data.objects if obj.type == 'MESH' and obj.data.uv_layers}


def place(obj):
    corner = obj.matrix_world @ obj.data.vertices[obj.data.loops[0].vertex_index].co
    return tuple(np.round(corner, 4))


def read(path, name=None):
    files.load(path)
    return shown(name)


def alike(one, other, within=0.0):
    assert one.keys() == other.keys()
    assert all(np.abs(one[key] - other[key]).max() <= within for key in one)
    return True


def run(source, output, **options):
    report = qh_unwrap.unwrap_file(source, output, **options)
    assert report["not_patched"] is None
    assert report["exit_code"] == 0 and report["write"] == "patch"
    return report


def test_obj(tmp_path):
    path = tmp_path / "in.obj"
    path.write_bytes(OBJ)
    run(path, tmp_path / "out.obj")
    made, text = shown(), (tmp_path / "out.obj").read_bytes()
    assert alike(read(tmp_path / "out.obj"), made)
    assert b"\nf 5 5 6\n" in text, "what Blender leaves out stays"

    def without(text):
        return re.sub(rb"(?<=\d)/-?\d+", b"", re.sub(rb"(?m)^vt .*\n", b"", text))

    assert without(text) == without(OBJ)
    assert not [each for each in os.listdir(tmp_path) if each.endswith(".mtl")]


def test_only_what_was_asked_for_changes(tmp_path):
    path = tmp_path / "in.obj"
    path.write_bytes(OBJ)
    run(path, tmp_path / "out.obj", object="Panel.001")
    text = (tmp_path / "out.obj").read_bytes()
    assert text.split(b"o Panel")[1] == OBJ.split(b"o Panel")[1], "the other one of that name"
    assert text.partition(b"o \xd0")[2] == OBJ.partition(b"o \xd0")[2]
    assert text != OBJ


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize(
    "options", [{}, dict(object="Körper", texcoord=1), dict(object="Körper", material="皮"), dict(uv_map="Light")]
)
def test_gltf(tmp_path, suffix, options):
    path = rich().write(tmp_path / f"in{suffix}")
    before = Parsed(path)
    run(path, tmp_path / f"out{suffix}", **options)
    number = options.get("texcoord", 2 if "uv_map" in options else 0)
    obj = bpy.data.objects["Körper"]
    made = uvs(obj, obj.data.uv_layers[number].name)
    after = Parsed(tmp_path / f"out{suffix}")
    after.check()
    for name in before.json.keys() - {"accessors", "bufferViews", "buffers", "meshes"}:
        assert after.json[name] == before.json[name], name
    files.load(tmp_path / f"out{suffix}")
    obj = bpy.data.objects["Körper"]
    assert np.abs(uvs(obj, obj.data.uv_layers[number].name) - made).max() <= 6e-8


def test_gltf_meshes_that_are_alike(tmp_path):
    """Instances are one mesh; twins with one name are told apart by their order."""
    made = Builder()
    points, texcoords, triangles = grid(3)
    for number in range(3):
        attributes = dict(POSITION=made.accessor(points, bounds=True), TEXCOORD_0=made.accessor(texcoords))
        index = made.accessor(triangles.ravel().astype(np.uint8))
        node = dict(name="Wheel", translation=[0, 0, 10.0 * number])
        made.mesh(dict(attributes=attributes, indices=index), name="Wheel", node=node)
    made.node(name="Again", mesh=1, translation=[50, 0, 0])
    path = made.write(tmp_path / "in.glb")
    for options in (dict(placement="PACK"), dict(object="Wheel.002")):
        run(path, tmp_path / "out.glb", overwrite=True, **options)
        result = shown()
        assert alike(read(tmp_path / "out.glb"), result, 6e-8)


def test_faces_that_blender_leaves_out(tmp_path):
    """Doubled ones follow those that they double, lest they part from them; those without area split no vertex."""
    made = Builder()
    points, texcoords, triangles = grid(6)
    triangles = np.concatenate([triangles[:20], [(3, 3, 4)], triangles[20:], triangles[:5, ::-1], [(1, 2, 1)]])
    attributes = dict(POSITION=made.accessor(points, bounds=True), TEXCOORD_0=made.accessor(texcoords))
    made.mesh(dict(attributes=attributes, indices=made.accessor(triangles.ravel().astype(np.uint8))))
    path = made.write(tmp_path / "in.glb")
    run(path, tmp_path / "out.glb")
    result = shown()
    assert [len(each) for each in result.values()] == [3 * 72]
    assert alike(read(tmp_path / "out.glb"), result, 6e-8)
    assert Parsed(tmp_path / "out.glb").text == Parsed(path).text


def test_a_polygon_that_blender_takes_apart_is_no_patch(tmp_path):
    path = tmp_path / "in.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nf 1 2 2 3 4\nf 2 5 6 3\n")
    assert "faces of in are not those" in qh_unwrap.unwrap_file(path, tmp_path / "out.obj")["not_patched"]


@needs_usd
@pytest.mark.parametrize(("suffix", "name"), [(".usda", "New one"), (".usdc", "st"), (".usd", "st")])
def test_usd(tmp_path, suffix, name):
    (tmp_path / "in").mkdir()
    path, output = tmp_path / "in" / f"a{suffix}", tmp_path / f"out{suffix}"
    text = tmp_path / "in" / "text.usda"
    text.write_text(USD)
    converted(text, path)
    old = path.read_bytes()
    run(path, output, uv_map=name)
    made = shown(name)
    assert path.read_bytes() == old
    assert alike(read(output, name.replace(" ", "_")), made)
    meta = described(output)
    assert meta["subLayers"] == [f"./in/a{suffix}"]
    assert {key: value for key, value in meta.items() if key != "subLayers"} == described(path)


@needs_usd
@pytest.mark.parametrize("suffix", [".usda", ".usd"])
def test_usd_in_place(tmp_path, suffix):
    text, path = tmp_path / "text.usda", tmp_path / f"a{suffix}"
    text.write_text(USD)
    converted(text, path)
    run(path, path, overwrite=True)
    made = shown()
    assert alike(read(path), made)
    converted(path, back := tmp_path / "back.usda")
    kept = [line for line in USD.splitlines() if "primvars:st" not in line and "interpolation" not in line]
    missing = {line.strip() for line in kept} - {line.strip() for line in back.read_text().splitlines()}
    assert not [line for line in missing if "timeSamples" not in line and "customLayerData" not in line], missing
    assert 'string maker = "hand"' in back.read_text() and "1: [1, 2]," in back.read_text()


@needs_usd
def test_usd_that_is_referenced_gets_its_uvs_in_the_file_that_was_read(tmp_path):
    parts, path = tmp_path / "Тест a.usda", tmp_path / "root.usda"
    parts.write_text(USD.replace("texCoord2f[]", "float2[]", 1).replace('"Left"', '"Größe"'), encoding="utf-8")
    text = (
        '#usda 1.0\n(\n    upAxis = "Z"\n)\n\ndef Xform "Root" (\n    prepend references = @./Тест a.usda@\n)\n{\n}\n'
    )
    path.write_text(text, encoding="utf-8")
    old = parts.read_bytes()
    run(path, path, overwrite=True)
    result = shown()
    assert alike(read(path), result) and len(result) == 2 and parts.read_bytes() == old
    assert "float2[] primvars:st" in path.read_text(encoding="utf-8")


@needs_usd
def test_usd_instances_stay(tmp_path):
    """Blender shows them as instances of a collection, which are not unwrapped."""
    mesh = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n"
    mesh += "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]"
    text = f'{USD}\nclass "Proto"\n{{\n def Mesh "Part"\n {{\n{mesh}\n}}\n}}\n'
    for name in ("One", "Two"):
        text += f'def Xform "{name}" (\n instanceable = true\n inherits = </Proto>\n)\n{{\n}}\n'
    path = tmp_path / "in.usda"
    path.write_text(text)
    run(path, tmp_path / "out.usda")
    assert not re.search("Part|Proto", (tmp_path / "out.usda").read_text())


@needs_usd
@pytest.mark.parametrize(("name", "word"), [("half", "16-bit floats"), ("moving", "change over time")])
def test_usd_that_cannot_be_patched(tmp_path, name, word):
    path, values = tmp_path / "in.usda", "[(0, 0), (1, 0), (1, 1), (0, 1), (%d, 0)]"
    moving = (
        'texCoord2f[] primvars:moving (interpolation = "vertex")\n            texCoord2f[] primvars:moving.timeSamples'
    )
    moving += f" = {{ 1: {values % 2}, 2: {values % 3} }}\n            custom int[] secret."
    path.write_text(USD.replace("custom int[] secret.", moving))
    report = qh_unwrap.unwrap_file(path, tmp_path / "out.usda", uv_map=name)
    assert report["exit_code"] == 0 and word in report["not_patched"]


def usd(code, *arguments):
    """What a program with USD's library, in a process of its own, prints."""
    command = [sys.executable, "-c", f"from pxr import Sdf, Usd\nimport sys, json\n{code}", *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def converted(source, target):
    usd("Sdf.Layer.FindOrOpen(sys.argv[1]).Export(sys.argv[2])", source, target)


def described(path):
    code = "layer = Sdf.Layer.FindOrOpen(sys.argv[1])\nroot = layer.pseudoRoot\n"
    code += "print(json.dumps({key: list(layer.subLayerPaths) if key == 'subLayers' else str(root.GetInfo(key)) "
    return json.loads(usd(code + "for key in root.ListInfoKeys() if key != 'subLayerOffsets'}))", path))


@pytest.mark.parametrize(
    ("source", "output", "message"),
    [
        ("in.blend", "out.blend", "always exported"),
        ("in.obj", "out.glb", "different formats"),
        ("suzanne", "out.obj", "is no file"),
        ("in.obj", None, "needs an output"),
    ],
)
def test_what_is_always_exported(tmp_path, source, output, message):
    add_grid(2)
    if source != "suzanne":
        files.save(tmp_path / source)
        source = tmp_path / source
    with pytest.raises(qh_unwrap.UsageError, match=message):
        qh_unwrap.unwrap_file(source, output and tmp_path / output, write="patch")
    report = qh_unwrap.unwrap_file(source, output and tmp_path / output)
    assert report["write"] == ("export" if output else None) and report["not_patched"] is None


def test_the_default(tmp_path, monkeypatch):
    assert patches.mode(None, tmp_path / "a.obj", tmp_path / "b.obj") == "patch"
    assert patches.mode("export", tmp_path / "a.obj", tmp_path / "b.obj") == "export"
    monkeypatch.setattr(formats, "find_spec", lambda name: None)
    assert patches.mode(None, tmp_path / "a.usda", tmp_path / "b.usda") == "export"
    with pytest.raises(qh_unwrap.UsageError, match=r"qh-unwrap\[files\]"):
        patches.mode("patch", tmp_path / "a.usda", tmp_path / "b.usda")
    with pytest.raises(qh_unwrap.UsageError, match="choose patch or export"):
        qh_unwrap.unwrap_file("suzanne", write="both")


def test_what_cannot_be_patched_is_exported_unless_that_is_ruled_out(tmp_path, capfd):
    made = rich()
    made.json["accessors"][0]["extras"] = "kept"
    path = made.write(tmp_path / "in.glb")
    broken = path.read_bytes().replace(b"ACME_secret", b"ACME_secreT")
    path.write_bytes(broken)
    skin = rich()
    del skin.json["skins"][0]["inverseBindMatrices"]  # then Blender moves the points
    skin.json["nodes"][-2]["translation"] = [0, 3, 0]
    joints = skin.json["skins"][0]["joints"]
    skin.json["nodes"][joints[1]]["translation"] = [0, 3, 0]
    path = skin.write(tmp_path / "skin.glb")
    numbers = tmp_path / "report.json"
    assert main([str(path), "-o", str(tmp_path / "out.glb"), "--json", str(numbers)]) == 0
    report = json.loads(numbers.read_text())
    assert report["write"] == "export" and "Körper" in report["not_patched"]
    assert f"exported, not patched: {report['not_patched']}" in capfd.readouterr().out
    (tmp_path / "out.glb").unlink()
    assert main([str(path), "-o", str(tmp_path / "out.glb"), "--write", "patch"]) == 3
    assert "use --write export" in capfd.readouterr().err and not (tmp_path / "out.glb").exists()


def test_siblings_are_not_overwritten(tmp_path):
    path = tmp_path / "in.obj"
    path.write_bytes(OBJ)
    (tmp_path / "x.mtl").write_text("newmtl A\n")
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "x.mtl").write_text("old")
    report = qh_unwrap.unwrap_file(path, tmp_path / "far" / "out.obj")
    assert report["exit_code"] == 3 and "x.mtl exists" in report["error"]
    assert [each.name for each in (tmp_path / "far").iterdir()] == ["x.mtl"]
    run(path, tmp_path / "far" / "out.obj", overwrite=True)
    assert (tmp_path / "far" / "x.mtl").read_text() == "newmtl A\n"
