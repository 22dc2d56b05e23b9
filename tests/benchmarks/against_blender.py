# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and distortion beside Blender's own methods, on the same meshes, in one process.

Default settings, Edit Mode to Edit Mode; distortion is measured on the UVs that Blender stores.  Needs bpy; the meshes
of QH_MESHES are added to the generated ones.  Figures are also written to the folder `--out` as JSON.

    python -m tests.benchmarks.against_blender [--part PART] [--largest 30000] [--seconds 3]

The parts are `quality`, `time`, `growth`, `islands`, `slider` and `scans`, and those of `assets`: `charts`, `models`,
`quads`, `assets` and `again`.  `quality` takes some fifteen minutes and `time` half an hour, nearly all of it Minimum
Stretch at 200 000 triangles.
"""

import argparse
import json
from pathlib import Path
from statistics import median
from unittest.mock import patch

import bpy
import numpy as np
import scipy

from qh_unwrap.core import Settings, descent, unwrap

from . import assets
from .common import Verdicts, find_mesh, load_mesh, meshes_in, table
from .drawing import BLUE, GREEN, GREY, RED, plain_ticks, plt, save
from .generated import body, hills, hundred, islands
from .in_blender import ANGLE_BASED, CONFORMAL, NATIVE, OURS, STRETCH_10, STRETCH_50, extension, in_turns, unwrapped
from .measuring import judged
from .one_unwrap import alone

SCANS = ("venus.obj", "camel_b.obj", "camelhead.off", "mannequin-devil.off", "cowhead.obj", "face_bff.obj")
SIZES = (2000, 10_000, 30_000, 100_000, 200_000)
FASTER = {  # at least so many times as fast, by triangles
    STRETCH_10: {2000: 1, 10_000: 3, 30_000: 6, 100_000: 15, 200_000: 30},
    CONFORMAL: {30_000: 1, 200_000: 3},
}
ALONE = (10_000, 30_000, 100_000, 200_000, 500_000, 1_000_000)
MODEL = 90_000
BALANCES = (0.0, 0.25, 0.5, 1.0)
SLID = ("face_bff.obj", "camelhead.off", "cowhead.obj", "mannequin-devil.off", "lilium.obj")
COLOURS = {OURS: BLUE, STRETCH_10: RED, CONFORMAL: GREEN, ANGLE_BASED: GREY}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=[*PARTS, "all"], default="all", help="what to measure (default: all)")
    parser.add_argument("--largest", type=int, default=10**9, help="leave out meshes of more triangles")
    parser.add_argument("--seconds", type=float, default=20, help="to time each method on a mesh (default: 20)")
    parser.add_argument("--pieces", type=int, default=5000, help="islands of 20 triangles (default: 5000)")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for figures (default: out)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    versions = {"Blender": bpy.app.version_string, "NumPy": np.__version__, "SciPy": scipy.__version__}
    print(", ".join(f"{name} {version}" for name, version in versions.items()))
    verdicts = Verdicts()
    with extension():
        for method in (OURS, *NATIVE):
            unwrapped(hills(500), method)  # what happens only once does not count
        for part in PARTS if arguments.part == "all" else [arguments.part]:
            print(f"\n== {part}\n", flush=True)
            figures = PARTS[part](arguments, verdicts)
            path = arguments.out / f"against_blender_{part}.json"
            path.write_text(json.dumps({"versions": versions, part: figures}, indent=1, default=float) + "\n")
    verdicts.exit()


def quality(arguments, verdicts):
    """Where ours ends beside Minimum Stretch, and how far from the end of its own descent."""
    meshes = {**meshes_in("disk"), **hundred()}
    meshes = {name: mesh for name, mesh in meshes.items() if len(mesh[1]) <= arguments.largest}
    print("Symmetric Dirichlet energy of ours, Minimum Stretch 10 and 50, and ours converged; time of ours\n")
    found = []
    for name, mesh in meshes.items():
        row = {"mesh": name, "triangles": len(mesh[1])}
        for method in (OURS, STRETCH_10, STRETCH_50):
            row[method] = judged(mesh, *unwrapped(mesh, method))
        row["converged"] = converged(mesh)
        found.append(row)
        energies = (row[method]["energy"] for method in (OURS, STRETCH_10, STRETCH_50))
        texts = [f"{energy:.5f}" for energy in (*energies, row["converged"])]
        print(f"{name:<24}{len(mesh[1]):>7}  {'  '.join(texts)}  {row[OURS]['seconds']:.2f} s", flush=True)
    print()
    ours, shortest, longest = (
        np.array([row[method]["energy"] for row in found]) for method in (OURS, STRETCH_10, STRETCH_50)
    )
    end = np.array([row["converged"] for row in found])
    names = np.array([row["mesh"] for row in found])

    def share(text, holds, least):
        figures = f"{holds.sum()} of {len(holds)}, {holds.mean():.1%}"
        if not holds.all():
            figures += f"; not {', '.join(names[~holds])}"
        verdicts.claim(f"{text} on {least:.0%}", holds.mean() >= least, figures)

    share("no more distortion than Minimum Stretch 10", ours <= shortest, 0.98)
    share("within 0.5 % of Minimum Stretch 50, or better", ours <= 1.005 * longest, 0.95)
    share("within 1 % of its own converged energy", ours <= 1.01 * end, 0.9)
    for method, energies in ((STRETCH_10, shortest), (STRETCH_50, longest)):
        above = ours > 1.01 * energies
        worst = ", ".join(f"{names[k]} {ours[k] / energies[k] - 1:+.1%}" for k in np.flatnonzero(above))
        verdicts.claim(f"more than 1 % above {method} on at most two", above.sum() <= 2, worst or "none")
    flips = sum(row[OURS]["flips"] for row in found)
    verdicts.claim("no flips", flips == 0, f"{flips}")
    certified = np.array([row[OURS]["certified"] for row in found])
    share("certified free of flips and overlaps", certified, 1)
    for method in (STRETCH_10, STRETCH_50):
        count = sum(row[method]["certified"] for row in found)
        print(f"{method}: {count} of {len(found)} would be certified")

    figure, axis = plt.subplots(figsize=(6, 3.4))
    others = (STRETCH_10, shortest, RED), (STRETCH_50, longest, GREEN), ("converged", end, GREY)
    for method, energies, colour in others:
        axis.plot(np.sort(100 * (ours / energies - 1)), ".", color=colour, label=f"above {method}")
    axis.set_yscale("symlog", linthresh=0.1)
    axis.set(xlabel="meshes", ylabel="energy of ours, %")
    axis.legend()
    save(figure, arguments.out, "against_blender_quality.png")
    return found


def time(arguments, verdicts):
    """Generated hills, methods in turns."""
    found = []
    for size in sizes_up_to(arguments.largest, SIZES):
        mesh = hills(size)
        methods = compared(f"hills {size:,}", mesh, (OURS, STRETCH_10, CONFORMAL, ANGLE_BASED), arguments.seconds)
        found.append({"size": size, "triangles": len(mesh[1]), **methods})
    for method, targets in FASTER.items():
        for row in found:
            if row["size"] in targets:
                least = targets[row["size"]]
                times, best = (row[method][which] / row[OURS][which] for which in ("seconds", "best"))
                text = f"{row['triangles']:,} triangles: at least {least} times as fast as {method}"
                seconds = f"{row[OURS]['seconds']:.2f} s, {row[method]['seconds']:.2f} s"
                verdicts.claim(text, times >= least, f"{times:.2f} times, {seconds}; the best runs {best:.2f} times")

    draw_time(found, arguments.out)
    return found


def draw_time(found, folder):
    """Time and energy against size."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4))
    for method, colour in COLOURS.items():
        triangles = [row["triangles"] / 1000 for row in found]
        left.loglog(triangles, [row[method]["seconds"] for row in found], "o-", color=colour, label=method)
        style = "o:" if method == STRETCH_10 else "o-"  # nearly as low as ours, on which it is drawn
        right.loglog(triangles, [row[method]["energy"] for row in found], style, color=colour)
    left.set(xlabel="thousand triangles", ylabel="seconds")
    right.set(xlabel="thousand triangles", ylabel="symmetric Dirichlet energy")
    for axis in (left, right):
        plain_ticks(axis.xaxis, [size / 1000 for size in SIZES])
    plain_ticks(left.yaxis, [0.01, 0.1, 1, 10, 100, 1000])
    plain_ticks(right.yaxis, [1, 1.1, 1.2, 1.3, 1.4])
    left.legend()
    save(figure, folder, "against_blender_time.png")


