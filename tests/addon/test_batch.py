# SPDX-License-Identifier: GPL-3.0-or-later
"""Many files: plan, workers, ledger, reports, and what can go wrong with each of them."""

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from qh_unwrap.addon import files, suffixes
from qh_unwrap.addon.failures import FileError
from qh_unwrap.cli import main
from qh_unwrap.farm import batch, child, cluster, naming, pool, report, telling
from qh_unwrap.farm.asset import Asset
from qh_unwrap.farm.entry import Entry
from qh_unwrap.farm.ledger import Ledger, digest
from qh_unwrap.farm.worker import Limits, Worker

_ROOT = Path(__file__).parents[2]
_POISONED = [sys.executable, "-P", str(Path(__file__).with_name("poisoned_worker.py"))]
_VARYING = ("seconds", "host")
linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc, and sends signals")
_SHEET = "v 0 0 {0}\nv 1 0 0\nv 1 1 0.2\nv 0 1 0\nv 2 0 0\nv 2 1 0\nf 1 2 3 4\nf 2 5 6 3\n"


def sheets(folder, *names):
    folder.mkdir(exist_ok=True)
    paths = [folder / f"{name}.obj" for name in names]
    for number, path in enumerate(paths):
        path.parent.mkdir(exist_ok=True)
        path.write_text(_SHEET.format(number / 10))
    return [str(path) for path in paths]


def rows(path):
    with open(path, newline="") as stream:
        return {Path(row["input"]).stem: row for row in csv.DictReader(stream)}


def lines(path):
    """What a report says, but for times, hosts and order."""
    return sorted(tuple(row[name] for name in row if name not in _VARYING) for row in rows(path).values())


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def leftovers(folder):
    return list(folder.rglob(".qh-unwrap-*"))


@pytest.fixture(scope="module")
def kept_worker():
    worker = Worker(Limits())
    yield worker
    worker.end()


@pytest.fixture
def one_worker(kept_worker, monkeypatch):
    """Have all runs by the same worker process, since each takes a second to start."""

    class Kept:
        is_idle = property(lambda self: kept_worker.is_idle)
        begin, poll = kept_worker.begin, kept_worker.poll
        stop = end = lambda self: None

    monkeypatch.setattr(pool, "Worker", lambda limits: Kept())


@pytest.fixture
def poison(monkeypatch):
    monkeypatch.setattr(child, "command", lambda: _POISONED)


def test_each_file_gets_an_output_and_a_line(tmp_path, capfd):
    inputs = sheets(tmp_path / "in", *"abc")
    out, table = tmp_path / "out", tmp_path / "r.csv"
    page = tmp_path / "r.html"
    assert main([*inputs, "-O", str(out), "--jobs", "2", "--report", str(table), "--report", str(page)]) == 0
    assert sorted(path.name for path in out.iterdir() if path.name[0] != ".") == ["a_uv.obj", "b_uv.obj", "c_uv.obj"]
    assert main([inputs[1], "-o", str(tmp_path / "single.obj")]) == 0
    assert (out / "b_uv.obj").read_bytes() == (tmp_path / "single.obj").read_bytes()
    assert "3 files: 3 ok" in capfd.readouterr().out
    found = rows(table)
    assert list(found) == ["a", "b", "c"]
    assert {(row["status"], row["islands"], row["certified"], row["attempts"]) for row in found.values()} == {
        ("ok", "1", "1", "1")
    }
    text = page.read_text()
    assert text.count("data:image/png;base64,") == 3 and "3 files: 3 ok" in text


