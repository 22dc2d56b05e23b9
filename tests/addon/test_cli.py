# SPDX-License-Identifier: GPL-3.0-or-later
import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from scenes import add_cube, add_grid, uvs

from qh_unwrap import __version__
from qh_unwrap.addon import files
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.cli import main
from qh_unwrap.core import Settings
from qh_unwrap.core.seam_settings import SeamSettings

_ROOT = Path(__file__).parents[2]


def make_file(path, *, cube=False):
    """A grid named Panel with a material, away from the origin, and perhaps a cube, which cannot be unwrapped."""
    bpy.ops.wm.read_homefile(use_empty=True)
    obj = add_grid(4, "Panel", location=(1, 2, 3))
    obj.data.name = "Panel"
    obj.rotation_euler = (0.1, 0.2, 0.3)
    for polygon in obj.data.polygons:
        polygon.use_smooth = True
    obj.data.materials.append(bpy.data.materials.new("Paint"))
    if cube:
        add_cube("Box")
    bpy.context.view_layer.update()
    if path.suffix == ".stl":
        bpy.ops.wm.stl_export(filepath=str(path))
    else:
        files.save(path)
    return path


def world_points(obj):
    points = [obj.matrix_world @ vertex.co for vertex in obj.data.vertices]
    return np.unique(np.round(points, 4), axis=0)


@pytest.mark.parametrize("suffix", sorted(files.WRITERS))
def test_round_trip(tmp_path, suffix):
    source, target = make_file(tmp_path / f"in{suffix}"), tmp_path / "out" / f"out{suffix}"
    target.parent.mkdir()
    (old,) = files.load(source)
    name, materials, points = old.name, [slot.name for slot in old.material_slots], world_points(old)
    assert len(points) == 25
    assert main([str(source), "-o", str(target), "--weld", "--placement", "unit", "--write", "export"]) == 0
    (new,) = files.load(target)
    assert np.allclose(world_points(new), points, atol=1e-3)
    assert [slot.name for slot in new.material_slots] == materials
    if suffix != ".ply":  # knows neither
        assert new.name == name == "Panel"
        assert materials == ["Paint"]
    assert len(np.unique(np.round(uvs(new), 5), axis=0)) == 25
    assert np.ptp(uvs(new), axis=0).max() == pytest.approx(1, abs=1e-3)
    assert not [path for path in target.parent.iterdir() if path.name.startswith(".")]


def test_reads_stl(tmp_path):
    assert main([str(make_file(tmp_path / "in.stl")), "-o", str(tmp_path / "out.obj")]) == 0


def test_blend_keeps_everything_else(tmp_path):
    source, target = make_file(tmp_path / "in.blend"), tmp_path / "out.blend"
    assert main([str(source), "-o", str(target), "--preview", str(tmp_path / "p.png")]) == 0
    before = files.load(source) and {block: block.id_type for block in bpy.data.user_map()}
    names = sorted((id_type, block.name) for block, id_type in before.items())
    files.load(target)
    assert sorted((block.id_type, block.name) for block in bpy.data.user_map()) == names
    image = bpy.data.images.load(str(tmp_path / "p.png"))
    assert tuple(image.size) == (1200, 600)
    pixels = np.array(image.pixels[:]).reshape(600, 1200, 4)[..., :3]
    assert pixels[:, :600].std() > 0.05 and pixels[:, 600:].std() > 0.05, "something is on both sides"


def test_failure_writes_the_rest_and_exits_with_1(tmp_path, capfd):
    source, target = make_file(tmp_path / "in.blend", cube=True), tmp_path / "out.blend"
    assert main([str(source), "-o", str(target), "--cut", "never"]) == 1
    printed = capfd.readouterr()
    assert "Box (6 faces) is closed: mark a seam" in printed.err and "Panel 1" in printed.out
    panel = next(obj for obj in files.load(target) if obj.name == "Panel")
    assert len(np.unique(np.round(uvs(panel), 5), axis=0)) == 25


def test_file_without_a_mesh(tmp_path, capfd):
    empty = tmp_path / "empty.obj"
    empty.write_text("# nothing\n")
    assert main([str(empty)]) == 3
    assert "there is no mesh" in capfd.readouterr().err


def test_nothing_done_writes_nothing(tmp_path):
    source, target = make_file(tmp_path / "in.blend", cube=True), tmp_path / "out.blend"
    assert main([str(source), "-o", str(target), "--object", "Box", "--cut", "never"]) == 3
    assert not target.exists()


