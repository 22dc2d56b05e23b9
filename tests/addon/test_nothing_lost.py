# SPDX-License-Identifier: GPL-3.0-or-later
"""Files through the command line: all but their UVs comes out as it went in, as far as Blender reads and writes it."""

import json
import re

import bpy
import numpy as np
import pytest
import rich
from everything import differences, everything, f_curves
from scenes import add_grid, changes, snapshot, uvs

from qh_unwrap.addon import origin
from qh_unwrap.cli import main


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model").mkdir()
    return tmp_path / "model"


def through(source, name="out"):
    """Run it to a file beside the source; returns that."""
    target = source.with_name(f"{name}{source.suffix}")
    assert main([str(source), "-o", str(target), "--placement", "unit", "--write", "export"]) == 0
    return target


def compared(source, target):
    rich.read(source)
    before, old = everything(), {mesh.name: uv_bytes(mesh) for mesh in bpy.data.meshes}
    rich.read(target)
    after, new = everything(), {mesh.name: uv_bytes(mesh) for mesh in bpy.data.meshes}
    assert old != new, "UVs are others"
    return differences(before, after)


def uv_bytes(mesh):
    return [np.array([each.vector for each in layer.uv]).tobytes() for layer in mesh.uv_layers]


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj"])
def test_everything_but_uvs_is_as_it_was(folder, suffix):
    rich.make(folder)
    source = folder / f"in{suffix}"
    rich.write(source)
    assert compared(source, through(source)) == []


def test_usd(folder):
    rich.make(folder)
    source = folder / "in.usda"
    rich.write(source)
    found = compared(source, through(source))
    expected = "|".join(
        (
            r"(Eins|Grid|Rig)[._]001",  # prims of one name have a number from now on
            r"\['of_a_material'\]",  # which Blender cannot read of some materials of an animated file
        )
    )
    assert [path for path in found if not re.search(expected, path) and path not in _RENAMED] == []


_RENAMED = (  # what refers to them
    "objects[Haut].parent",
    "objects[Rig].parent",
    "objects[Leer].constraints[Transform Cache].cache_file",
)


def test_fbx(folder):
    """Takes keep their names and values; exporters of Blender have keys for what stands still in them as well."""
    rich.make(folder)
    source = folder / "in.fbx"
    rich.write(source)
    found = compared(source, through(source))
    assert [path for path in found if ".animation_data" not in path and not path.startswith("actions[")] == []


def test_takes_of_fbx(folder):
    rich.make(folder)
    source = folder / "in.fbx"
    rich.write(source)

    def takes(path):
        rich.read(path)
        found = {}
        for action in bpy.data.actions:
            for curve in f_curves(action):
                values = [curve.evaluate(frame) for frame in range(1, 22)]
                if np.ptp(values) > 1e-3:
                    found[action.name, curve.data_path, curve.array_index] = np.round(values, 3)
        return found

    before, after = takes(source), takes(through(through(source), "again"))
    assert before.keys() == after.keys() and len(before) > 3
    assert all(np.allclose(before[key], after[key], atol=2e-3) for key in before)


@pytest.mark.parametrize("up", ['Y', 'Z'])
@pytest.mark.parametrize("unit", ['FBX_SCALE_NONE', 'FBX_SCALE_UNITS'])
def test_unit_and_axes_of_fbx(folder, up, unit):
    add_grid(2).scale = 1, 2, 3
    source, forward = folder / "in.fbx", '-Z' if up == 'Y' else 'Y'
    bpy.ops.export_scene.fbx(filepath=str(source), apply_scale_options=unit, axis_up=up, axis_forward=forward)
    target = through(source)
    assert compared(source, target) == []
    assert origin.of(source) == origin.of(target)
    assert origin.of(target).metres == (1 if unit == 'FBX_SCALE_UNITS' else 0.01) and len(origin.of(target).axes) == 6


def test_uv_maps(folder):
    for suffix in (".glb", ".usda", ".fbx"):
        rich.make(folder)
        source = folder / f"maps{suffix}"
        rich.write(source)
        target = folder / f"out{suffix}"
        assert main([str(source), "-o", str(target), "--texcoord", "1", "--object", "Haut", "--write", "export"]) == 0
        (old, old_active), (new, new_active) = map(maps_of_skin, (source, target))
        assert len(old) == len(new) == 2 and old_active == new_active, suffix
        assert np.allclose(old[0], new[0], atol=1e-5), suffix
        assert not np.allclose(old[1], new[1], atol=1e-3), suffix


