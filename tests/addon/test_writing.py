# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line with originals: whatever goes wrong, what was there before is there afterwards, and whole."""

import errno
import logging
import os
import signal
import stat
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import bpy
import io_scene_gltf2
import pytest
from scenes import add_grid

from qh_unwrap.addon import checking, files, jobs, preview, writing
from qh_unwrap.addon.failures import FileError
from qh_unwrap.cli import main

resource = pytest.importorskip("resource", reason="only Unix has limits for the sizes of files")

WRITTEN = sorted(files.WRITERS)


@pytest.fixture
def source(tmp_path):
    """A file with a grid, large enough that its file does not fit where little room is left."""
    add_grid(40)
    path = tmp_path / "source" / "in.blend"
    path.parent.mkdir()
    files.save(path)
    return path


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "folder"
    path.mkdir()
    return path


@contextmanager
def room_for(size):
    """No file can become larger than this; who does not look at what the system says, leaves one that is cut off."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("suffix", WRITTEN)
def test_full_disk_leaves_the_old_files(source, folder, suffix, capfd):
    target = folder / f"out{suffix}"
    for path in (target, target.with_suffix(".mtl"), target.with_suffix(".bin")):
        path.write_text("old")
    before = contents(folder)
    with room_for(8000):
        assert main([str(source), "-o", str(target), "--overwrite"]) == 3
    assert contents(folder) == before
    printed = capfd.readouterr()
    assert f"cannot write {target}" in printed.err and printed.err.count("\n") == 1, "one line, and no traceback"
    assert not printed.out, "nothing is said to be done"


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_full_disk_leaves_the_old_preview_and_output(source, folder, suffix, monkeypatch, capfd):
    monkeypatch.setattr(preview, "_WIDTH", 200)
    monkeypatch.setattr(preview, "_HEIGHT", 100)
    target, picture = folder / "out.obj", folder / f"picture{{x}}##{suffix}"
    target.write_text("old")
    picture.write_text("old")
    before = contents(folder)
    arguments = [str(source), "-o", str(target), "--preview", str(picture), "--overwrite"]
    with room_for(1500):
        assert main(arguments) == 3
    assert f"cannot write {picture}" in capfd.readouterr().err
    assert contents(folder) == before
    assert main(arguments) == 0
    assert picture.read_bytes().startswith(b"\xff\xd8" if suffix == ".jpg" else b"\x89PNG")


@pytest.mark.parametrize("suffix", WRITTEN)
@pytest.mark.parametrize("part", [0.3, 0.98])
def test_what_is_cut_off_is_seen(folder, suffix, part):
    add_grid(20)
    path = folder / f"a{suffix}"
    files.save(path)
    checking.check(path, checking.content())
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(FileError, match="disk full"):
        checking.check(path, checking.content())


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb", ".gltf", ".fbx", ".usda"])
def test_missing_faces_are_seen(folder, suffix):
    add_grid(5)
    path = folder / f"a{suffix}"
    files.save(path)
    add_grid(5)
    with pytest.raises(FileError, match="faces in place of"):
        checking.check(path, checking.content())


def test_meshes_that_exporters_change_are_no_reason_to_fail(folder, source):
    """Modifiers, instances, and what is hidden: how many faces that makes is up to the exporter."""
    add_grid(4).modifiers.new("Array", 'ARRAY')
    add_grid(4).modifiers.new("Decimate", 'DECIMATE').ratio = 0.3
    add_grid(4).hide_render = True
    shared = add_grid(4)
    bpy.context.collection.objects.link(bpy.data.objects.new("Second", shared.data))
    bpy.ops.curve.primitive_bezier_circle_add()
    for suffix in WRITTEN:
        files.save(folder / f"a{suffix}")


def test_siblings_found_at_the_end_are_not_overwritten(source, folder, capfd):
    image = bpy.data.images.new("Bricks", 4, 4)
    image.filepath_raw, image.file_format = str(source.with_name("bricks.png")), 'PNG'
    image.save()
    material = bpy.data.materials.new("Wall")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.context.object.data.materials.append(material)
    files.save(source)
    (folder / "bricks.png").write_text("somebody else's")
    assert main([str(source), "-o", str(folder / "out.gltf")]) == 3
    assert contents(folder) == {"bricks.png": b"somebody else's"}
    assert f"{folder / 'bricks.png'} exists" in capfd.readouterr().err
    (folder / "bricks.png").write_bytes(source.with_name("bricks.png").read_bytes())
    assert main([str(source), "-o", str(folder / "out.gltf")]) == 0, "the same picture is in nobody's way"


def test_the_files_are_replaced_all_or_none(folder):
    for name in "ab":
        (folder / name).write_text("old")
    (folder / "c").mkdir()
    before = contents(folder)
    with pytest.raises(OSError), writing.Staging(overwrite=True) as staging:
        for name in "abc":
            staging.write_text(folder / name, "new")
        staging.put_in_place()
    assert contents(folder) == before


def test_files_and_folders_are_synced_before_and_after_the_exchange(folder, monkeypatch):
    done = []
    fsync, replace = os.fsync, os.replace

    def sync(handle):
        done.append("folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(os, "replace", lambda *paths: done.append("replace") or replace(*paths))
    add_grid(2)
    files.save(folder / "a.obj")
    assert done == ["file", "file", "replace", "replace", "folder"]


def test_symbolic_links_stay_and_modes_are_kept(source, folder):
    real, link = folder / "real" / "model.obj", folder / "out.obj"
    real.parent.mkdir()
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    assert main([str(source), "-o", str(link), "--overwrite"]) == 0
    assert link.is_symlink() and b"vt " in real.read_bytes()
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert (folder / "out.mtl").is_file(), "beside the name that the file is read by"
    assert sorted(contents(folder)) == ["out.mtl", "out.obj", "real/model.obj"]


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="needs a second file system")
def test_symbolic_link_to_another_disk(source, folder):
    import tempfile

    with tempfile.TemporaryDirectory(dir="/dev/shm") as other:
        place = Path(other, "model.blend")
        place.write_text("old")
        (folder / "out.blend").symlink_to(place)
        assert main([str(source), "-o", str(folder / "out.blend"), "--overwrite"]) == 0
        assert [obj.name for obj in files.load(place)] == ["Grid"]
        assert os.listdir(other) == ["model.blend"] and os.listdir(folder) == ["out.blend"]


def test_room_is_looked_at_before_the_work(source, folder, capfd, monkeypatch):
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr(writing.shutil, "disk_usage", lambda folder: usage)
    monkeypatch.setattr(jobs, "unwrap_targets", lambda *_: pytest.fail("the work has begun"))
    assert main([str(source), "-o", str(folder / "out.obj")]) == 3
    assert "are needed, and 0.0 MB are free" in capfd.readouterr().err


def test_full_disk_is_named_where_blender_says_something_else(source, folder, capfd, monkeypatch):
    def fail(filepath):
        monkeypatch.setattr(writing.shutil, "disk_usage", lambda folder: type("Usage", (), {"free": 0}))
        raise RuntimeError("Error: No such file or directory")

    monkeypatch.setitem(files.WRITERS, ".blend", fail)
    assert main([str(source), "-o", str(folder / "out.blend")]) == 3
    assert "No such file or directory (the disk is full)" in capfd.readouterr().err


def test_folder_that_takes_no_files_is_found_before_the_work(source, folder, capfd, monkeypatch):
    def refuse(dir):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(writing.tempfile, "TemporaryFile", refuse)
    monkeypatch.setattr(files, "load", lambda *_: pytest.fail("the work has begun"))
    assert main([str(source), "-o", str(folder / "out.obj")]) == 3
    assert f"cannot write to the folder {folder}: Read-only file system" in capfd.readouterr().err


def test_signal_that_a_handler_of_blender_swallows(source, folder, capfd):
    def stop(*_):
        signal.raise_signal(signal.SIGTERM)

    bpy.app.handlers.load_pre.append(stop)  # which Blender forgets when it has loaded the file
    assert main([str(source), "-o", str(folder / "out.obj")]) == 143
    assert capfd.readouterr().err == "qh-unwrap: error: stopped by SIGTERM\n" and not contents(folder)


@pytest.mark.parametrize("when", ["read", "unwrap", "write", "put in place"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_leave_nothing(source, folder, capfd, monkeypatch, when, number, code):
    target = folder / "out.gltf"
    target.write_text("old")
    place, name = {
        "read": (files, "load"),
        "unwrap": (jobs, "unwrap_targets"),
        "write": (io_scene_gltf2.ExportGLTF2, "execute"),  # where Blender makes another exception of what comes
        "put in place": (writing.os, "replace"),
    }[when]
    whole = getattr(place, name)

    def stopped(*args, **kwargs):
        signal.raise_signal(number)
        return whole(*args, **kwargs)

    monkeypatch.setattr(place, name, stopped)
    monkeypatch.setattr(logging, "raiseExceptions", False)  # the exporter's logger keeps a stream of another test
    handlers = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    assert main([str(source), "-o", str(target), "--overwrite"]) == code
    monkeypatch.undo()
    assert [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)] == handlers
    printed = capfd.readouterr()
    assert printed.err == f"qh-unwrap: error: stopped by {number.name}\n" and not printed.out
    if when == "put in place":  # which is not left half way
        assert sorted(contents(folder)) == ["out.bin", "out.gltf"] and target.read_bytes() != b"old"
    else:
        assert contents(folder) == {"out.gltf": b"old"}


def test_signals_at_any_time_leave_the_original_or_the_result(source):
    """A program of its own that replaces its input.  While Python itself starts and ends, a signal just kills it."""
    before, length = contents(source.parent), None
    for number, share in ((None, None), (signal.SIGINT, 0.3), (signal.SIGTERM, 0.6)):
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-m", "qh_unwrap", source, "-o", source, "--overwrite"],
            cwd=Path(__file__).parents[2],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        if number:
            time.sleep(share * length)
            process.send_signal(number)
        _, errors = process.communicate(timeout=60)
        length = length or time.perf_counter() - start
        after = contents(source.parent)
        assert after.keys() == before.keys() and b"Traceback" not in errors
        assert process.returncode in ((0, 128 + number, -number) if number else (0,))
        if process.returncode > 0:
            assert after == before
        before = after
