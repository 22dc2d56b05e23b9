# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command line tells: exit codes, the report in JSON, the table, the bar; and the same from Python."""

import io
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
from scenes import add_cube, add_grid, mesh_object

import qh_unwrap
from qh_unwrap import cli, console
from qh_unwrap.addon import document, files, jobs
from qh_unwrap.addon.outcome import listed
from qh_unwrap.cli import main

_ROOT = Path(__file__).parents[2]
SCHEMA = json.loads((_ROOT / "docs" / "report.schema.json").read_text())
_TYPES = dict(object=dict, array=list, string=str, integer=int, number=(int, float), boolean=bool, null=type(None))


def faults(value, schema, where="report"):
    """What of the value is not as the schema says, by as much of JSON Schema as ours needs."""
    if "$ref" in schema:
        schema = SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]
    if "anyOf" in schema:
        found = [list(faults(value, each, where)) for each in schema["anyOf"]]
        yield from () if [] in found else found[0]
    if "const" in schema and value != schema["const"]:
        yield f"{where} is {value!r}"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{where} is {value!r}"
    kinds = schema.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    if kinds and not any(isinstance(value, _TYPES[kind]) for kind in kinds):
        yield f"{where} is a {type(value).__name__}"
    if isinstance(value, dict):
        yield from (f"{where} lacks {name}" for name in schema.get("required", ()) if name not in value)
        for name, each in value.items():
            inner = schema.get("properties", {}).get(name, schema.get("additionalProperties"))
            if inner is None and "properties" in schema:
                yield f"{where} has {name}, which is not described"
            yield from faults(each, inner or {}, f"{where}.{name}")
    if isinstance(value, list):
        for number, each in enumerate(value):
            yield from faults(each, schema.get("items", {}), f"{where}[{number}]")


def checked(text):
    def refuse(name):
        pytest.fail(f"{name} is no JSON")

    report = json.loads(text, parse_constant=refuse)
    assert not list(faults(report, SCHEMA))
    return report


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "in.blend"
    add_grid(4, "Panel")
    files.save(path)
    return path


@pytest.fixture
def mixed(tmp_path):
    path = tmp_path / "mixed.blend"
    obj = add_grid(4, "Panel")
    obj.data.materials.append(bpy.data.materials.new("Paint"))
    add_cube("Box")
    files.save(path)
    return path


def run(*arguments, report):
    code = main([*map(str, arguments), "--json", str(report)])
    found = checked(report.read_text())
    assert found["exit_code"] == code
    return found


def test_report_of_a_good_run(source, tmp_path):
    target = tmp_path / "out.gltf"
    report = run(source, "-o", target, report=tmp_path / "r.json")
    assert report["status"] == "ok" and report["error"] is None
    assert sorted(report["files"]) == [str(tmp_path / "out.bin"), str(target)]
    assert report["totals"] == dict(objects=1, islands=1, certified=1, failed=0, flips=0, collapsed=0, faces=16)
    assert 0 < report["times"]["unwrap"] < report["times"]["total"]
    (island,) = report["islands"]
    assert [island[name] for name in ("object", "map", "materials", "certified")] == ["Panel", "UVMap", [], True]


def test_report_of_a_run_that_goes_well_in_part(mixed, tmp_path):
    report = run(mixed, "-o", tmp_path / "out.obj", "--cut", "never", report=tmp_path / "r.json")
    assert report["status"] == "partial" and report["exit_code"] == 1
    assert report["totals"]["failed"] == 1 and report["totals"]["objects"] == 2
    by_name = {island["object"]: island for island in report["islands"]}
    assert by_name["Panel"]["materials"] == ["Paint"] and "closed" in by_name["Box"]["error"]


@pytest.mark.parametrize(
    ("arguments", "code", "status"),
    [
        (["--object", "Box"], 3, "failed"),
        (["--object", "Nose"], 2, "usage error"),
        (["--balance", "7"], 2, "usage error"),
        (["--balance", "much"], 2, "usage error"),
        (["--no-such-flag"], 2, "usage error"),
        (["--preview", "p.gif"], 2, "usage error"),
        (["--bal", "0.5"], 2, "usage error"),
    ],
)
def test_no_old_success_is_left(mixed, tmp_path, arguments, code, status):
    report = tmp_path / "r.json"
    run(mixed, "--object", "Panel", report=report)
    found = run(mixed, *arguments, "--overwrite", "--cut", "never", report=report)
    assert (found["exit_code"], found["status"]) == (code, status) and found["error"]


