# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of a farm: a worker process is killed, a Dask worker is killed, the scheduler is started anew, and a run is
ended half-way and resumed.  After each of them, every file is whole, and has one line in the report.

    python -m tests.campaigns.farm [--count 200]

Needs Linux and `qh-unwrap[bpy,farm]`.
"""

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ..benchmarks.many_files import listed, sheet, start

_PORT = 18786


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="how many files")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        inputs = listed(folder / "list.txt", [sheet(folder / "in", number) for number in range(args.count)])
        run(folder, "undisturbed", inputs, args.count, ["--jobs", "2"], None)
        run(folder, "worker process killed", inputs, args.count, ["--jobs", "2"], kill_process)
        run(folder, "ended and resumed", inputs, args.count, ["--jobs", "2"], interrupt)
        run(folder, "ended without a chance to tidy up, and resumed", inputs, args.count, ["--jobs", "2"], kill)
        cluster = Cluster()
        try:
            flags = ["--dask", f"tcp://127.0.0.1:{_PORT}"]
            run(folder, "Dask worker killed", inputs, args.count, flags, lambda _: cluster.kill_worker())
            run(folder, "scheduler started anew", inputs, args.count, flags, lambda _: cluster.restart())
        finally:
            cluster.end()


def run(folder, name, inputs, count, flags, disturb):
    """A batch that is disturbed once a third is done, and resumed if it ended."""
    out, report, begun = folder / name.replace(" ", "_"), folder / "report.csv", time.perf_counter()
    report.unlink(missing_ok=True)
    command = [sys.executable, "-m", "qh_unwrap", "--list", str(inputs), "-O", str(out), "--report", str(report)]
    command += [*flags, "--progress", "json"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    for line in program.stdout:
        event = json.loads(line)
        if event["event"] == "file" and disturb and event["done"] >= count // 3:
            disturb(program)
            disturb = None
    code = program.wait()
    first = len(list(out.glob("*.obj")))
    if code:
        code = subprocess.run([*command, "--resume"], stdout=subprocess.DEVNULL).returncode
    with open(report, newline="") as stream:
        rows = list(csv.DictReader(stream))
    good = [row for row in rows if row["status"] == "ok"]
    whole = sum(same(path, folder / "undisturbed" / path.name) for path in out.glob("*.obj"))
    left = len(list(out.glob(".qh-unwrap-*")))
    again = sum(int(row["attempts"]) > 1 for row in rows)
    print(
        f"{name}: exit code {code}, {len(rows)} lines, {len(good)} good, {whole} files whole, {again} tried again,"
        f" {first} written at first, {left} left over; {time.perf_counter() - begun:.1f} s",
        flush=True,
    )
    assert code == 0 and len(rows) == len(good) == whole == count and not left


def same(one, other):
    return one.read_bytes() == other.read_bytes()


def kill_process(program):
    children = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
    os.kill(int(children[0]), signal.SIGKILL)


def interrupt(program):
    program.send_signal(signal.SIGINT)


def kill(program):
    program.kill()
    time.sleep(3)  # workers finish what they are at


class Cluster:
    """A scheduler and two workers."""

    def __init__(self):
        command = [sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", _PORT, "--no-dashboard"]
        self._scheduler = start(command)
        self._workers = [self._start_worker() for _ in range(2)]

    def _start_worker(self):
        worker = ["worker", f"tcp://127.0.0.1:{_PORT}", "--nthreads", "1", "--no-dashboard"]
        return start([sys.executable, "-m", "dask", *worker])

    def kill_worker(self):
        self._workers.pop().kill()
        self._workers.append(self._start_worker())

    def restart(self):
        self._scheduler.kill()
        self._scheduler.wait()
        for worker in self._workers:
            worker.terminate()
            worker.wait()
        self.__init__()

    def end(self):
        for program in [*self._workers, self._scheduler]:
            program.terminate()
            program.wait()


if __name__ == "__main__":
    main()