def test_poison_costs_its_own_file_alone(tmp_path, poison):
    names = ["a", "crash", "b", "hang", "c", "eat", "d", "once", "e"]
    inputs = sheets(tmp_path / "in", *names)
    out, table = tmp_path / "out", tmp_path / "r.csv"
    limits = ["--timeout", "5", "--memory", "1"]
    assert main([*inputs, "-O", str(out), "--jobs", "2", *limits, "--report", str(table)]) == 1
    found = rows(table)
    assert {name: row["status"] for name, row in found.items()} == dict.fromkeys("abcde", "ok") | dict(
        crash="crashed", hang="timed out", eat="out of memory", once="ok"
    )
    assert {name for name, row in found.items() if row["attempts"] == "2"} == {"crash", "hang", "eat", "once"}
    assert "it went wrong" in found["crash"]["error"]
    assert "--timeout" in found["hang"]["error"] and "--memory" in found["eat"]["error"]
    written = {path.stem for path in out.glob("*.obj")}
    assert written == {f"{name}_uv" for name in [*"abcde", "once"]} and not leftovers(tmp_path)


def start(*arguments):
    """The program with poisoned workers."""
    code = f"import sys; from qh_unwrap.farm import child; child.command = lambda: {_POISONED!r}\n" + (
        "from qh_unwrap.__main__ import main; sys.argv = ['qh-unwrap', *sys.argv[1:]]; sys.exit(main())"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)], cwd=_ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def workers_of(program):
    return list(map(int, Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()))


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@linux
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_was_ended_goes_on(tmp_path, number):
    """By Ctrl C, or without a chance to tidy up."""
    inputs = sheets(tmp_path / "in", "a", "slow_1", "slow_2", "b")
    out, table = tmp_path / "out", tmp_path / "r.csv"
    program = start(*inputs, "-O", out, "--report", table, "--progress", "json")
    while json.loads(program.stdout.readline())["event"] != "file":
        pass
    time.sleep(0.3)
    workers = workers_of(program)
    program.send_signal(number)
    program.communicate(timeout=60)
    assert program.returncode == (130 if number == signal.SIGINT else -number)
    limit = time.monotonic() + 20
    while any(map(is_running, workers)):
        assert time.monotonic() < limit, "the worker ends as well"
        time.sleep(0.05)
    assert not leftovers(tmp_path)
    before = contents(out)
    assert out / "a_uv.obj" in before and out / "b_uv.obj" not in before
    program = start(*inputs, "-O", out, "--report", table, "--resume", "--progress", "json")
    events = [json.loads(line) for line in program.stdout]
    assert program.wait(60) == 0, program.stderr.read()
    assert [event["done"] for event in events if event["event"] == "file"] == [1, 2, 3, 4]
    assert (out / "a_uv.obj").stat().st_mtime <= table.stat().st_mtime
    assert {name: row["status"] for name, row in rows(table).items()} == dict.fromkeys(
        ["a", "slow_1", "slow_2", "b"], "ok"
    )


