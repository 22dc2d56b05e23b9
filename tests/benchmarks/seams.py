# SPDX-License-Identifier: GPL-3.0-or-later
"""Seams for closed models: distortion, length, cuts and seconds, beside xatlas and Blender's Smart UV Project.

The energy is the mean symmetric Dirichlet energy of the whole model at one scale.  The length of the seams counts each
edge once, without the mesh's boundary, and is divided by the root of the area.  Seconds are the processor's.

    QH_MESHES=folder/of/meshes python -m tests.benchmarks.seams [--bounds 1.1 1.05 1.025] [--only bunny torus]

xatlas (the extra `compare`) and Blender (`pip install bpy`) take part where they are installed.
"""

import argparse
import time

import numpy as np

from qh_unwrap.core import Settings
from qh_unwrap.core.cuttable import Polygons
from qh_unwrap.core.seam_settings import SeamSettings
from qh_unwrap.core.seams import cut_to
from tests.benchmarks.common import Verdicts, load_polygons, paths_in, table

_FEW = 12_000  # triangles, below which no model may take long


def models(only=()):
    """The closed models by name, and the cow of the charts without its UVs."""
    paths = [*paths_in("closed"), *(path for path in paths_in("charts") if path.stem.startswith("cow"))]
    for path in paths:
        if not only or any(path.stem.startswith(name) for name in only):
            mesh = load_polygons(path)
            yield path.stem, Polygons.of_faces(mesh.vertices, mesh.corners, mesh.sizes)


def energy_and_length(polygons, uv):
    """The mean symmetric Dirichlet energy at one scale of the UVs (c, 2), and the length of the seams they have."""
    corners = polygons.corner_triangles
    a, b, c = polygons.vertices[polygons.corner_vertex[corners]].transpose(1, 0, 2)
    first = b - a
    x = np.linalg.norm(first, axis=1)
    along = ((c - a) * first).sum(axis=1) / np.maximum(x, 1e-300)
    height = np.linalg.norm(np.cross(first, c - a), axis=1) / np.maximum(x, 1e-300)
    area = x * height / 2
    counts = area > 1e-9 * area.sum() / len(area)
    p, q, r = uv[corners].transpose(1, 0, 2)[:, counts]
    x, along, height, area = (each[counts] for each in (x, along, height, area))
    du = (q - p) / x[:, None]
    dv = (r - p - du * along[:, None]) / height[:, None]
    det = np.abs(du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0])
    squares = (du**2).sum(axis=1) + (dv**2).sum(axis=1)
    scale = (area * det).sum() / area.sum()
    det = np.maximum(det, 1e-12 * scale)
    energy = (area * (squares / scale + squares * scale / det**2) / 4).sum() / area.sum()
    return float(energy), length_of(polygons, cut_by(polygons, uv))


def cut_by(polygons, uv):
    """The edges (e,) bool of which the two sides have different UVs (c, 2)."""
    ends = np.flatnonzero(polygons.corner_edge >= 0)
    sizes = np.diff(polygons.face_start, append=len(polygons.corner_vertex))
    last = np.repeat(polygons.face_start + sizes - 1, sizes)
    first = np.repeat(polygons.face_start, sizes)
    following = np.where(ends == last, first, ends + 1)
    forward = polygons.corner_vertex < polygons.corner_vertex[following]
    low, high = np.where(forward, ends, following), np.where(forward, following, ends)
    four = np.column_stack([uv[low], uv[high]])
    order = np.argsort(polygons.corner_edge, kind="stable")
    edge = polygons.corner_edge[order]
    same = edge[1:] == edge[:-1]
    apart = np.abs(four[order[1:]] - four[order[:-1]]).max(axis=1) > 1e-6 * np.ptp(uv, axis=0).max()
    cut = np.zeros(len(polygons.seam), bool)
    cut[edge[1:][same & apart]] = True
    return cut


def length_of(polygons, cut):
    """The length of the edges (e,) bool by the root of the area."""
    a, b, c = polygons.vertices[polygons.corner_vertex[polygons.corner_triangles]].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return float(polygons.lengths[cut].sum() / np.sqrt(area))


