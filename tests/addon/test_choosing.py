# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects, faces and UV maps of a file the command line takes, and what it says of the others."""

import json

import bpy
import numpy as np
import pytest
import rich
from scenes import add_grid, uvs

from qh_unwrap.addon import files
from qh_unwrap.cli import main


@pytest.fixture
def run(tmp_path):
    """Save what is open and run the command line on it; returns the exit code and the report."""

    def run(*arguments, suffix=".blend"):
        source, numbers = tmp_path / "in.blend", tmp_path / "report.json"
        files.save(source)
        output = tmp_path / f"out{suffix}"
        code = main([str(source), "-o", str(output), "--json", str(numbers), "--overwrite", *arguments])
        report = json.loads(numbers.read_text())
        if code < 2:
            files.load(output)
        return code, report

    return run


def unwrapped(report):
    return [island["object"] for island in report["islands"]]


def test_objects_by_patterns(run):
    for name in ("Wall.L", "Wall.R", "Floor", "Part[1]"):
        add_grid(2, name)
    assert unwrapped(run("--object", "Wall.?")[1]) == ["Wall.L", "Wall.R"]
    assert unwrapped(run("--object", "Part[1]", "--object", "F*")[1]) == ["Floor", "Part[1]"], "to the letter"


def test_collections(run):
    for name in ("Props", "Set"):
        collection = bpy.data.collections.new(name)
        bpy.context.scene.collection.children.link(collection)
        bpy.context.scene.collection.objects.unlink(obj := add_grid(2, f"Of{name}"))
        collection.objects.link(obj)
    add_grid(2, "Other")
    assert unwrapped(run("--collection", "Pro*")[1]) == ["OfProps"]


def test_unknown_names(run, capfd):
    add_grid(2)
    for flag in ("--object", "--collection", "--material"):
        code, report = run(flag, "Nose*")
        assert code == 2 and report["status"] == "usage error", flag
        assert "Nose*: the file has " in report["error"] and report["error"] in capfd.readouterr().err


def test_faces_with_a_material(run):
    obj = add_grid(4, "Two")
    for name in ("Wood", "Stone"):
        obj.data.materials.append(bpy.data.materials.new(name))
    stone = np.arange(16) >= 8
    obj.data.polygons.foreach_set("material_index", stone.astype(np.int32))
    before = uvs(obj)
    add_grid(2, "Bare")
    code, report = run("--material", "St*", "--placement", "unit")
    assert code == 0
    (island,) = report["islands"]
    assert island["faces"] == 8 and island["materials"] == ["Stone"] and island["mesh"] == obj_mesh("Two")
    assert report["skipped"] == [{"reason": "without visible faces of that material", "objects": ["Bare"]}]
    changed = (uvs(bpy.data.objects["Two"]) != before).any(axis=1).reshape(16, 4).any(axis=1)
    assert not changed[~stone].any() and changed[stone].any()


def obj_mesh(name):
    return bpy.data.objects[name].data.name


def test_what_is_skipped_is_listed(run, tmp_path, capfd):
    add_grid(2, "Distant")
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {bpy.data.objects["Distant"]})
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Distant"]
    scene.collection.objects.link(wanted.objects[0])
    add_grid(2, "Plain")
    add_grid(2, "Hidden").hide_set(True)
    add_grid(2, "Excluded")
    add_grid(2, "Screened").hide_viewport = True
    excluded = bpy.data.collections.new("Excluded")
    scene.collection.children.link(excluded)
    move(bpy.data.objects["Excluded"], excluded)
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True
    elsewhere = bpy.data.scenes.new("Elsewhere")
    move(add_grid(2, "Far"), elsewhere.collection)
    chairs = bpy.data.collections.new("Chairs")
    move(add_grid(2, "Chair"), chairs)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = 'COLLECTION', chairs
    scene.collection.objects.link(instance)
    scene.collection.objects.link(bpy.data.objects.new("Cloud", bpy.data.meshes.new("Cloud")))
    scene.collection.objects.link(bpy.data.objects.new("Again", bpy.data.objects["Plain"].data))

    code, report = run()
    assert code == 0 and unwrapped(report) == ["Plain"]
    skipped = {entry["reason"].split(" (")[0]: set(entry["objects"]) for entry in report["skipped"]}
    assert skipped == {
        "linked from another file": {"Distant"},
        "hidden": {"Hidden", "Excluded", "Screened"},
        "in another scene": {"Far"},
        "only instanced": {"Chair"},
        "without faces": {"Cloud"},
    }
    printed = capfd.readouterr().out
    assert "skipped: 1 object only instanced: Chair" in printed
    assert len([line for line in printed.splitlines() if line.startswith("skipped: ")]) == 5


