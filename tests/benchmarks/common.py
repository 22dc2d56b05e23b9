# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmarks share: meshes, maps, tables and verdicts.

Run a benchmark from the repository's root, with the package installed or `PYTHONPATH=.`:

    QH_MESHES=folder/of/meshes python -m tests.benchmarks.reference_table --out out
"""

import argparse
import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qh_unwrap.core import Settings, unwrap, unwrap_steps

MESHES = "QH_MESHES"
EXACT = {"boundary": "CIRCLE", "tolerance": 0, "refine": 0, "repair": False}  # unless a benchmark says otherwise


class Polygons(NamedTuple):
    """A mesh of polygons, and its UVs where it has any."""

    vertices: np.ndarray  # (n, 3)
    corners: np.ndarray  # (c,) vertex of each corner, face after face
    sizes: np.ndarray  # (f,) corners of each face
    uv: np.ndarray | None = None  # (c, 2)

    @classmethod
    def alike(cls, vertices, faces):
        """The mesh whose faces (f, k) all have k corners."""
        return cls(vertices, faces.ravel(), np.full(len(faces), faces.shape[1]))

    @property
    def triangle_count(self):
        return int(self.sizes.sum() - 2 * len(self.sizes))


def load_mesh(path):
    """Vertices (n, 3) and triangles (m, 3) of an .off or .obj file; larger faces become fans of triangles."""
    points, _, faces = _parsed(path)
    triangles = [(face[0][0], face[k][0], face[k + 1][0]) for face in faces for k in range(1, len(face) - 1)]
    return points, np.array(triangles, dtype=np.int64)


def load_polygons(path):
    """The `Polygons` of such a file, with UVs if every corner has them."""
    points, uv, faces = _parsed(path)
    corners = [corner for face in faces for corner in face]
    uv = uv[[corner[1] for corner in corners]] if all(len(corner) == 2 for corner in corners) else None
    corners = np.array([corner[0] for corner in corners], dtype=np.int64)
    return Polygons(points, corners, np.array([len(face) for face in faces]), uv)


def _parsed(path):
    """Points (n, 3), UVs (k, 2) and faces, lists of corners: each a point's number, and its UV's if it has one."""
    path = Path(path)
    lines = [line.split("#")[0].split() for line in path.read_text().splitlines()]
    lines = [line for line in lines if line]
    if path.suffix == ".off":
        if lines[0] != ["OFF"]:
            raise ValueError(f"{path.name} does not begin with OFF")
        vertex_count, face_count = int(lines[1][0]), int(lines[1][1])
        points, rest = lines[2 : 2 + vertex_count], lines[2 + vertex_count :]
        uv, faces = [], [[(int(i),) for i in line[1 : 1 + int(line[0])]] for line in rest[:face_count]]
    elif path.suffix == ".obj":
        points, uv = ([line[1:] for line in lines if line[0] == kind] for kind in ("v", "vt"))
        counts = len(points), len(uv)
        faces = [[_obj_corner(text, counts) for text in line[1:]] for line in lines if line[0] == "f"]
    else:
        raise ValueError(f"{path.name} is neither .off nor .obj")
    uv = np.array([pair[:2] for pair in uv], dtype=float).reshape(-1, 2)
    return np.array([point[:3] for point in points], dtype=float), uv, faces


def _obj_corner(text, counts):
    """The numbers of a corner's point and UV, the latter if it has one; counted from 0, in the file from 1 or back."""
    numbers = [int(number) for number in text.split("/")[:2] if number]
    return tuple(i - 1 if i > 0 else i + count for i, count in zip(numbers, counts, strict=False))


def find_mesh(name):
    """The path of the mesh file `name` within the folder QH_MESHES, or None."""
    folder = os.environ.get(MESHES)
    return next(Path(folder).rglob(name), None) if folder else None


def paths_in(folder):
    """The paths of the mesh files of a folder within QH_MESHES, none if there is no such folder."""
    return sorted(Path(os.environ.get(MESHES, os.devnull), folder).glob("*.o[bf][jf]"))