def test_file_that_is_no_mesh(tmp_path, capfd):
    broken, target = tmp_path / "broken.glb", tmp_path / "out.obj"
    broken.write_bytes(b"not a mesh")
    assert main([str(broken), "-o", str(target)]) == 3
    assert "broken.glb" in capfd.readouterr().err
    assert not target.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.obj"], "there is no file missing.obj"),
        (["in.obj", "-o", "out.xyz"], "cannot write out.xyz"),
        (["in.obj", "-o", "out.stl"], "cannot write out.stl"),
        (["text.txt"], "cannot read text.txt"),
        (["in.obj", "-o", "nowhere/out.obj"], "there is no folder"),
        (["in.obj", "-o", "in.obj"], "in.obj exists"),
        (["in.obj", "-o", "text.obj"], "text.mtl exists"),
        (["in.obj", "--json", "text.txt"], "text.txt exists"),
        (["in.obj", "--object", "Nose"], "there is no mesh object Nose: the file has Panel"),
        (["in.obj", "--balance", "2"], "balance"),
        (["in.obj", "--boundary", "heart"], "boundary"),
        (["in.obj", "--no-such-flag"], "no-such-flag"),
        (["in.obj", "--margin", "-3"], "margin"),
        ([], "INPUT"),
    ],
)
def test_wrong_usage_exits_with_2(tmp_path, monkeypatch, capfd, arguments, message):
    make_file(tmp_path / "in.obj")
    for suffix in (".txt", ".mtl"):
        (tmp_path / f"text{suffix}").write_text("text")
    present = {path: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert message in capfd.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == present


def test_overwrite(tmp_path):
    source = make_file(tmp_path / "in.obj")
    old = source.read_bytes()
    assert main([str(source), "-o", str(source), "--overwrite"]) == 0
    assert source.read_bytes() != old


def test_failed_writing_leaves_the_old_file(tmp_path, monkeypatch):
    source, target = make_file(tmp_path / "in.obj"), tmp_path / "out.obj"
    target.write_text("old")

    def half(filepath):
        Path(filepath).write_text("half")
        raise RuntimeError("disk full")

    monkeypatch.setitem(files.WRITERS, ".obj", half)
    assert main([str(source), "-o", str(target), "--overwrite", "--write", "export"]) == 3
    assert target.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.mtl", "in.obj", "out.obj"]


def test_every_setting_is_a_flag(capfd):
    assert main(["--help"]) == 0
    text = capfd.readouterr().out
    for field in (field for kind in (Settings, MeshOptions, SeamSettings) for field in dataclasses.fields(kind)):
        if field.name != "distortion":  # which --cut says
            assert f"--{field.name.replace('_', '-')} " in text
            for choice in field.metadata["choices"]:
                assert choice.identifier in text or (field.name == "cut" and choice.identifier.lower() in text)


def test_json(tmp_path):
    source, numbers = make_file(tmp_path / "in.blend", cube=True), tmp_path / "numbers.json"
    assert (
        main(
            [
                str(source),
                "--json",
                str(numbers),
                "--balance",
                "0.5",
                "--no-repair",
                "--boundary",
                "rectangle",
                "--cut",
                "Never",
            ]
        )
        == 1
    )
    document = json.loads(numbers.read_text())
    expected = dataclasses.asdict(Settings(balance=0.5, repair=False, boundary="RECTANGLE"))
    assert document["settings"] == expected | dataclasses.asdict(MeshOptions())
    assert document["versions"]["qh_unwrap"] == __version__
    assert document["versions"]["blender"] == bpy.app.version_string
    islands = {island["object"]: island for island in document["islands"]}
    assert "seam" in islands["Box"]["error"]
    panel = islands["Panel"]
    assert panel["faces"] == 16 and panel["after"]["flips"] == 0 and panel["after"]["l2_stretch"] >= 1
    assert panel["before"]["l2_stretch"] >= 1


def test_seams_from_islands(tmp_path):
    bpy.ops.mesh.primitive_cube_add()
    source = tmp_path / "cube.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(source), copy=True)
    assert main([str(source), "--cut", "never"]) == 3, "closed"
    target = tmp_path / "out.blend"
    assert main([str(source), "--seams-from-islands", "-o", str(target)]) == 0
    (obj,) = files.load(target)
    assert sum(edge.use_seam for edge in obj.data.edges) == 7, "the cross that Blender lays out"


def test_weld_joins_what_stl_and_gltf_split(tmp_path):
    bpy.ops.wm.read_homefile(use_empty=True)
    add_grid(4, "Flat")
    source, numbers = tmp_path / "in.glb", tmp_path / "numbers.json"
    files.save(source)
    assert main([str(source), "--json", str(numbers), "--no-weld"]) == 0
    assert len(json.loads(numbers.read_text())["islands"]) > 1, "flat shading splits every edge"
    assert main([str(source), "--json", str(numbers), "--overwrite"]) == 0
    assert len(json.loads(numbers.read_text())["islands"]) == 1


def test_suzanne(tmp_path, capfd):
    target = tmp_path / "suzanne.blend"
    assert main(["suzanne", "-o", str(target)]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines[1:-1]] == [["Suzanne", str(number)] for number in range(1, 6)]
    assert lines[-1].split()[:2] == ["total", "500"]
    (obj,) = files.load(target)
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1


def test_object_saved_in_edit_mode(tmp_path):
    obj = add_grid(3)
    bpy.ops.object.mode_set(mode='EDIT')
    source, target = tmp_path / "in.blend", tmp_path / "out.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(source), copy=True)
    old = uvs(obj)
    assert main([str(source), "-o", str(target)]) == 0
    (obj,) = files.load(target)
    assert not np.array_equal(uvs(obj), old)


def test_relative_paths_in_blend_files_still_lead_there(tmp_path):
    image = bpy.data.images.new("Image", 4, 4)
    image.filepath_raw = str(tmp_path / "image.png")
    image.save()
    add_grid(3)
    source = tmp_path / "in.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(source))
    image.filepath = "//image.png"
    image.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(source))
    target = tmp_path / "deeper" / "out.blend"
    target.parent.mkdir()
    assert main([str(source), "-o", str(target)]) == 0
    files.load(target)
    assert os.path.samefile(bpy.path.abspath(bpy.data.images["Image"].filepath), tmp_path / "image.png")


def test_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "qh_unwrap", "missing.obj"], cwd=_ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "there is no file missing.obj" in done.stderr


def test_core_needs_no_blender():
    code = "import sys, qh_unwrap.core, qh_unwrap.cli; sys.exit('bpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=_ROOT, check=False).returncode == 0