def maps_of_skin(path):
    rich.read(path)
    (obj,) = [obj for obj in bpy.data.objects if obj.type == 'MESH' and len(obj.data.uv_layers) == 2]
    return [uvs(obj, layer.name) for layer in obj.data.uv_layers], obj.data.uv_layers.active.name


# .blend


def save(path, **options):
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, **options)


@pytest.mark.parametrize("mode", ['EDIT', 'POSE', 'SCULPT', 'WEIGHT_PAINT', 'VERTEX_PAINT', 'TEXTURE_PAINT'])
def test_workspaces_scene_view_layer_and_modes(folder, mode):
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.data.workspaces["UV Editing"].name = "Mine"
    scene = bpy.data.scenes.new("Second")
    layer = scene.view_layers.new("Another")
    bpy.context.window.scene, bpy.context.window.view_layer = scene, layer
    rig = rich._rig()
    for name in "ABC":
        add_grid(2, name)
    for obj in scene.objects:
        obj.select_set(obj.name in "AB")
    layer.objects.active = rig if mode == 'POSE' else bpy.data.objects["A"]
    bpy.ops.object.mode_set(mode=mode)
    before = interface()
    assert before["modes"]["B"] == ('EDIT' if mode == 'EDIT' else 'OBJECT')
    save(folder / "in.blend")
    target = through(folder / "in.blend")
    for path in (folder / "in.blend", target):
        rich.read(path)
        assert interface() == before, path.name


def interface():
    layer = bpy.context.view_layer
    return dict(
        scene=bpy.context.scene.name,
        view_layer=layer.name,
        workspaces=[each.name for each in bpy.data.workspaces],
        screens=[screen.name for screen in bpy.data.screens],
        modes={obj.name: obj.mode for obj in layer.objects},
        selected=sorted(obj.name for obj in layer.objects.selected),
        active=layer.objects.active.name,
    )


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_meshes_are_as_they_were(folder, mode):
    """Every array of the mesh, those of selection and seams as well."""
    rich.make(folder)
    obj = bpy.data.objects["Haut"]
    obj.data.edges[3].use_seam = obj.data.edges[5].use_edge_sharp = True
    obj.data.polygons[2].hide = True
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode=mode)
    save(folder / "in.blend")
    found = []
    for path in (folder / "in.blend", through(folder / "in.blend")):
        rich.read(path)
        found.append([snapshot(bpy.data.objects[name]) for name in ("Haut", "Eins")])
    assert [changes(*pair) for pair in zip(*found, strict=True)] == [{"UVMap"}, {"UVMap"}]


@pytest.mark.parametrize("compress", [True, False])
def test_compression(folder, compress):
    add_grid(2)
    save(folder / "in.blend", compress=compress)
    starts = [path.read_bytes()[:4] for path in (folder / "in.blend", through(folder / "in.blend"))]
    assert starts[0] == starts[1] != (b"BLEN" if compress else b"\x28\xb5\x2f\xfd")


# glTF


def document(path):
    return json.loads(path.read_text(encoding="utf-8"))


def test_gltf_is_a_fixed_point(folder):
    """Nodes, clips and their times, pictures in their folder: the same after two trips, and with no others."""
    rich.make(folder)
    source = folder / "in.gltf"
    rich.write(source)
    target = through(through(source), "again")
    old, new = document(source), document(target)
    for kind in ("nodes", "animations", "meshes", "cameras", "skins"):
        assert sorted(each["name"] for each in old[kind]) == sorted(each["name"] for each in new[kind]), kind
    assert [image["uri"] for image in new["images"]] == ["textures/bricks.png"]
    assert {path.name for path in folder.iterdir()} == {
        *("in.gltf", "in.bin", "out.gltf", "out.bin", "again.gltf", "again.bin", "textures")
    }

    def times(document):
        inputs = {sampler["input"] for each in document["animations"] for sampler in each["samplers"]}
        return sorted((document["accessors"][each]["count"], document["accessors"][each]["max"][0]) for each in inputs)

    assert np.allclose(times(old), times(new), atol=1e-5)