def meshes_in(folder):
    """The meshes of a folder within QH_MESHES by name, none if there is no such folder."""
    return {path.stem: load_mesh(path) for path in paths_in(folder)}


def given_meshes(*names):
    """The meshes of these names, as a dictionary; says so and ends the program with 0 where one is missing."""
    paths = {name: find_mesh(name) for name in names}
    missing = [name for name, path in paths.items() if path is None]
    if missing:
        print(f"skipped: set {MESHES} to a folder that holds {', '.join(missing)}")
        sys.exit(0)
    return {Path(name).stem: load_mesh(path) for name, path in paths.items()}


def rings(count):
    """Points (n, 2) on `count` concentric rings of the unit disk, 6 k on ring k, and the triangles between them."""
    points = [np.zeros((1, 2))]
    triangles = []
    for k in range(1, count + 1):
        angle = 2 * np.pi * np.arange(6 * k) / (6 * k)
        points.append(k / count * np.column_stack([np.cos(angle), np.sin(angle)]))
        inner, outer = 1 + 3 * (k - 1) * (k - 2) if k > 1 else 0, 1 + 3 * k * (k - 1)
        for sector in range(6):
            for step in range(k):
                here = outer + sector * k + step
                after = outer + (sector * k + step + 1) % (6 * k)
                below = inner + (sector * (k - 1) + step) % max(1, 6 * (k - 1))
                triangles.append((here, after, below))
                if step < k - 1:
                    triangles.append((below, after, inner + (sector * (k - 1) + step + 1) % (6 * (k - 1))))
    return np.concatenate(points), np.array(triangles)


def half_sphere(count=20):
    """A regular half-sphere of `count` rings: vertices and triangles."""
    points, triangles = rings(count)
    radius = np.linalg.norm(points, axis=1)
    polar = radius * np.pi / 2
    direction = points / np.where(radius > 0, radius, 1)[:, None]
    return np.column_stack([np.sin(polar)[:, None] * direction, np.cos(polar)]), triangles


def final_map(mesh, uv=None, **settings):
    """The map (n, 2) to the circle after exactly `iterations`; flips are not repaired unless `repair` is set."""
    return unwrap(*mesh, Settings(**{**EXACT, **settings}), uv).uv


def maps(mesh, uv=None, **settings):
    """The start (n, 2) and the map after each of exactly `iterations`, as a list; otherwise like `final_map`."""
    settings = {**EXACT, **settings}
    return [state.uv for state in unwrap_steps(*mesh, Settings(**settings), uv)]


def distance(uv, other):
    """The largest distance of a vertex between two maps to the circle, which is 1 wide."""
    return float(np.linalg.norm(uv - other, axis=1).max())


def changes(series):
    """The largest movement of a vertex in every step of a series of maps to the circle."""
    return [distance(after, before) for before, after in pairwise(series)]


def table(header, rows):
    """Print rows of texts and numbers below a header, in columns."""
    cells = [[str(name) for name in header], *([_text(value) for value in row] for row in rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(header))]
    for place, row in enumerate(cells):
        others = (cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))
        print("  ".join([row[0].ljust(widths[0]), *others]).rstrip())
        if place == 0:
            print("-" * (sum(widths) + 2 * len(widths) - 2))
    print()


def _text(value):
    if isinstance(value, float | np.floating):
        return f"{value:.3e}" if value and not 1e-3 <= abs(value) < 1e4 else f"{value:.4f}"
    return str(value)


class Verdicts:
    """Claims and whether the figures bear them out; printed as they come, counted at the end."""

    def __init__(self):
        self.failed = 0

    def claim(self, text, holds, figures=""):
        self.failed += not holds
        print(f"{'holds      ' if holds else 'FALLS SHORT'}  {text}{f' ({figures})' if figures else ''}")

    def exit(self):
        """End the program: 0 if every claim held."""
        sys.exit(min(self.failed, 1))


def output_folder(description):
    """The folder that `--out` names (default `out`), made if it is missing."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for pictures (default: out)")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    return folder