def test_resume_repeats_what_changed_and_nothing_else(one_worker, tmp_path, capfd):
    inputs = sheets(tmp_path / "in", *"abc")
    out = tmp_path / "out"
    again = [*inputs, "-O", str(out), "--progress", "json", "--resume"]

    def unwrapped(*flags):
        before = {path: path.stat().st_mtime_ns for path in out.glob("*.obj")}
        capfd.readouterr()
        assert main([*again, *flags]) == 0
        return "".join(
            path.stem[0] for path in sorted(out.glob("*.obj")) if path.stat().st_mtime_ns != before.get(path)
        )

    assert unwrapped() == "abc"
    assert unwrapped() == ""
    (tmp_path / "in" / "b.obj").write_text(_SHEET.format(0.5))
    assert unwrapped() == "b"
    (out / "c_uv.obj").unlink()
    assert unwrapped() == "c"
    assert unwrapped("--balance", "0.5") == "abc"
    assert unwrapped("--balance", "0.5", "--jobs", "2", "--timeout", "60") == "", "how it is done makes no difference"
    entry = Ledger(out).read(out / "a_uv.obj")
    (out / "a_uv.obj").write_text("changed by hand")
    assert main(again) == 2
    assert "was changed since" in capfd.readouterr().out and (out / "a_uv.obj").read_text() == "changed by hand"
    assert Ledger(out).read(out / "a_uv.obj") == entry


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["in/a.obj", "in/a.obj", "-O", "out"], "named twice"),
        (["in/a.obj", "other/a.obj", "-O", "out"], "would both be written"),
        (["in/a.obj", "in/b.obj", "-O", "out", "--name", "one.obj"], "would both be written"),
        (["in/a.obj", "in/A.obj", "-O", "out"], "would both be written"),
        (["in/\u00e4.obj", "in/a\u0308.obj", "-O", "out"], "would both be written"),
        (["in/a.obj", "in/b.obj"], "more than one INPUT needs -O"),
        (["in/a.obj", "--jobs", "2"], "--jobs needs -O"),
        (["in", "-O", "out"], "in is a folder"),
        (["in/none.obj", "-O", "out"], "there is no file"),
        (["in/none*.obj", "-O", "out"], "there is no file"),
        (["in/a.txt", "-O", "out"], "cannot read"),
        (["in/a.stl", "-O", "out"], "UVs can be kept in"),
        (["in/a.obj", "-O", "no/where"], "there is no folder"),
        (["in/a.obj", "-O", "in/b.obj"], "is no folder"),
        (["in/a.obj", "-O", "in", "--name", "{stem}{suffix}"], "a.obj exists"),
        (["in/a.obj", "in/b.obj", "-O", "in", "--name", "{stem}_2{suffix}"], "a_2.obj exists"),
        (["in/a.obj", "in/a_2.obj", "-O", "in", "--name", "{stem}_2{suffix}", "--overwrite"], "would replace"),
        (["in/a.obj", "in/ä.obj", "-O", "in", "--name", "{stem}̈.obj", "--overwrite"], "would replace"),
        (["in/a.obj", "-O", "out", "--name", "../{stem}{suffix}"], "leads out of the folder"),
        (["in/a.obj", "-O", "out", "--name", "/elsewhere/{stem}{suffix}"], "leads out of the folder"),
        (["in/a.obj", "-O", "in", "--name", "b.obj/{stem}{suffix}"], "b.obj is no folder"),
        (["in/a.obj", "-O", "out", "--name", "{number}"], "use {stem}, {suffix}"),
        (["in/a.obj", "-O", "out", "--name", "{stem"], "use {stem}, {suffix}"),
        (["in/a.obj", "-O", "out", "-o", "b.obj"], "excludes --output"),
        (["in/a.obj", "-O", "out", "--jobs", "0"], "--jobs is 0"),
        (["in/a.obj", "-O", "out", "--timeout", "nan"], "--timeout is nan"),
        (["in/a.obj", "-O", "out", "--only", "2"], "there are 1 files"),
        (["in/a.obj", "-O", "out", "--only", "x"], "cannot be read"),
        (["in/a.obj", "-O", "out", "--report", "r.txt"], "it can be .csv or .html"),
        (["in/a.obj", "-O", "out", "--report", "taken.csv"], "taken.csv exists"),
        (["in/a.obj", "-O", "out", "--report", "taken.csv", "--resume"], "taken.csv exists"),
        (["in/a.obj", "-O", "out", "--report", "no/r.csv"], "there is no folder"),
        (["--list", "none.txt", "-O", "out"], "cannot read the list"),
        (["-O", "out"], "INPUT"),
        (["in/a.obj", "-O", "out", "--balance", "7"], "balance"),
        (["in/a.obj", "-O", "out", "--dask", "x", "--jobs", "2"], "--dask excludes --jobs"),
        (["farm"], "WORD"),
        (["farm", "report", "in", "r.csv"], "has no ledger"),
        (["farm", "openjd", "--list", "x"], "--list is not for the tasks"),
        (["farm", "openjd", "--balance", "7"], "balance"),
        (["farm", "openjd", "more.obj"], "which files are unwrapped"),
    ],
)
def test_wrong_usage_changes_nothing(tmp_path, monkeypatch, capfd, arguments, message):
    sheets(tmp_path / "in", "a", "A", "b", "a_2", "\u00e4", "a\u0308")
    sheets(tmp_path / "other", "a")
    for name in ("in/a.txt", "in/a.stl", "taken.csv"):
        (tmp_path / name).write_text("taken")
    monkeypatch.chdir(tmp_path)
    before = contents(tmp_path)
    assert main(arguments) == 2
    assert message in capfd.readouterr().err
    assert contents(tmp_path) == before and not (tmp_path / "out").exists()


