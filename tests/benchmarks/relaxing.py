# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxing in place beside Blender's Minimize Stretch: on Blender's own unwraps, stretched, sheared and shaken.

    QH_MESHES=folder/of/meshes python -m tests.benchmarks.relaxing [--count 50] [--largest 60000]

Both operators hold the islands' outlines.  Timed is the call of the operator in the UV Editor, with its reading and
writing.  Energies are means over the surface of every island's symmetric Dirichlet energy, of the UVs as stored.
"""

import argparse
import time
from statistics import median

import bpy
import numpy as np

from qh_unwrap.addon import mesh_arrays
from qh_unwrap.core import UnwrapError, distortion
from qh_unwrap.core.regions import Connected, Selection
from qh_unwrap.core.triangles import signed_areas

from .common import Verdicts, load_polygons, paths_in
from .in_blender import _in_edit_mode, _silence, extension

_STRETCH = 0.35  # of random matrices, beside the identity
_NOISE = 0.25  # of the mean edge at a vertex
_AT_MOST = 1.0  # second at 10 000 triangles


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=50, help="how many meshes (default: 50)")
    parser.add_argument("--largest", type=int, default=60_000, help="leave out meshes of more triangles")
    arguments = parser.parse_args()
    paths = [path for folder in ("disk", "artist", "charts", "islands") for path in paths_in(folder)]
    paths *= 2  # which are spoilt in another way the second time
    verdicts, rows = Verdicts(), []
    print(f"{'mesh':<28}{'triangles':>10}{'before':>11}{'ours':>9}{'s':>7}{'Minimize':>11}{'s':>7}  held")
    with extension():
        for number, path in enumerate(paths):
            row = _measured(path, number, arguments.largest)
            if row is not None:
                rows.append(row)
                name, size, before, (ours, seconds, held), (theirs, its_seconds, _) = row
                print(
                    f"{name:<28}{size:>10}{before:>11.4g}{ours:>9.4f}{seconds:>7.2f}{theirs:>11.4g}{its_seconds:>7.2f}"
                    f"  {'yes' if held else 'NO'}",
                    flush=True,
                )
            if len(rows) == arguments.count:
                break
    lower = [ours[0] <= theirs[0] for *_, ours, theirs in rows]
    ratio = median(theirs[1] / ours[1] for *_, ours, theirs in rows)
    per_size = max(ours[1] * min(1, 10_000 / size) for _, size, _, ours, _ in rows if size >= 5000)
    verdicts.claim("what is held stays to the last bit", all(ours[2] for *_, ours, _ in rows))
    verdicts.claim("ours ends lower on all", all(lower), f"{sum(lower)} of {len(rows)}")
    verdicts.claim("ours is faster in the median", ratio > 1, f"{ratio:.2f} times")
    verdicts.claim("it takes at most a second at 10 000 triangles", per_size <= _AT_MOST, f"{per_size:.2f}")
    verdicts.exit()


def _measured(path, seed, largest):
    """Name, triangles, energy before, and for ours and Blender's the energy after, seconds, and whether what is held
    stayed; None where Blender makes no map that could be relaxed."""
    polygons = load_polygons(path)
    if polygons.triangle_count > largest:
        return None
    spoilt, connected, before = None, None, 0.0
    results = []
    for ours in (True, False):
        data = _in_edit_mode(polygons)
        with _silence():
            bpy.ops.uv.unwrap(method='ANGLE_BASED', margin=0.01)
        if spoilt is None:
            mesh = mesh_arrays.read(bpy.context.object)
            everything = Selection(np.ones(len(mesh.face_start), bool), np.ones(len(mesh.corner_vertex), bool))
            its = mesh.corner_vertex, mesh.corner_edge, mesh.face_start, len(mesh.seam)
            connected = Connected(*its, mesh.uv, everything)
            spoilt = _spoilt(mesh, connected, np.random.default_rng(seed))
            connected = Connected(*its, spoilt.astype(float), everything)  # as the operator finds it
            islands = connected.islands(everything.faces, mesh.corner_triangles)
            before = _energy(mesh, islands, spoilt)
            held = connected.single & ~connected.moving(False)
            if before is None or not (~held).any():
                return None
        bpy.ops.object.mode_set(mode='OBJECT')
        data.uv_layers.active.uv.foreach_set("vector", spoilt.ravel())
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
        seconds = _timed(ours)
        bpy.ops.object.mode_set(mode='OBJECT')
        uv = np.empty(2 * len(data.loops), np.float32)
        data.uv_layers.active.uv.foreach_get("vector", uv)
        uv = uv.reshape(-1, 2)
        results.append((_energy(mesh, islands, uv), seconds, np.array_equal(uv[held], spoilt[held])))
    return path.stem, polygons.triangle_count, before, *results


def _timed(ours):
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.ui_type = 'UV'
    region = next(region for region in area.regions if region.type == 'WINDOW')
    bpy.context.scene.tool_settings.use_uv_select_sync = True
    with bpy.context.temp_override(window=window, area=area, region=region), _silence():
        begun = time.perf_counter()
        try:
            if ours:
                bpy.ops.uv.qh_relax()
            else:
                bpy.ops.uv.minimize_stretch(iterations=100, fill_holes=False)  # else it moves the holes' rims
        except RuntimeError:  # nothing is written, and that is measured
            pass
        return time.perf_counter() - begun


def _spoilt(mesh, connected, rng):
    """The UVs (c, 2), each island stretched and sheared about its middle, and each inner vertex moved about."""
    uv = mesh.uv.copy()
    vertex = connected.uv_vertex
    following = np.arange(1, len(uv) + 1)
    following[np.append(mesh.face_start[1:], len(uv)) - 1] = mesh.face_start
    length = np.linalg.norm(uv[following] - uv, axis=1)
    size = np.bincount(vertex, length) / np.maximum(np.bincount(vertex), 1)
    shift = rng.uniform(-_NOISE, _NOISE, (len(size), 2)) * size[:, None]
    shift[connected.outline] = 0
    uv += shift[vertex]
    whole = np.zeros(len(mesh.face_start), bool)
    for first in range(len(mesh.face_start)):
        if not whole[first]:
            only = np.zeros_like(whole)
            only[first] = True
            faces = connected.whole_islands(only)
            whole |= faces | only
            its = np.isin(mesh.corner_faces, np.flatnonzero(faces | only))
            matrix = np.eye(2) + rng.uniform(-_STRETCH, _STRETCH, (2, 2))
            middle = uv[its].mean(axis=0)
            uv[its] = middle + (uv[its] - middle) @ matrix.T
    return uv.astype(np.float32)


def _energy(mesh, islands, uv):
    """The mean energy over the surface, infinite with flips, of the islands that can be measured; None if none can."""
    energies, areas = [], []
    for island in islands:
        its = np.empty((len(island.vertices), 2))
        its[island.corner_vertex] = uv[island.corners]
        vertices = mesh.vertices[island.vertices]
        try:
            its[:, 0] *= _winding(its, island.triangles)
            found = distortion(vertices, island.triangles, its)
        except UnwrapError:
            continue
        a, b, c = vertices[island.triangles].transpose(1, 0, 2)
        areas.append(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        energies.append(np.inf if found.flips or found.collapsed else found.symmetric_dirichlet)
    return float(np.average(energies, weights=areas)) if energies else None


def _winding(uv, triangles):
    return 1 if signed_areas(uv[triangles]).sum() > 0 else -1


if __name__ == "__main__":
    main()