def move(obj, collection):
    for old in obj.users_collection:
        old.objects.unlink(obj)
    collection.objects.link(obj)


def test_hidden_objects_can_be_asked_for_by_name(run):
    add_grid(2, "Hidden").hide_set(True)
    add_grid(2, "Plain")
    assert unwrapped(run("--object", "Hidden")[1]) == ["Hidden"]


@pytest.fixture
def rigged():
    """A panel, and a widget that a bone of a rig is drawn as."""
    add_grid(2, "Panel")
    widget = add_grid(2, "Widget")
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode='EDIT')
    rig.data.edit_bones.new("Bone").tail = 0, 0, 1
    bpy.ops.object.mode_set(mode='OBJECT')
    rig.pose.bones["Bone"].custom_shape = widget


@pytest.mark.parametrize("arguments", [(), ("--object", "*")])
def test_custom_shapes_of_bones_are_skipped(run, rigged, arguments):
    code, report = run(*arguments)
    assert code == 0 and unwrapped(report) == ["Panel"]
    (skipped,) = report["skipped"]
    assert skipped["reason"].startswith("custom shape of a bone") and skipped["objects"] == ["Widget"]


def test_custom_shapes_of_bones_can_be_asked_for_by_name(run, rigged):
    assert unwrapped(run("--object", "Widget")[1]) == ["Widget"]


def test_importing_a_skin_makes_no_meshes_of_its_bones(run, tmp_path):
    (tmp_path / "skin").mkdir()
    rich.make(tmp_path / "skin")
    rich.write(tmp_path / "in.glb")
    files.load(tmp_path / "in.glb")
    code, report = run("--weld", suffix=".glb")
    assert code == 0 and set(unwrapped(report)) == {"Eins", "Haut"} and not report["skipped"]
    assert sorted(mesh.name for mesh in bpy.data.meshes) == ["Grid", "Haut"]


def test_nothing_but_skipped_objects(run):
    add_grid(2, "Hidden").hide_set(True)
    code, report = run()
    assert code == 3 and "there is nothing to unwrap: 1 object hidden" in report["error"]
    assert report["skipped"][0]["objects"] == ["Hidden"]


def state(obj):
    layers = obj.data.uv_layers
    return layers.active.name, next(layer.name for layer in layers if layer.active_render)


@pytest.mark.parametrize("arguments", [("--uv-map", "Light"), ("--texcoord", "1")])
@pytest.mark.parametrize("is_there", [False, True])
def test_another_map(run, arguments, is_there):
    obj = add_grid(4)
    if is_there:
        obj.data.uv_layers.new(name="Light")
    before, active = uvs(obj, "UVMap"), state(obj)
    code, report = run(*arguments, "--placement", "unit")
    assert code == 0
    (obj,) = bpy.context.scene.objects
    first, second = obj.data.uv_layers.keys()
    assert first == "UVMap" and second == ("Light" if is_there or arguments[0] == "--uv-map" else "UVMap.001")
    assert state(obj) == active == ("UVMap", "UVMap")
    assert np.array_equal(uvs(obj, "UVMap"), before)
    assert np.ptp(uvs(obj, second), axis=0).max() == pytest.approx(1)
    assert report["islands"][0]["map"] == second


def test_the_only_map_is_active(run):
    add_grid(4, uv=False)
    assert run("--uv-map", "Light")[0] == 0
    assert state(bpy.context.scene.objects[0]) == ("Light", "Light")


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_formats_with_one_map_get_the_new_one(run, suffix):
    add_grid(4)
    assert run("--uv-map", "Light", "--placement", "unit", suffix=suffix)[0] == 0
    (obj,) = bpy.context.scene.objects
    assert np.ptp(uvs(obj), axis=0).min() < 0.995, "the old one is the whole square"


def test_a_new_map_is_not_left_where_all_failed(run):
    add_grid(4, "Good")
    bpy.ops.mesh.primitive_cube_add()
    assert run("--uv-map", "Light", "--cut", "never")[0] == 1
    assert bpy.data.objects["Cube"].data.uv_layers.keys() == ["UVMap"]
    assert bpy.data.objects["Good"].data.uv_layers.keys() == ["UVMap", "Light"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--texcoord", "3"), "Grid has 1 UV map: --texcoord can be 1 at most"),
        (("--texcoord", "-1"), "--texcoord is -1"),
        (("--uv-map", ""), "the UV map has no name"),
        (("--uv-map", "Dirt"), "cannot have a UV map Dirt"),
        (("--uv-map", "a", "--texcoord", "1"), "not allowed with"),
    ],
)
def test_maps_that_cannot_be(run, arguments, message):
    add_grid(2).data.color_attributes.new("Dirt", 'FLOAT_COLOR', 'POINT')
    code, report = run(*arguments)
    assert code == 2 and message in report["error"]