def test_names_of_outputs(tmp_path):
    inputs = [tmp_path / name for name in ("a/x.obj", "b/x.glb")]
    outputs = naming.outputs_of(inputs, tmp_path, "{folder}/{stem}/{stem}-1{suffix}")
    assert [path.relative_to(tmp_path).as_posix() for path in outputs] == ["a/x/x-1.obj", "b/x/x-1.glb"]
    assert naming.chosen("1-3,7,10-14:2", 20) == [0, 1, 2, 6, 9, 11, 13]


def test_files_in_their_own_place(one_worker, tmp_path):
    inputs = sheets(tmp_path / "in", *"ab")
    flags = ["-O", str(tmp_path / "in"), "--name", "{stem}{suffix}"]
    assert main([*inputs, *flags, "--overwrite"]) == 0
    written = contents(tmp_path / "in")
    assert all("vt " in Path(path).read_text() for path in inputs)
    assert main([*inputs, *flags, "--resume"]) == 0, "what was written over the input is done"
    assert contents(tmp_path / "in").keys() == written.keys()
    assert all(written[Path(path)] == Path(path).read_bytes() for path in inputs)


def test_files_that_fail_are_told_and_tried_again(one_worker, tmp_path, capfd):
    inputs = sheets(tmp_path / "in", *"ab")
    Path(inputs[1]).write_text("nothing")
    out, table = tmp_path / "out", tmp_path / "r.csv"
    assert main([*inputs, "-O", str(out), "--report", str(table)]) == 1
    assert "b.obj: failed" in capfd.readouterr().err
    assert rows(table)["b"]["status"] == "failed" and "no mesh" in rows(table)["b"]["error"]
    assert main([inputs[1], "-O", str(out), "--resume"]) == 3
    sheets(tmp_path / "in", "z", "b")
    assert main([*inputs, "-O", str(out), "--report", str(table), "--resume"]) == 0
    assert main(["farm", "report", str(out), str(tmp_path / "all.csv")]) == 0
    assert lines(table) == lines(tmp_path / "all.csv")


def test_no_texture_is_replaced_by_that_of_another_file(one_worker, tmp_path):
    for name in "ab":
        (path,) = sheets(tmp_path / name, name)
        (tmp_path / name / "m.mtl").write_text("newmtl m\nmap_Kd t.png\n")
        (tmp_path / name / "t.png").write_bytes(name.encode())
        Path(path).write_text("mtllib m.mtl\nusemtl m\n" + Path(path).read_text())
    inputs = [str(tmp_path / name / f"{name}.obj") for name in "ab"]
    table = tmp_path / "r.csv"
    for flags in ([], ["--overwrite"]):
        assert main([*inputs, "-O", str(tmp_path / "out"), "--report", str(table), *flags]) == 1
        assert rows(table)["a"]["status"] == "ok" and "{stem}/{stem}" in rows(table)["b"]["error"]
        assert (tmp_path / "out" / "t.png").read_bytes() == b"a"
    assert main([*inputs, "-O", str(tmp_path / "new"), "--name", "{stem}/{stem}{suffix}"]) == 0
    assert (tmp_path / "new" / "b" / "t.png").read_bytes() == b"b"


