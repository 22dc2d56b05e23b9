# SPDX-License-Identifier: GPL-3.0-or-later
"""Charts, models, quads and assets of many islands beside Minimum Stretch 10: parts of `against_blender`.

A map is measured on the UVs that Blender stores and on the triangles that it makes of its polygons, island by island,
each scaled to the area of its surface; a mesh's energy is the mean of its islands', weighted by their areas.

In the tables every "Min. S." is Minimum Stretch's figure beside ours; "times ours" is how many times our time it takes,
"ratio" our energy by its energy, "more" how many islands have more energy than it gives them.
"""

from statistics import median

import numpy as np

from ..core import shapes
from .common import Polygons, find_mesh, load_polygons, paths_in
from .generated import quads_halved, waves
from .in_blender import OURS, STRETCH_10, in_turns, loop_triangles
from .measuring import islands_of, judged_islands, outline

BEAST = "beast_quads_uv.obj"
GRIDS = (20, 50, 120, 250)  # quads along a side
SHEETS = {500: 7, 300: 12, 200: 17, 100: 24, 40: 39}  # how many an asset has, and quads along a side of each
LARGE = 9000  # triangles
SLACK = 1.001  # so many times Minimum Stretch's energy still is no more
HEADER = (
    *("mesh", "triangles", "islands", "outline", "seconds", "Min. S.", "times ours", "energy", "Min. S.", "ratio"),
    *("worst", "Min. S.", "more", "flips", "Min. S.", "certified", "Min. S."),
)


def charts(arguments, verdicts):
    """Disks as people have them, and closed meshes, cut as their UVs are."""
    meshes = {path.stem: load_polygons(path) for path in paths_in("charts")}
    meshes = {name: mesh if is_closed(mesh) else mesh._replace(uv=None) for name, mesh in meshes.items()}
    return beside(meshes, arguments, verdicts)


def models(arguments, verdicts):
    """Models of many islands, cut as their UVs are, if they have any, and wherever more than two faces meet."""
    paths = [*paths_in("islands"), find_mesh(BEAST)]
    return beside({path.stem: load_polygons(path) for path in paths if path}, arguments, verdicts)


def quads(arguments, verdicts):
    """Bumpy, curled grids of quads, which stay quads."""
    grids = {f"{across} x {across} quads": sheet(np.random.default_rng([4, across]), across) for across in GRIDS}
    return beside({name: Polygons.alike(*grid) for name, grid in grids.items()}, arguments, verdicts)


def many_sheets(arguments, verdicts, again=False):
    """Assets of many islands, sheets of triangles, each curled and bumpy in its own way."""
    assets = {f"{count} x {2 * across**2} triangles": asset(count, across) for count, across in SHEETS.items()}
    found = beside(assets, arguments, verdicts, again)
    for row in found:
        ours, native = row[OURS]["seconds"], row[STRETCH_10]["seconds"]
        text = f"{row['mesh']}: at least as fast as {STRETCH_10}"
        verdicts.claim(text, ours <= native, f"{native / ours:.2f} times, {ours:.2f} s, {native:.2f} s")
    return found


def unwrapped_before(arguments, verdicts):
    """The same assets with the UVs that the same method gave them before."""
    return many_sheets(arguments, verdicts, again=True)


PARTS = {"charts": charts, "models": models, "quads": quads, "assets": many_sheets, "again": unwrapped_before}


def is_closed(mesh):
    return not len(outline(mesh.corners[loop_triangles(mesh)]))


def asset(count, across):
    """So many sheets side by side, as `Polygons` of three corners."""
    corner = np.add.outer(np.arange(across) * (across + 1), np.arange(across)).ravel()
    vertices, triangles = [], []
    for number in range(count):
        random = np.random.default_rng([5, across, number])
        points, _ = sheet(random, across)
        triangles.append(quads_halved(random, corner, across + 1) + number * len(points))
        vertices.append(points + (0, 0, 2 * number))
    return Polygons.alike(np.concatenate(vertices), np.concatenate(triangles))


def sheet(random, across):
    """Vertices (n, 3) of a curled grid with bumps, a unit wide, and its quads (q, 4)."""
    vertices, _ = shapes.grid(across, across)
    plane = vertices[:, :2]
    inside = ((plane > 0) & (plane < 1)).all(axis=1)
    plane[inside] += random.uniform(-0.2, 0.2, (inside.sum(), 2)) / across
    curl = random.uniform(0.5, 4)  # of a turn of 2 pi
    angle = curl * plane[:, 0]
    radius = 1 / curl + random.uniform(0.2, 1) * waves(random, plane, 3, 1.2)
    corner = np.add.outer(np.arange(across) * (across + 1), np.arange(across)).ravel()
    faces = np.column_stack([corner, corner + 1, corner + across + 2, corner + across + 1])
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), plane[:, 1]]), faces


