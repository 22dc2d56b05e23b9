# SPDX-License-Identifier: GPL-3.0-or-later
"""The core beside an older checkout of it, in alternation, and alone where it grows.

    python -m tests.benchmarks.core_speed [--part PART] [--old FOLDER] [--times 5]

Seconds are the processor's, of one thread, so that they depend little on what else the machine does.  The parts are
`charts` (every chart of QH_MESHES), `small` (hills of 250 and of 1 000 triangles), `horse`, `ribbons` (strips of quads
that wind up a helix), `waits` (how long the core lets nobody be heard) and `mirrored` (how far the maps of charts are
from those of what they look like in a mirror).  Energies are symmetric Dirichlet's.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np

from qh_unwrap.core import unwrap

from ..core.shapes import furthest_apart
from .common import Verdicts, find_mesh, load_mesh, paths_in, table
from .generated import hills
from .measuring import outline

HERE = Path(__file__).parents[2]
ALLOWED = 1e-4  # that an energy may be above the older one, relative to it
RIBBONS = (2500, 5000, 10_000)
LARGE = {300_000: 1.0, 1_000_000: 3.0}  # triangles, and the seconds within which one is to be heard

WORKER = """
import json, sys, time
import numpy as np
from qh_unwrap.core import Settings, unwrap_steps
try:  # of checkouts whose core had no triangulation of its own; bpy brings mathutils
    import bpy
    from qh_unwrap.addon.delaunay import triangulate
except ImportError:
    triangulate = None
try:
    from qh_unwrap.core import Shape, unwrap_islands
except ImportError:
    unwrap_islands = None
for line in sys.stdin:
    mesh = np.load(line.strip())
    vertices, triangles = mesh["vertices"], mesh["triangles"]
    begun = last = time.process_time()
    wait = 0.0
    if unwrap_islands is None:
        steps = unwrap_steps(vertices, triangles, Settings(), triangulate=triangulate)
    else:
        steps = unwrap_islands([Shape(vertices, triangles)], Settings(), triangulate)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            result = stop.value
            break
        now = time.process_time()
        wait, last = max(wait, now - last), now
    result = result[0] if isinstance(result, list) else result
    end, report = time.process_time(), result.report
    found = dict(seconds=end - begun, wait=max(wait, end - last), energy=report.after.symmetric_dirichlet)
    found.update(certified=bool(report.injective), steps=report.iterations, converged=bool(report.converged))
    print(json.dumps(found), flush=True)