def growth(arguments, verdicts):
    """Ours alone, each mesh three times in a process of its own; only the first time must it ask for all its memory."""
    sizes = sizes_up_to(arguments.largest, ALONE)
    meshes = {size: hills(size) for size in sizes}
    if arguments.largest >= MODEL:
        meshes["body"] = body(np.random.default_rng(1), MODEL)
    found, rows = [], []
    for name, mesh in meshes.items():
        run = alone(mesh, 3)
        run["first"], run["seconds"] = run["seconds"][0], median(run["seconds"])
        found.append({"mesh": name, "triangles": len(mesh[1]), **run})
        shown = name if name == "body" else "hills"
        times = run["first"], run["seconds"]
        rows.append((shown, f"{len(mesh[1]):,}", *times, run["peak"] / 1e9, run["energy"], run["flips"]))
        print(f"{shown}: {len(mesh[1]):,} triangles, {run['seconds']:.2f} s", flush=True)
    print()
    table(("mesh", "triangles", "first", "median", "peak GB", "sym. Dirichlet", "flips"), rows)
    by_name = {row["mesh"]: row for row in found}
    if "body" in by_name:
        print(f"A model of {by_name['body']['triangles']:,} triangles takes {by_name['body']['seconds']:.1f} s")
    if sizes and sizes[-1] == ALONE[-1]:
        large, small = by_name[1_000_000], by_name[100_000]
        times = large["seconds"] / small["seconds"]
        text = "1 M triangles: at most 14 times the time of 100 k"
        verdicts.claim(text, times <= 14, f"{times:.1f} times, {large['seconds']:.1f} s, {small['seconds']:.2f} s")
        verdicts.claim("1 M triangles: peak below 4 GB", large["peak"] < 4e9, f"{large['peak'] / 1e9:.2f} GB")
    return found