def beside(meshes, arguments, verdicts, again=False):
    """Print and return a row for every mesh, `Polygons`, by name: time and islands of ours and Minimum Stretch 10."""
    found = []
    for name, mesh in meshes.items():
        if mesh.triangle_count <= arguments.largest:
            if not found:
                print_row(HEADER)
            found.append(compared(name, mesh, arguments.seconds, again))
            print_row(texts(found[-1]))
    if found:
        print()
        summarize(found)
        claims(found, verdicts)
    return found


def compared(name, mesh, seconds, again=False):
    """What both methods make of a mesh: time, the median of several runs, and measures of the islands of the last."""
    triangles = loop_triangles(mesh)
    row = {"mesh": name, "triangles": len(triangles)}
    energies = []
    for method, runs in in_turns(mesh, (OURS, STRETCH_10), seconds, again=again).items():
        uv = runs[-1][1]
        islands = islands_of(mesh, triangles, np.zeros((len(mesh.corners), 2)) if uv is None else uv)
        found = judged_islands(islands)
        energies.append(found.pop("energies"))
        row[method] = {"seconds": median(each for each, _ in runs), "runs": len(runs), **found}
        row[method] |= {"islands": len(islands), "outline": sum(len(outline(island.triangles)) for island in islands)}
    ours, native = energies
    row["times"] = row[STRETCH_10]["seconds"] / row[OURS]["seconds"]
    row["ratio"] = row[OURS]["energy"] / row[STRETCH_10]["energy"]
    row["more"] = int((ours > SLACK * native).sum()) if len(ours) == len(native) else None
    return row


def texts(row):
    """The cells of a row, in the order of the header."""
    ours, native = row[OURS], row[STRETCH_10]
    cells = [row["mesh"], f"{row['triangles']:,}", ours["islands"], ours["outline"]]
    cells += [f"{ours['seconds']:.3f}", f"{native['seconds']:.3f}", f"{row['times']:.2f}"]
    cells += [f"{ours['energy']:.5f}", f"{native['energy']:.5g}", f"{row['ratio']:.5f}"]
    cells += [f"{ours['worst']:.4f}", f"{native['worst']:.5g}", row["more"]]
    return [*cells, *(one[counted] for counted in ("flips", "certified") for one in (ours, native))]


def print_row(cells):
    print(f"{cells[0]:<24}", *(f"{cell!s:>10}" for cell in cells[1:]), flush=True)


def summarize(found):
    """Print the range of the ratios, and how many meshes take longer or have more energy."""
    times, ratio = (np.array([row[which] for row in found]) for which in ("times", "ratio"))
    least, most = (f"{times[k]:.2f} ({found[k]['mesh']})" for k in (times.argmin(), times.argmax()))
    print(f"{STRETCH_10} takes {np.median(times):.2f} times our time (median), from {least} to {most}")
    worst = f"{ratio.max():.5f} ({found[ratio.argmax()]['mesh']})"
    print(f"Our energy is {np.median(ratio):.5f} times that of {STRETCH_10} (median), at worst {worst}")
    slower, more = (times < 1).sum(), (ratio > SLACK).sum()
    large = times[[row["triangles"] >= LARGE for row in found]]
    if 0 < len(large) < len(found):
        print(f"Of {LARGE:,} triangles and more: {np.median(large):.2f} times in the median")
    print(f"{slower} of {len(found)} are slower, {more} have more than {SLACK} times the energy\n")


def claims(found, verdicts):
    """That nothing is flipped or covered twice, and no mesh has more energy."""
    flips = {row["mesh"]: row[OURS]["flips"] for row in found}
    verdicts.claim("no flips", not any(flips.values()), _named(flips))
    missing = {row["mesh"]: row[OURS]["islands"] - row[OURS]["certified"] for row in found}
    verdicts.claim("every island is certified", not any(missing.values()), _named(missing))
    above = {row["mesh"]: f"{row['ratio'] - 1:+.2%}" for row in found if row["ratio"] > SLACK}
    verdicts.claim(f"no more energy than {STRETCH_10}, up to {SLACK - 1:.1%}", not above, _named(above))


def _named(values):
    return ", ".join(f"{name}: {value}" for name, value in values.items() if value)
