# SPDX-License-Identifier: GPL-3.0-or-later
"""Many small files: seconds for each by worker processes, on a Dask cluster, and by a process for each; and whether all
get the same.

    python -m tests.benchmarks.many_files [--count 1000] [--singles 100] [--folder FOLDER]

Needs `qh-unwrap[bpy,farm]`.  What is measured with so many files is measured with four times as many as well.
"""

import argparse
import contextlib
import csv
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

_VARYING = ("seconds", "host")
_PROGRAM = [sys.executable, "-m", "qh_unwrap"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, help="how many files")
    parser.add_argument("--singles", type=int, default=100, help="how many of them by a process for each")
    parser.add_argument("--folder", type=Path, help="where to write them, which is not removed then")
    args = parser.parse_args()
    with contextlib.ExitStack() as stack:
        folder = args.folder or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        inputs = [sheet(folder / "in", number) for number in range(4 * args.count)]
        few, many = (listed(folder / f"{count}.txt", inputs[:count]) for count in (args.count, 4 * args.count))
        start = time.perf_counter()
        for path in inputs[: args.singles]:
            unwrap(path, "-o", folder / f"{path.stem}_single.obj")
        told("a process for each", time.perf_counter() - start, args.singles)
        seconds = batch(folder, "jobs", few, args.count, "--jobs", 2)
        with dask(folder) as address:
            batch(folder, "dask", few, args.count, "--dask", address)
        print("reports are alike:", alike(folder, "jobs", "dask"))
        for path in inputs[: args.singles]:
            one, other = folder / f"{path.stem}_single.obj", folder / "jobs" / f"{path.stem}_uv.obj"
            assert one.read_bytes() == other.read_bytes(), path
        longer = batch(folder, "four", many, 4 * args.count, "--jobs", 2) / seconds
        print(f"{longer:.2f} times as long for four times as many")


def sheet(folder, number):
    """A bent sheet of 16 to 64 quads."""
    random, across = np.random.default_rng([18, number]), 4 + number % 5
    x, y = (each.ravel() for each in np.meshgrid(np.arange(across + 1), np.arange(across + 1)))
    z = 0.3 * random.uniform(0, 1) * y * np.sin(random.uniform(0.3, 1) * x)
    lines = [f"v {a} {b} {c:.5f}" for a, b, c in zip(x, y, z, strict=True)]
    corner = np.add.outer(np.arange(across) * (across + 1), np.arange(across)).ravel() + 1
    lines += [f"f {k} {k + 1} {k + across + 2} {k + across + 1}" for k in corner]
    path = folder / f"sheet{number:05}.obj"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


def listed(path, inputs):
    path.write_text("".join(f"{each.absolute()}\n" for each in inputs))
    return path


def unwrap(*arguments):
    subprocess.run([*_PROGRAM, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def batch(folder, name, inputs, count, *flags):
    """The seconds that a batch takes."""
    start = time.perf_counter()
    unwrap("--list", inputs, "-O", folder / name, "--report", folder / f"{name}.csv", *flags, "--quiet")
    seconds = time.perf_counter() - start
    told(" ".join(map(str, flags)), seconds, count)
    return seconds


def told(how, seconds, count):
    print(f"{how}: {count} files in {seconds:.1f} s, {seconds / count:.3f} s each", flush=True)


@contextlib.contextmanager
def dask(folder):
    """The address of a cluster with two workers of one thread each, in processes of their own."""
    found = folder / "scheduler.json"
    command = [sys.executable, "-m", "dask", "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", found]
    programs = [start(command)]
    try:
        while not found.exists():
            time.sleep(0.1)
        worker = ["worker", "--nthreads", "1", "--no-dashboard", "--scheduler-file", found]
        programs += [start([sys.executable, "-m", "dask", *worker]) for _ in range(2)]
        yield read_address(found)
    finally:
        for program in reversed(programs):
            program.terminate()
            program.wait()


def start(command):
    return subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def read_address(path):

    return json.loads(path.read_text())["address"]


def alike(folder, *names):
    """Whether the reports are equal but for times, hosts, order and the folders."""
    found = []
    for name in names:
        with open(folder / f"{name}.csv", newline="") as stream:
            rows = [{key: value for key, value in row.items() if key not in _VARYING} for row in csv.DictReader(stream)]
        found.append(sorted(str(row).replace(str(folder / name), "") for row in rows))
    return found[0] == found[1]


if __name__ == "__main__":
    main()