def islands_of_20(arguments, verdicts):
    """Thousands of pieces in one mesh."""
    vertices, triangles, piece = islands(arguments.pieces)
    ends = np.flatnonzero(np.diff(piece)) + 1
    parts = []
    for part in np.split(triangles, ends):
        corner, corners = np.unique(part, return_inverse=True)
        parts.append((corner, (vertices[corner], corners.reshape(-1, 3))))
    found = {"islands": len(parts), "triangles": len(triangles)}
    rows = []
    for method, runs in in_turns((vertices, triangles), (OURS, STRETCH_10), arguments.seconds).items():
        seconds = median(seconds for seconds, _ in runs)
        maps = [judged(part, seconds, runs[-1][1][corner]) for corner, part in parts]
        found[method] = {
            "seconds": seconds,
            "energy": float(np.mean([one["energy"] for one in maps])),
            "flips": sum(one["flips"] for one in maps),
            "certified": sum(one["certified"] for one in maps),
        }
        rows.append((method, *found[method].values()))
    table(("method", "seconds", "mean sym. Dirichlet", "flips", "certified"), rows)
    ours, native = found[OURS], found[STRETCH_10]
    verdicts.claim(
        f"{len(parts)} islands of 20 triangles: all certified, and no more distortion than {STRETCH_10}",
        ours["certified"] == len(parts) and ours["energy"] <= native["energy"],
        f"energies {ours['energy']:.6f} and {native['energy']:.6f}",
    )
    verdicts.claim(
        f"{len(parts)} islands of 20 triangles: no slower than {STRETCH_10}",
        ours["seconds"] <= native["seconds"],
        f"{ours['seconds']:.2f} s, {native['seconds']:.2f} s",
    )
    return found