"""


class Worker:
    """A process that unwraps with the package of a checkout."""

    def __init__(self, checkout):
        environment = os.environ | dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
        environment["PYTHONPATH"] = str(checkout)
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self._process = subprocess.Popen([sys.executable, "-c", WORKER], cwd=checkout, env=environment, **pipes)

    def unwrapped(self, path):
        self._process.stdin.write(f"{path}\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def end(self):
        self._process.stdin.close()
        self._process.wait()


def in_alternation(meshes, checkouts, times):
    """For each mesh, by name, and for each checkout the runs, in turns."""
    workers = [Worker(checkout) for checkout in checkouts]
    try:
        with tempfile.TemporaryDirectory() as folder:
            for number, (name, (vertices, triangles)) in enumerate({"": hills(500), **meshes}.items()):
                path = Path(folder, f"{number}.npz")
                np.savez(path, vertices=vertices, triangles=triangles)
                runs = [[] for _ in workers]
                for _ in range(times if name else 1):  # what happens only once does not count
                    for worker, done in zip(workers, runs, strict=True):
                        done.append(worker.unwrapped(path))
                if name:
                    yield name, len(triangles), runs
    finally:
        for worker in workers:
            worker.end()


def beside(meshes, arguments, verdicts):
    """A row for each mesh; returns how many times as fast each is as the older checkout."""
    rows, ratios, above = [], {}, []
    for name, count, (old, new) in in_alternation(meshes, (arguments.old, HERE), arguments.times):
        seconds = [median(run["seconds"] for run in runs) for runs in (old, new)]
        old, new = old[-1], new[-1]
        ratios[name] = seconds[0] / seconds[1]
        if new["energy"] > (1 + ALLOWED) * old["energy"] or not new["certified"] or not new["converged"]:
            above.append(name)
        energies = f"{old['energy']:.5f}", f"{new['energy']:.5f}"
        rows.append((name, count, *seconds, ratios[name], f"{old['steps']} > {new['steps']}", *energies))
    table(("mesh", "triangles", "old s", "new s", "times as fast", "steps", "energy, old", "new"), rows)
    print(f"{np.median(list(ratios.values())):.2f} times as fast in the median, from {min(ratios.values()):.2f}")
    verdicts.claim("certified, at the end, and no more energy than before", not above, ", ".join(above))
    return ratios


def disks():
    """The charts of QH_MESHES that are no closed models, by name."""
    meshes = {path.stem: load_mesh(path) for path in (*paths_in("charts"), *paths_in("disk"))}
    return {name: mesh for name, mesh in meshes.items() if len(outline(mesh[1]))}


def charts(arguments, verdicts):
    beside(disks(), arguments, verdicts)


def mirrored(_arguments, verdicts):
    rows = []
    for name, (vertices, triangles) in disks().items():
        one = unwrap(vertices, triangles)
        other = unwrap(vertices * [-1, 1, 1], triangles[:, ::-1])
        apart = furthest_apart(one.uv, other.uv * [-1, 1])
        rows.append((name, len(triangles), one.report.iterations, other.report.iterations, f"{apart:.1e}", apart))
    table(("mesh", "triangles", "steps", "mirrored", "apart"), [row[:-1] for row in rows])
    worst = max(rows, key=lambda row: row[-1])
    text = "what is mirrored ends within 1e-4 of the mirror image, by the map's extent"
    verdicts.claim(text, worst[-1] <= 1e-4, f"at most {worst[-1]:.1e}, {worst[0]}")


def small(arguments, verdicts):
    ratios = beside({f"hills {size}": hills(size) for size in (250, 1000)}, arguments, verdicts)
    verdicts.claim("at most a third of the time", min(ratios.values()) >= 3)


def horse(arguments, verdicts):
    path = find_mesh("horse_b.obj")
    if path:
        ratios = beside({"horse_b": load_mesh(path)}, arguments, verdicts)
        verdicts.claim("at most 0.55 of the time", min(ratios.values()) >= 1 / 0.55)


def ribbons(arguments, verdicts):
    meshes = {f"1 x {count}": ribbon(count) for count in RIBBONS}
    found = {name: runs[0] for name, _, runs in in_alternation(meshes, (HERE,), arguments.times)}
    seconds = [median(run["seconds"] for run in runs) for runs in found.values()]
    growth = [None, *(longer / shorter for shorter, longer in pairwise(seconds))]
    last = [runs[-1] for runs in found.values()]
    rows = [
        (name, s, times or "", run["steps"], str(run["converged"]), run["energy"])
        for name, s, times, run in zip(found, seconds, growth, last, strict=True)
    ]
    table(("quads", "s", "times the last", "steps", "converged", "energy"), rows)
    verdicts.claim("at most 2.4 times for twice as many", max(growth[1:]) <= 2.4)
    verdicts.claim("the longest in at most 6 s", seconds[-1] <= 6)


def waits(arguments, verdicts):
    meshes = {f"hills {size:,}": hills(size) for size in LARGE}
    for (name, _, (runs,)), most in zip(in_alternation(meshes, (HERE,), 1), LARGE.values(), strict=True):
        wait = max(run["wait"] for run in runs)
        figures = f"{wait:.2f} s of {runs[0]['seconds']:.1f} s"
        verdicts.claim(f"{name}: heard within {most:.0f} s in the core", wait <= most, figures)


def ribbon(count):
    """A strip of so many quads, each cut in two, that winds up a helix like the steps of a staircase."""
    angle = 0.2 * np.arange(count + 1)
    inner = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * angle / (2 * np.pi)])
    vertices = np.stack([inner, inner * (1.2, 1.2, 1)], axis=1).reshape(-1, 3)
    k = 2 * np.arange(count)
    return vertices, np.concatenate([np.column_stack([k, k + 2, k + 3]), np.column_stack([k, k + 3, k + 1])])


PARTS = {part.__name__: part for part in (charts, small, horse, ribbons, waits, mirrored)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=PARTS, default="ribbons", help="what to measure (default: ribbons)")
    parser.add_argument("--old", type=Path, default=HERE, help="an older checkout (default: this one)")
    parser.add_argument("--times", type=int, default=5, help="that each runs (default: 5)")
    arguments = parser.parse_args()
    verdicts = Verdicts()
    PARTS[arguments.part](arguments, verdicts)
    verdicts.exit()


if __name__ == "__main__":
    main()