def test_progress_for_programs(one_worker, tmp_path, capfd):
    inputs = sheets(tmp_path / "in", *"ab")
    capfd.readouterr()
    assert main([*inputs, "-O", str(tmp_path / "out"), "--progress", "json"]) == 0
    events = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [event["event"] for event in events] == ["begin", "file", "file", "end"]
    assert events[0]["count"] == 2 and events[2]["done"] == 2 and events[3]["exit_code"] == 0
    Path(inputs[0]).write_text("nothing")
    assert main([*inputs, "-O", str(tmp_path / "out"), "--progress", "openjd", "--resume"]) == 1
    lines = capfd.readouterr().out.splitlines()
    assert "openjd_progress: 50.0" in lines and "openjd_status: 2 of 2 files" in lines
    assert lines[-1].startswith("openjd_fail: 2 files: 1 ok, 1 failed") and "first: a.obj: " in lines[-1]


def test_a_list_and_some_of_it(one_worker, tmp_path):
    sheets(tmp_path / "in", *"abcd")
    listed = tmp_path / "list.txt"
    listed.write_text("in/a.obj\n\nin/b.obj\r\nin/c.obj\nin/d.obj\n")
    out = tmp_path / "out"
    assert main(["--list", str(listed), "--only", "2-3", "-O", str(out)]) == 0
    assert sorted(path.name for path in out.glob("*.obj")) == ["b_uv.obj", "c_uv.obj"]


def test_template_takes_flags(capfd):
    assert main(["farm", "openjd", "--balance", "0.5"]) == 0
    template = json.loads(capfd.readouterr().out)
    assert template["steps"][0]["script"]["actions"]["onRun"]["args"][-2:] == ["--balance", "0.5"]
    assert main(["farm", "flamenco", "--balance", "0.5"]) == 0
    assert 'const FLAGS = ["--balance", "0.5"];' in capfd.readouterr().out


def test_a_worker_that_cannot_be_started_is_no_fault_of_files(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(child, "command", lambda: [sys.executable, "-c", "raise SystemExit('there is no Blender')"])
    inputs = sheets(tmp_path / "in", *"ab")
    assert main([*inputs, "-O", str(tmp_path / "out")]) == 3
    assert "no worker can be started: it ended with exit code 1 (there is no Blender)" in capfd.readouterr().err


def test_dask_does_the_same_as_workers_here(tmp_path, poison):
    distributed = pytest.importorskip("distributed")
    inputs = sheets(tmp_path / "in", *"ab", "crash", "once")
    machines = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None
    )
    with machines:
        flags = ["--dask", machines.scheduler_address]
        assert main([*inputs, "-O", str(tmp_path / "one"), *flags, "--report", str(tmp_path / "one.csv")]) == 1
        (tmp_path / "in" / "once.seen").unlink()
    assert main([*inputs, "-O", str(tmp_path / "two"), "--jobs", "2", "--report", str(tmp_path / "two.csv")]) == 1
    text = (tmp_path / "two.csv").read_text().replace(f"{tmp_path}/two", f"{tmp_path}/one")
    (tmp_path / "two.csv").write_text(text)
    assert lines(tmp_path / "one.csv") == lines(tmp_path / "two.csv")


def test_no_scheduler(tmp_path, monkeypatch, capfd):
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "_AT_FIRST", 0.5)
    inputs = sheets(tmp_path / "in", "a")
    assert main([*inputs, "-O", str(tmp_path / "out"), "--dask", "tcp://127.0.0.1:9"]) == 3
    assert "there is no Dask scheduler at tcp://127.0.0.1:9" in capfd.readouterr().err
    assert main([*inputs, "-O", str(tmp_path / "out"), "--dask", "nowhere:x"]) == 2


def test_summaries_fit_in_a_line_of_open_job_description(capfd):
    telling._OpenJobDescription().fail(2, "one\ntwo")
    assert capfd.readouterr().out == "openjd_fail: one two\n"


def test_a_report_that_cannot_be_written_is_told(one_worker, tmp_path, monkeypatch, capfd):
    def fail(path, entries):
        raise FileError(f"cannot write the report {path}: the disk is full")

    monkeypatch.setattr(report, "write", fail)
    inputs = sheets(tmp_path / "in", "a")
    assert main([*inputs, "-O", str(tmp_path / "out"), "--report", str(tmp_path / "r.csv")]) == 1
    printed = capfd.readouterr()
    assert "the disk is full" in printed.err and "1 file: 1 ok" in printed.out


