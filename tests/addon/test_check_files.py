# SPDX-License-Identifier: GPL-3.0-or-later
"""`qh-unwrap --check` on files with known faults: every one is found, and none that is not there."""

import json

import bpy
import numpy as np
import pytest
from scenes import add_grid, mesh_object, uvs
from test_check import flat_grid, image, put
from test_command_line_reports import checked

import qh_unwrap
from qh_unwrap import cli
from qh_unwrap.addon import files

_SQUARE = np.array([(0, 0), (0.3, 0), (0.3, 0.3), (0, 0.3)])


def _valid():
    flat_grid()


def _flip():
    obj = flat_grid()
    uv = uvs(obj)
    uv[(uv == (0, 0)).all(axis=1)] += 0.4  # beyond the diagonal of its face, into the next ones
    put(obj, uv)


def _within():
    """A band that winds around by more than a turn."""
    angle = np.linspace(0, 2.3 * np.pi, 40)
    ring = np.concatenate([radius * np.column_stack([np.cos(angle), np.sin(angle)]) for radius in (0.4, 0.2)]) + 0.5
    start = np.arange(39)
    faces = np.column_stack([start, start + 1, start + 41, start + 40])[:, ::-1]
    obj = mesh_object("Band", np.column_stack([ring, np.tile(angle, 2)]).tolist(), faces.tolist())
    put(obj, ring[faces].reshape(-1, 2))


def _between():
    put(flat_grid(2), np.concatenate([_SQUARE, _SQUARE + (0.2, 0.2), _SQUARE + (0.6, 0), _SQUARE + (0.6, 0.6)]))


def _of_two_objects():
    for name, shift in (("One", 0.0), ("Two", 0.1)):
        obj = flat_grid(2, name)
        put(obj, 0.5 * uvs(obj) + shift)
        obj.data.materials.append(bpy.data.materials.get("Shared") or bpy.data.materials.new("Shared"))


def _collapsed():
    obj = flat_grid()
    uv = uvs(obj)
    uv[:4] = uv[:4].mean(axis=0)  # a face in one place
    uv[16:20, 1] = 0.9  # and one on a line
    put(obj, uv)


def _unset():
    put(flat_grid(), np.zeros((64, 2)))


def _new_map():
    put(add_grid(3), np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (9, 1)))


def _no_numbers():
    obj = flat_grid()
    uv = uvs(obj)
    uv[7] = np.inf
    put(obj, uv)


def _tile():
    obj = flat_grid()
    put(obj, uvs(obj) + (0, 1))


def _border():
    obj = flat_grid()
    put(obj, uvs(obj) + 0.25)


def _stacked():
    mirrored = _SQUARE[[1, 0, 3, 2]]
    put(flat_grid(2), np.concatenate([_SQUARE, _SQUARE, mirrored, _SQUARE + (0.5, 0)]))


def _image_with_tiles():
    obj = flat_grid()
    put(obj, uvs(obj) + (0, 1))
    image(obj, tiles=(1011,))


# Of each file what makes it, and the faults that are in it
_FILES = {
    "valid": (_valid, set()),
    "flip": (_flip, {"flipped", "itself"}),
    "within": (_within, {"itself"}),
    "between": (_between, {"others"}),
    "of two objects": (_of_two_objects, {"others"}),
    "collapsed": (_collapsed, {"no area"}),
    "unset": (_unset, {"unset"}),
    "new map": (_new_map, {"unset"}),
    "no numbers": (_no_numbers, {"no numbers"}),
    "tile 1011": (_tile, {"tile 1011"}),
    "border": (_border, {"border"}),
    "stacked": (_stacked, set()),
    "image with tiles": (_image_with_tiles, set()),
}
_KINDS = ("flipped", "itself", "no area", "unset", "no numbers", "tile 1011", "border")


def found(report):
    """The kinds of faults in a report."""
    texts = [text for island in report["islands"] for text in [*island.get("faults", ()), island.get("error", "")]]
    kinds = {kind for kind in _KINDS if any(kind in text for text in texts)}
    assert len([text for text in texts if text]) == sum(kind in text for text in texts for kind in _KINDS), texts
    return kinds | ({"others"} if any(island.get("overlaps") for island in report["islands"]) else set())


@pytest.mark.parametrize("name", _FILES)
def test_every_fault_is_found_and_none_invented(name, tmp_path, capfd):
    make, expected = _FILES[name]
    make()
    path = tmp_path / "in.blend"
    files.save(path)
    before = path.read_bytes()
    code = cli.main(["--check", str(path), "--json", str(tmp_path / "out.json")])
    report = checked((tmp_path / "out.json").read_text())
    assert found(report) == expected
    assert code == report["exit_code"] == bool(expected) and report["status"] == ("faults" if expected else "ok")
    assert path.read_bytes() == before and sorted(each.name for each in tmp_path.iterdir()) == ["in.blend", "out.json"]
    told = "".join(capfd.readouterr()).replace("lies on", "others")
    assert "Traceback" not in told and all(kind in told for kind in expected)


def test_the_report_holds_the_published_measures(tmp_path):
    obj = add_grid(5)
    image(obj)
    files.save(tmp_path / "in.blend")
    report = qh_unwrap.unwrap_file(tmp_path / "in.blend", check=True)
    (island,) = report["islands"]
    assert report["published"] == pytest.approx(island["published"]) and len(island["published"]) == 9
    assert report["check"]["texel_density"] == pytest.approx(island["texel_density"])
    unwrapped = qh_unwrap.unwrap_file(tmp_path / "in.blend")
    assert unwrapped["published"]["symmetric_dirichlet_energy"] < report["published"]["symmetric_dirichlet_energy"]
    after = unwrapped["islands"][0]["after"]["symmetric_dirichlet"]
    assert unwrapped["islands"][0]["published"]["symmetric_dirichlet_energy"] == pytest.approx(2 * after, rel=1e-5)


def test_infinite_measures_are_null(tmp_path, capfd):
    _collapsed()
    files.save(tmp_path / "in.blend")
    capfd.readouterr()
    assert cli.main(["--check", str(tmp_path / "in.blend"), "--json", "-"]) == 1
    report = checked(capfd.readouterr().out)
    assert report["published"]["max_angle_distortion"] is None and json.dumps(report, allow_nan=False)


@pytest.mark.parametrize("flags", [["-o", "out.blend"], ["--preview", "out.png"], ["--seams-from-islands"]])
def test_it_writes_nothing_else(flags, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["--check", "suzanne", *flags]) == 2
    assert "--check changes and writes nothing but the report: leave out --" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


def test_it_takes_the_map_that_is_asked_for(tmp_path, capfd):
    obj = flat_grid()
    obj.data.uv_layers.new(name="Second")
    put_into = obj.data.uv_layers["Second"].uv
    put_into.foreach_set("vector", (uvs(obj, "UVMap") + 5).astype(np.float32).ravel())
    flat_grid(name="Other")
    files.save(tmp_path / "in.blend")
    assert cli.main(["--check", str(tmp_path / "in.blend")]) == 0
    assert cli.main(["--check", str(tmp_path / "in.blend"), "--uv-map", "Second", "--object", "Grid"]) == 1
    capfd.readouterr()
    assert cli.main(["--check", str(tmp_path / "in.blend"), "--uv-map", "Second", "--object", "Other"]) == 1
    assert "its UVs are unset" in capfd.readouterr().err