def test_unreadable_input_and_a_fault_of_ours(source, tmp_path, monkeypatch, capfd):
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"no mesh")
    found = run(broken, report=tmp_path / "r.json")
    assert found["exit_code"] == 3 and f"cannot read {broken}" in found["error"]
    assert capfd.readouterr().err.count("\n") == 1
    monkeypatch.setattr(jobs, "unwrap_targets", lambda *_: 1 / 0)
    found = run(source, report=tmp_path / "s.json")
    assert found["exit_code"] == 3 and "ZeroDivisionError" in found["error"]


def test_while_it_runs_the_report_says_so(source, tmp_path, monkeypatch):
    report = tmp_path / "r.json"
    load, seen = files.load, []

    def look(path):
        seen.append(checked(report.read_text()))
        return load(path)

    monkeypatch.setattr(files, "load", look)
    run(source, report=report)
    assert [(found["status"], found["exit_code"]) for found in seen] == [("running", None)]


def test_a_report_replaces_nothing_else(source, tmp_path, capfd):
    before = source.read_bytes()
    for arguments in (
        ["--json", str(source)],
        ["--json", str(source), "--bogus"],
        ["--json", str(source), "-o", "x.y"],
    ):
        assert main([str(source), *arguments, "--overwrite"]) == 2
    target = str(tmp_path / "same.obj")
    assert main([str(source), "-o", target, "--json", target]) == 2
    assert "is asked for twice" in capfd.readouterr().err
    assert source.read_bytes() == before and os.listdir(tmp_path) == [source.name]


def test_json_on_the_standard_output(source, capfd):
    assert main([str(source), "--json", "-"]) == 0
    printed = capfd.readouterr()
    assert checked(printed.out)["status"] == "ok" and not printed.err
    assert main([str(source), "--json", "-", "--object", "Nose"]) == 2
    assert checked(capfd.readouterr().out)["status"] == "usage error"


def test_infinite_measures_are_null():
    assert cli.Record().to_dict()["exit_code"] is None
    found = document._finite({"a": [math.inf, 1.0], "b": math.nan})
    assert found == {"a": [None, 1.0], "b": None}


def test_strict(tmp_path, monkeypatch):
    """A strip whose outline is kept folded over is unwrapped, and not certified."""
    obj = mesh_object(
        "Strip",
        [(x, y, 0) for x in range(4) for y in (0, 1)],
        [(2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1) for k in range(3)],
    )
    layer = obj.data.uv_layers.new(name="UVMap")
    places = np.array([obj.data.vertices[loop.vertex_index].co[:2] for loop in obj.data.loops])
    places[places[:, 0] == 3, 0] = 1.5
    layer.uv.foreach_set("vector", places.astype(np.float32).ravel())
    files.save(tmp_path / "in.blend")
    arguments = [tmp_path / "in.blend", "--boundary", "KEEP", "-o", tmp_path / "out.blend", "--overwrite"]
    loose = run(*arguments, report=tmp_path / "r.json")
    assert loose["exit_code"] == 0 and loose["totals"]["certified"] == 0
    strict = run(*arguments, "--strict", report=tmp_path / "r.json")
    assert strict["exit_code"] == 1 and strict["totals"]["failed"] == 1
    assert str(tmp_path / "out.blend") in strict["files"]