def test_loose_edges_and_points_of_gltf(folder):
    add_grid(2)
    for name, edges in (("Wire", [(0, 1), (1, 2)]), ("Cloud", [])):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([(0, 0, 1), (1, 0, 1), (2, 0, 1)], edges, [])
        bpy.context.collection.objects.link(bpy.data.objects.new(name, mesh))
    source = folder / "in.glb"
    bpy.ops.export_scene.gltf(filepath=str(source), use_mesh_edges=True, use_mesh_vertices=True)
    assert compared(source, through(source)) == []
    assert {len(mesh.vertices) for mesh in bpy.data.meshes if mesh.name in ("Wire", "Cloud")} == {3}


def test_clips_of_gltf_with_several_nodes(folder):
    for name in "AB":
        obj = add_grid(2, name)
        for clip, way in (("Walk", 1), ("Run", 2)):
            for frame in (0, 12):
                obj.location.x = frame * way
                obj.keyframe_insert("location", frame=frame)
            action = obj.animation_data.action
            action.name = f"{clip}{name}"
            obj.animation_data.nla_tracks.new().strips.new(clip, 0, action)
            obj.animation_data.nla_tracks[-1].name = clip
            obj.animation_data.action = None
    options = dict(export_animation_mode='NLA_TRACKS', export_merge_animation='NLA_TRACK')
    known = bpy.ops.export_scene.gltf.get_rna_type().properties.keys()
    options = {name: value for name, value in options.items() if name in known}
    bpy.ops.export_scene.gltf(filepath=str(folder / "in.gltf"), export_format='GLTF_SEPARATE', **options)
    paths = folder / "in.gltf", through(folder / "in.gltf")
    old, new = ({each["name"]: len(each["channels"]) for each in document(path)["animations"]} for path in paths)
    assert old == new == {"Walk": 2, "Run": 2}


@pytest.mark.parametrize("rate", [25, 30, 60])
def test_keyframes_of_gltf_are_at_whole_frames(folder, rate):
    obj = add_grid(2)
    bpy.context.scene.render.fps = rate
    for frame in (0, 1, 7):
        obj.location.x = frame
        obj.keyframe_insert("location", frame=frame)
    bpy.ops.export_scene.gltf(filepath=str(folder / "in.glb"), export_force_sampling=False)
    assert main([str(folder / "in.glb"), "-o", str(folder / "out.blend")]) == 0
    rich.read(folder / "out.blend")
    assert bpy.context.scene.render.fps == rate
    frames = {
        point.co[0] for action in bpy.data.actions for curve in f_curves(action) for point in curve.keyframe_points
    }
    assert np.allclose(sorted(frames), [0, 1, 7], atol=1e-4)


# USD


def test_default_prim_holds_all_and_is_the_same(folder):
    (folder / "in.usda").write_text(_MODEL)
    target = through(folder / "in.usda")
    text = target.read_text()
    assert 'defaultPrim = "Model"' in text and 'upAxis = "Y"' in text
    assert set(re.findall(r"^def \w+ \"(\w+)\"", text, re.MULTILINE)) == {"Model"}, "nothing is outside"
    assert re.search(r"material:binding = </Model/_materials/Red>", text)
    assert 'subdivisionScheme = "catmullClark"' in text
    (folder / "set.usda").write_text('#usda 1.0\n(upAxis = "Y")\ndef Xform "Set" (references = @out.usda@) {\n}\n')
    rich.read(folder / "set.usda")
    (obj,) = [obj for obj in bpy.data.objects if obj.type == 'MESH']
    assert [slot.name for slot in obj.material_slots] == ["Red"]


def test_default_prim_that_is_not_latin(folder):
    (folder / "in.usda").write_text(_MODEL.replace("Model", "模型"), encoding="utf-8")
    assert 'defaultPrim = "模型"' in through(folder / "in.usda").read_text(encoding="utf-8")