def test_suffixes_are_those_that_blender_reads_and_writes():
    assert tuple(files.READERS) == suffixes.READ and tuple(files.WRITERS) == suffixes.WRITTEN


def test_an_entry_that_was_cut_off_counts_as_unfinished(one_worker, tmp_path):
    inputs = sheets(tmp_path / "in", "a")
    again = [*inputs, "-O", str(tmp_path / "out"), "--resume"]
    assert main(again) == 0
    (entry,) = (tmp_path / "out" / ".qh-unwrap").glob("*.json")
    entry.write_bytes(entry.read_bytes()[:40])
    assert Ledger(tmp_path / "out").entries() == []
    assert main(again) == 0
    assert [each.status for each in Ledger(tmp_path / "out").entries()] == ["ok"]


def test_what_was_done_is_done_wherever_the_folder_is(one_worker, tmp_path):
    inputs = sheets(tmp_path / "in", *"ab")
    assert main([*inputs, "-O", str(tmp_path / "out")]) == 0
    (tmp_path / "moved").symlink_to(tmp_path / "out")
    entry = Ledger(tmp_path / "moved").read(tmp_path / "moved" / "a_uv.obj")
    assert entry == Ledger(tmp_path / "out").read(tmp_path / "out" / "a_uv.obj")
    table, before = tmp_path / "r.csv", contents(tmp_path / "out")
    assert main([*inputs, "-O", str(tmp_path / "moved"), "--resume", "--report", str(table)]) == 0
    assert rows(table)["a"]["output"] == str(tmp_path / "moved" / "a_uv.obj")
    assert contents(tmp_path / "out") == before


def test_what_a_power_cut_left_is_swept_away(one_worker, tmp_path):
    inputs = sheets(tmp_path / "in", "a")
    out = tmp_path / "out"
    out.mkdir()
    Ledger(out).prepare()
    Ledger(out).write(Entry(inputs[0], str(out / "a_uv.obj"), ticket="0123"))
    for name in (".qh-unwrap-0123-x", ".qh-unwrap-4567-x"):
        (out / name).mkdir()
    (out / "a_uv.obj").write_text("half")
    assert main([*inputs, "-O", str(out), "--resume"]) == 0
    assert [path.name for path in leftovers(out)] == [".qh-unwrap-4567-x"], "that of another run"
    assert "vt " in (out / "a_uv.obj").read_text()


def test_what_the_scheduler_repeats_is_not_done_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_kept", lambda: pytest.fail("a worker was asked for"))
    ledger = Ledger(tmp_path)
    asset = Asset(str(tmp_path / "a.obj"), str(tmp_path / "b.obj"), str(tmp_path), since=ledger.prepare())
    ledger.write(Entry.begun(asset, status="ok"))
    assert cluster._unwrap(asset.to_dict(), (None, None))["status"] == "ok"


def test_files_that_two_assets_wrote_at_a_time_are_told(tmp_path):
    ledger = Ledger(tmp_path)
    ledger.prepare()
    one, other = (
        Entry("", str(tmp_path / name), status="ok", details=dict(files=[str(tmp_path / name), "t.png"]))
        for name in "ab"
    )
    placed = {}
    assert batch._checked(one, placed, tmp_path).is_good
    found = batch._checked(other, placed, tmp_path)
    assert found.status == "failed" and "t.png" in found.error
    assert ledger.read(tmp_path / "b").status == "failed"


def test_buffers_count_as_content_of_gltf_files(tmp_path):
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(dict(buffers=[dict(uri="a.bin"), dict(uri="data:,")])))
    found = set()
    for content in (b"1", b"2", b"2"):
        (tmp_path / "a.bin").write_bytes(content)
        found.add(digest(path))
    assert len(found) == 2 and "" not in found