def many_quads(path, objects=2, each=30):
    for number in range(objects):
        points = [(3 * k + x, y, 0) for k in range(each) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        mesh_object(f"Quads{number}", points, np.arange(4 * each).reshape(-1, 4).tolist())
    files.save(path)


def test_a_row_for_each_object_where_there_are_many(tmp_path, capfd):
    many_quads(tmp_path / "in.blend")
    capfd.readouterr()
    assert main([str(tmp_path / "in.blend")]) == 0
    lines = [line.split() for line in capfd.readouterr().out.splitlines()]
    assert [line[:3] for line in lines[:4]] == [
        ["object", "islands", "faces"],
        ["Quads0", "30", "30"],
        ["Quads1", "30", "30"],
        ["total", "60", "60"],
    ]
    assert main([str(tmp_path / "in.blend"), "--verbose"]) == 0
    assert len(capfd.readouterr().out.splitlines()) >= 62


def test_quiet(mixed, capfd):
    capfd.readouterr()
    assert main([str(mixed), "--quiet", "--cut", "never"]) == 1
    printed = capfd.readouterr()
    assert not printed.out and "Box (6 faces) is closed" in printed.err


@pytest.mark.parametrize("encoding", ["cp1252", "ascii"])
def test_terminals_without_arrows(source, monkeypatch, tmp_path, encoding):
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    assert main([str(source), "-o", str(tmp_path / "out.obj")]) == 0
    assert b" -> " in stream.buffer.getvalue() and (tmp_path / "out.obj").exists()
    assert main(["--help"]) == 0


def test_help_tells_examples_defaults_and_needs(capfd):
    assert main(["--help"]) == 0
    text = " ".join(capfd.readouterr().out.split())
    for part in ("examples:", "default on", "default off", "only with --refine 0", "exit codes:", "'Wall*'"):
        assert part in text


def test_the_bar_is_for_terminals_and_long_runs(monkeypatch, capfd):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    for stream, patience, is_drawn in ((Terminal(), 0, True), (Terminal(), 60, False), (io.StringIO(), 0, False)):
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setattr(console, "_PATIENCE", patience)
        bar = console.Bar()
        bar(0.5)
        bar.close()
        assert ("50 %" in stream.getvalue()) == is_drawn
        assert stream.getvalue() == "" or stream.getvalue().endswith("\r")


def test_from_python(mixed, tmp_path):
    target = tmp_path / "out.obj"
    report = qh_unwrap.unwrap_file(mixed, target, boundary="circle", balance=np.float32(0.5), object="P*")
    checked(json.dumps(report))
    assert report["status"] == "ok" and report["settings"]["boundary"] == "CIRCLE" and target.exists()
    assert qh_unwrap.unwrap_file(str(mixed), cut="never")["exit_code"] == 1, "failed islands raise nothing"
    (tmp_path / "broken.ply").write_text("no mesh")
    assert qh_unwrap.unwrap_file(tmp_path / "broken.ply")["exit_code"] == 3
    assert len(qh_unwrap.last_report()) == 2


@pytest.mark.parametrize(
    "options",
    [
        dict(output="no/where.obj"),
        dict(no_such_option=1),
        dict(balance=7),
        dict(balance="much"),
        dict(boundary="heart"),
        dict(overwrite="yes"),
        dict(json="-"),
        dict(uv_map="a", texcoord=1),
        dict(object=["Nose"]),
    ],
)
def test_wrong_usage_from_python(mixed, options):
    with pytest.raises(qh_unwrap.UsageError):
        qh_unwrap.unwrap_file(mixed, **options)


def program(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "qh_unwrap", *map(str, arguments)],
        cwd=_ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def test_a_closed_pipe_changes_nothing(source, tmp_path):
    process = program(source, "-o", tmp_path / "out.obj", "--json", tmp_path / "r.json")
    process.stdout.close()
    assert process.wait(60) == 0 and process.stderr.read() == ""
    assert checked((tmp_path / "r.json").read_text())["status"] == "ok"


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
@pytest.mark.parametrize(("number", "wait"), [(signal.SIGINT, 0.2), (signal.SIGTERM, None)])
def test_the_program_can_be_stopped(tmp_path, number, wait):
    """While it still loads what it needs, and while it unwraps."""
    add_grid(300)
    files.save(tmp_path / "in.obj")
    before = sorted(os.listdir(tmp_path))
    report = tmp_path / "r.json"
    process = program(tmp_path / "in.obj", "-o", tmp_path / "out.obj", "--json", report)
    if wait:
        time.sleep(wait)
    else:
        while not report.exists():
            time.sleep(0.02)
        time.sleep(0.8)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert err == f"qh-unwrap: error: stopped by {number.name}\n" and not out
    if not wait:
        assert checked(report.read_text())["status"] == "stopped"
        report.unlink()
    assert sorted(os.listdir(tmp_path)) == before


def test_names_are_listed_up_to_a_point():
    assert listed(list("abcdefg")) == "a, b, c, d, e and 2 more"