@pytest.mark.parametrize("suffix", [".obj", ".blend"])
def test_subdivision_surfaces_of_usd_are_not_subdivided_elsewhere(folder, suffix):
    (folder / "in.usda").write_text(_MODEL)
    assert main([str(folder / "in.usda"), "-o", str(folder / f"out{suffix}")]) == 0
    rich.read(folder / f"out{suffix}")
    (obj,) = [obj for obj in bpy.data.objects if obj.type == 'MESH']
    assert len(obj.data.polygons) == 1 and not obj.modifiers


def test_points_of_usd_are_where_they_were(folder):
    (folder / "in.usda").write_text(_MODEL)
    points = []
    for path in (folder / "in.usda", through(folder / "in.usda")):
        rich.read(path)
        bpy.context.view_layer.update()
        (obj,) = [obj for obj in bpy.data.objects if obj.type == 'MESH']
        points.append([obj.matrix_world @ vertex.co for vertex in obj.data.vertices])
    assert np.allclose(*points, atol=1e-4)


_MODEL = """#usda 1.0
(
    defaultPrim = "Model"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "Model"
{
    double3 xformOp:translate = (0, 2, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "catmullClark"
        rel material:binding = </Model/Red>
    }
    def Material "Red"
    {
        token outputs:surface.connect = </Model/Red/Shader.outputs:surface>
        def Shader "Shader"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (1, 0, 0)
            token outputs:surface
        }
    }
}
"""


# Pictures and groups


@pytest.mark.parametrize("suffix", [".obj", ".fbx", ".usda"])
@pytest.mark.parametrize("where", ["", "deeper"])
def test_paths_of_pictures_are_relative(folder, suffix, where):
    rich.make(folder)
    rich.write(folder / "in.blend")
    (folder / where).mkdir(exist_ok=True)
    target = folder / where / f"out{suffix}"
    assert main([str(folder / "in.blend"), "-o", str(target), "--object", "Eins"]) == 0
    text = (target.with_suffix(".mtl") if suffix == ".obj" else target).read_bytes()
    relative = b"../textures/bricks.png" if where else b"textures/bricks.png"
    assert re.search(rb"[^\w/.](\./)?" + re.escape(relative), text)
    if suffix != ".fbx":  # which has absolute ones beside
        assert str(folder).encode() not in text
    rich.read(target)
    (image,) = [image for image in bpy.data.images if image.name.startswith("bricks")]
    assert bpy.path.abspath(image.filepath).endswith("bricks.png") and image.size[0] == 4


def test_pictures_that_the_usd_exporter_makes_are_not_overwritten(folder):
    rich.make(folder)
    bpy.context.scene.world = bpy.data.worlds.new("Grey")
    bpy.context.scene.world.use_nodes = True
    rich.write(folder / "in.blend")
    (folder / "out").mkdir()
    arguments = [str(folder / "in.blend"), "-o", str(folder / "out" / "out.usda"), "--object", "Eins"]
    assert main(arguments) == 0
    made = sorted((folder / "out" / "textures").iterdir())
    assert len(made) == 2, "the color of the world, and the picture"
    for path in made:
        path.write_text("somebody else's")
    (folder / "out" / "out.usda").unlink()
    assert main(arguments) == 3
    assert [path.read_text() for path in made] == ["somebody else's"] * 2
    assert not (folder / "out" / "out.usda").exists()


def test_pictures_within_fbx(folder):
    rich.make(folder)
    bpy.data.images["bricks"].pack()
    bpy.ops.export_scene.fbx(filepath=str(folder / "in.fbx"), path_mode='COPY', embed_textures=True)
    (folder / "textures" / "bricks.png").unlink()
    target = through(folder / "in.fbx")
    rich.read(target)
    (image,) = [image for image in bpy.data.images if image.name.startswith("bricks")]
    assert image.packed_file and not list(folder.glob("**/*.png"))


def test_groups_and_colors_of_obj(folder):
    text = "o A\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nv 2 0 0 1 1 0\n"
    (folder / "in.obj").write_text(f"{text}g left\nf 1 2 3 4\ng right\nf 2 5 3\n")
    written = through(folder / "in.obj").read_text()
    assert re.findall(r"^g (.*)$", written, re.MULTILINE) == ["left", "right"]
    assert "v 1.000000 0.000000 0.000000 0.0000 1.0000 0.0000" in written