def ours(polygons, bound):
    """The `SeamResult`, and the seconds of the clock and the processor."""
    began, worked = time.perf_counter(), time.process_time()
    steps = cut_to(polygons, SeamSettings(distortion=bound), unwrap_settings=Settings())
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value, time.perf_counter() - began, time.process_time() - worked


def by_xatlas(polygons):
    """Energy and length of what xatlas makes, or None where it is not installed."""
    try:
        import xatlas
    except ImportError:
        return None
    triangles = polygons.corner_vertex[polygons.corner_triangles]
    _, indices, uv = xatlas.parametrize(polygons.vertices.astype(np.float32), triangles.astype(np.uint32))
    soup = Polygons.of_triangles(polygons.vertices, triangles)
    return energy_and_length(soup, uv[indices.ravel()].astype(float))


def by_smart_project(polygons):
    """Energy and length of what Smart UV Project makes at 66 degrees, or None without Blender."""
    try:
        import bpy
    except ImportError:
        return None
    sizes = np.diff(polygons.face_start, append=len(polygons.corner_vertex))
    faces = np.split(polygons.corner_vertex, np.cumsum(sizes)[:-1])
    mesh = bpy.data.meshes.new("model")
    mesh.from_pydata(polygons.vertices.tolist(), [], [face.tolist() for face in faces])
    item = bpy.data.objects.new("model", mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.uv.smart_project()
    bpy.ops.object.mode_set(mode='OBJECT')
    uv = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers.active.data.foreach_get("uv", uv)
    bpy.data.objects.remove(item)
    bpy.data.meshes.remove(mesh)
    return energy_and_length(polygons, uv.reshape(-1, 2).astype(float))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bounds", type=float, nargs="+", default=[1.1, 1.05, 1.025])
    parser.add_argument("--only", nargs="*", default=[], help="beginnings of models' names")
    options = parser.parse_args()
    verdicts, lowest = Verdicts(), min(options.bounds)
    others = {}
    for name, polygons in models(options.only):
        others[name] = by_xatlas(polygons), by_smart_project(polygons)
    for bound in options.bounds:
        rows, found = [], {}
        for name, polygons in models(options.only):
            result, clock, worked = ours(polygons, bound)
            certified = all(chart.certified for chart in result.charts)
            xatlas, smart = ((each or (np.nan, np.nan)) for each in others[name])
            count = len(polygons.corner_triangles)
            found[name] = count, result, certified, worked, result.length / xatlas[1], result.length / smart[1]
            figures = (f"{value:.2f}" for value in (result.length, worked, clock))
            counts = int(result.seams.sum()), len(result.charts), certified
            rows.append((name, count, result.energy, *figures, *counts, *xatlas, *smart))
        if not rows:
            print("skipped: set QH_MESHES to a folder that holds the folder `closed`")
            return
        print(f"bound {bound:g}")
        names = "energy", "length", "seconds", "clock", "edges", "charts", "certified"
        table(("model", "triangles", *names, "xatlas", "length", "Smart UV", "length"), rows)
        _judge(verdicts, bound, list(found.values()), bound == lowest)
    verdicts.exit()


def _judge(verdicts, bound, found, is_lowest):
    count, results, certified, seconds, by_xatlas, by_smart = (list(each) for each in zip(*found, strict=True))
    verdicts.claim(f"every model reaches {bound:g}", all(result.energy <= bound for result in results))
    verdicts.claim("every map is certified", all(certified))
    few = [its for its, number in zip(seconds, count, strict=True) if number < _FEW]
    figures = f"median {np.median(seconds):.1f}, {max(few, default=0):.1f}, {max(seconds):.1f}"
    quick = np.median(seconds) <= 5 and max(few, default=0) <= 20 and max(seconds) < 40
    verdicts.claim("it takes 5 seconds at the median, at most 20 below 12 k triangles and 40 above", quick, figures)
    if is_lowest:
        for name, ratios, most, middle in (("xatlas", by_xatlas, 0.5, 0.3), ("Smart UV Project", by_smart, 0.42, 0.2)):
            if not np.isnan(ratios).any():
                figures = f"at most {max(ratios):.2f}, median {np.median(ratios):.2f}"
                holds = max(ratios) <= most and np.median(ratios) <= middle
                verdicts.claim(
                    f"seams are {most:g} as long as {name}'s at most, {middle:g} at the median", holds, figures
                )


if __name__ == "__main__":
    main()
