# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command line says of what an output format cannot hold, and of what Blender warns of."""

import json
import re

import bpy
import pytest
import rich
from scenes import add_grid

from qh_unwrap.addon import files, losses, streams
from qh_unwrap.cli import main


@pytest.fixture
def run(tmp_path, capfd):
    """Run it on a file; returns the report, and what was shown."""

    def run(source, output, *arguments):
        numbers = tmp_path / "report.json"
        main(
            [
                str(source),
                "-o",
                str(tmp_path / output),
                "--json",
                str(numbers),
                "--overwrite",
                "--write",
                "export",
                *arguments,
            ]
        )
        return json.loads(numbers.read_text()), capfd.readouterr().out.splitlines()

    return run


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "rich.blend"
    rich.make(tmp_path)
    files.save(path)
    return path


def test_one_uv_map(run, tmp_path):
    add_grid(2).data.uv_layers.new(name="Lightmap")
    files.save(tmp_path / "in.blend")
    message = "model.obj holds one UV map: Lightmap is written, UVMap is not"
    report, shown = run(tmp_path / "in.blend", "model.obj", "--uv-map", "Lightmap")
    assert report["not_written"] == [{"kind": "UV maps", "names": ["UVMap"], "message": message}]
    assert shown.count(message) == 1


def test_maps_that_are_active_here_and_there(run, tmp_path):
    for name in "ab":
        layers = add_grid(2, name).data.uv_layers
        layers.new(name="Lightmap")
        layers.active = layers["UVMap" if name == "a" else "Lightmap"]
    files.save(tmp_path / "in.blend")
    (loss,) = run(tmp_path / "in.blend", "model.ply")[0]["not_written"]
    assert loss["message"] == "model.ply holds one UV map: of each mesh the active one is written, others are not"


@pytest.mark.parametrize(
    ("output", "kinds"),
    [
        ("a.blend", ""),
        ("a.obj", "UV maps, animation, armature, shape keys, cameras, lights, custom properties, attributes"),
        (
            "a.ply",
            "UV maps, materials, animation, armature, shape keys, vertex groups, cameras, lights, custom properties",
        ),
        ("a.glb", "polygons"),
        ("a.fbx", "attributes"),
        ("a.usda", ""),
    ],
)
def test_a_line_for_each_kind(run, source, output, kinds):
    report, shown = run(source, output)
    assert ", ".join(loss["kind"] for loss in report["not_written"]) == kinds
    lines = [line for line in shown if line.startswith(f"{output} holds ")]
    assert lines == [loss["message"] for loss in report["not_written"]]


def test_names_are_told(run, source):
    found = {loss["kind"]: loss for loss in run(source, "a.ply")[0]["not_written"]}
    assert found["materials"]["names"] == ["Ziegel", "木材"]
    assert found["shape keys"]["message"] == "a.ply holds no shape keys: Größer, Wide are not written"
    assert found["animation"]["names"] == ["Fahrt", "Wachsen", "Winken"]


def test_hidden_objects(run, tmp_path):
    add_grid(2, "Plain")
    add_grid(2, "Hidden").hide_set(True)
    add_grid(2, "Unseen").hide_render = True
    add_grid(2, "Apart")
    apart = bpy.data.collections.new("Apart")
    bpy.context.scene.collection.children.link(apart)
    bpy.context.collection.objects.unlink(bpy.data.objects["Apart"])
    apart.objects.link(bpy.data.objects["Apart"])
    bpy.context.view_layer.layer_collection.children["Apart"].exclude = True
    files.save(tmp_path / "in.blend")
    for suffix, names in ((".obj", "Hidden Apart"), (".fbx", "Apart"), (".usda", "Unseen Apart"), (".glb", "")):
        report, _ = run(tmp_path / "in.blend", f"a{suffix}")
        found = [loss["names"] for loss in report["not_written"] if loss["kind"] == "hidden objects"]
        assert found == ([names.split()] if names else []), suffix
        if suffix != ".usda":  # where the names of meshes come back
            rich.read(tmp_path / f"a{suffix}")
            written = {obj.name for obj in bpy.data.objects}
            assert written == {"Plain", "Hidden", "Unseen", "Apart"} - set(names.split()), suffix


def test_modifiers_that_stay_behind(run, tmp_path):
    add_grid(2).modifiers.new("Round", 'SUBSURF')
    files.save(tmp_path / "in.blend")
    assert run(tmp_path / "in.blend", "a.glb")[0]["not_written"][0]["message"] == (
        "a.glb holds no modifiers: Round is not written"
    )


def test_nothing_is_lost_of_a_plain_mesh(tmp_path):
    add_grid(2)
    for suffix in files.WRITERS:
        found = [loss.kind for loss in losses.of(tmp_path / f"a{suffix}")]
        assert found == (["polygons"] if suffix in (".glb", ".gltf") else []), suffix


# Warnings


def test_missing_library_and_picture(run, tmp_path):
    add_grid(2, "Far")
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {bpy.data.objects["Far"]})
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Far"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    add_grid(2, "Near").data.materials.append(rich._material("Wood", rich._picture(tmp_path)))
    files.save(tmp_path / "in.blend")
    (tmp_path / "library.blend").unlink()
    (tmp_path / "textures" / "bricks.png").unlink()
    report, shown = run(tmp_path / "in.blend", "out.blend")
    assert report["status"] == "ok"
    told = "\n".join(report["warnings"])
    assert re.search("Unable to open '.*library.blend'", told) and "1 picture not found: bricks.png" in told
    assert [line for line in shown if line.startswith("Blender warns: ")] == [
        f"Blender warns: {text}" for text in report["warnings"]
    ]


def test_newer_blender(run, tmp_path):
    add_grid(2)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "in.blend"), copy=True, compress=False)
    data = (tmp_path / "in.blend").read_bytes()
    newer = re.sub(rb"v(\d+)", lambda found: b"v" + b"0999"[-len(found[1]) :], data[:20], count=1)
    (tmp_path / "in.blend").write_bytes(newer + data[20:])
    report, _ = run(tmp_path / "in.blend", "out.blend")
    assert any("newer Blender" in text for text in report["warnings"])


def test_missing_picture_of_gltf(run, tmp_path):
    rich.make(tmp_path)
    rich.write(tmp_path / "in.gltf")
    (tmp_path / "textures" / "bricks.png").unlink()
    assert any("bricks.png" in text for text in run(tmp_path / "in.gltf", "out.gltf")[0]["warnings"])


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("Warning: Unable to open 'a.blend'", "Unable to open 'a.blend'"),
        (
            "WARN (io.obj): source/blender/a.cc:73 load_image_at_path: Cannot load image file: 'a'",
            "Cannot load image file: 'a'",
        ),
        ("00:01.399  io.obj           | WARNING Cannot load image file: 'a'", "Cannot load image file: 'a'"),
        ("03:27:55 | ERROR: Missing image file (index 0): a", "Missing image file (index 0): a"),
        ("Warning: in BindingsAtPrim at line 669 of /a/b.cpp -- Found material bindings", "Found material bindings"),
        ("Cannot load image file: 'a'", "Cannot load image file: 'a'"),
        ("KeyError: 'a'", "'a'"),
        ("Info: Saved copy as 'error.blend'", None),
        ("03:27:55 | INFO: Warning signs imported", None),
        ("ERROR Draco is not available because library could not be found", None),
    ],
)
def test_what_counts_as_a_warning(line, text):
    assert streams.warnings([line, line]) == ([text] if text else [])