def slider(arguments, verdicts):
    """From even areas to true angles, refined."""
    paths = [path for path in map(find_mesh, SLID) if path]
    meshes = {path.stem: load_mesh(path) for path in paths}
    if len(meshes) < len(SLID):
        made = hundred()
        meshes |= {name: made[name] for name in list(made)[: 3 * (len(SLID) - len(meshes)) : 3]}
    found, rows = [], []
    for name, mesh in meshes.items():
        maps = [judged(mesh, *unwrapped(mesh, balance=balance)) for balance in BALANCES]
        found.append({"mesh": name, "triangles": len(mesh[1]), "balances": BALANCES, "maps": maps})
        for measured in ("angle", "area"):
            rows.append((name, measured, *(one[measured] for one in maps)))
    table(("mesh", "distortion", *map(str, BALANCES)), rows)
    for row in found:
        angle, area = (np.array([one[measured] for one in row["maps"]]) for measured in ("angle", "area"))
        holds = (np.diff(angle) < 0).all() and (np.diff(area) > 0).all()
        flips = sum(one["flips"] for one in row["maps"])
        verdicts.claim(f"{row['mesh']}: angle distortion falls and area distortion rises", holds, f"{flips} flips")
    return found


def scans(arguments, verdicts):
    """Scanned and modelled surfaces."""
    paths = [path for path in map(find_mesh, SCANS) if path]
    found = []
    for path in paths:
        mesh = load_mesh(path)
        if len(mesh[1]) <= arguments.largest:
            methods = compared(path.stem, mesh, (OURS, *NATIVE), arguments.seconds)
            found.append({"mesh": path.stem, "triangles": len(mesh[1]), **methods})
    return found


PARTS = {
    "quality": quality,
    "time": time,
    "growth": growth,
    "islands": islands_of_20,
    "slider": slider,
    "scans": scans,
    **assets.PARTS,
}


def sizes_up_to(largest, sizes):
    return [size for size in sizes if size <= largest]


def converged(mesh):
    """The energy at the end of our own descent: started again until it no longer falls by 1e-4."""
    energy, uv = np.inf, None
    with patch.object(descent, "_NEGLIGIBLE", 1e-6):
        while True:
            initial = "AUTO" if uv is None else "CURRENT"
            result = unwrap(*mesh, Settings(refine=200, initial=initial), uv)
            before, energy, uv = energy, result.report.after.symmetric_dirichlet, result.uv
            if not before - energy > 1e-4 * before:
                return min(before, energy)


def compared(name, mesh, methods, seconds):
    """Print and return time, the median of several runs and the best, and measures of each method on a mesh."""
    found, rows = {}, []
    for method, runs in in_turns(mesh, methods, seconds).items():
        found[method] = judged(mesh, median(seconds for seconds, _ in runs), runs[-1][1])
        found[method] |= {"best": min(seconds for seconds, _ in runs), "runs": len(runs)}
    for method, one in found.items():
        times = one["seconds"] / found[OURS]["seconds"]
        time_columns = one["seconds"], one["best"], one["runs"], times
        rows.append((method, *time_columns, one["l2_stretch"], one["energy"], one["flips"]))
    print(f"{name}: {len(mesh[1]):,} triangles")
    table(("method", "seconds", "best", "runs", "times ours", "L2 stretch", "sym. Dirichlet", "flips"), rows)
    return found


if __name__ == "__main__":
    main()
