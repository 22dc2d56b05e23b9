# SPDX-License-Identifier: GPL-3.0-or-later
"""USD, by Pixar's library in a process of its own, since two copies of it in one process may not get on."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from .original import FileMesh, Original, PatchError

_WORKER = Path(__file__).with_name("usd_worker.py")


class UsdOriginal(Original):
    """A USD file, and the layers that it is made of.

    What is written is a small layer over the original, which it names and which has to stay where it is; where the
    original itself is replaced, its own layer is changed.
    """

    def __init__(self, path):
        self.path = path
        found, self._arrays = _asked(dict(task="read", path=str(path.absolute())), {})
        self.meshes = [self._mesh(number, **each) for number, each in enumerate(found["meshes"])]

    def _mesh(self, number, name, path, refusal, is_left_handed, maps):
        mesh = FileMesh(name, refusal=refusal)
        mesh.path, mesh.maps, mesh.number = path, maps, number
        mesh.sizes = self._arrays[f"{number}.sizes"]
        mesh.order = np.arange(sum(mesh.sizes))  # of the file's corners, as Blender has them
        if is_left_handed:
            start = np.repeat(np.cumsum(mesh.sizes) - mesh.sizes, mesh.sizes)
            mesh.order = start + np.repeat(mesh.sizes, mesh.sizes) - 1 - (mesh.order - start)
        mesh.points = self._arrays[f"{number}.points"]
        mesh.corner_vertex = self._arrays[f"{number}.vertices"][mesh.order]
        mesh.places = self._arrays[f"{number}.places"]
        return mesh

    def _map(self, mesh, layer):
        """The number and the description of the mesh's UV map, None if there is none."""
        return next(((number, each) for number, each in enumerate(mesh.maps) if each["name"] == layer.name), None)

    def uv(self, mesh, layer):
        found = self._map(mesh, layer)
        return None if found is None else self._arrays[f"{mesh.number}.uv.{found[0]}"][mesh.order].astype(np.float32)

    def write(self, temporary, output, changes):
        described, arrays = [], {}
        for number, change in enumerate(changes):
            mesh, found = change.mesh, self._map(change.mesh, change.layer)
            if found and found[1]["is_animated"]:
                raise PatchError(f"the UVs {found[1]['name']} of {mesh.path} change over time")
            if found and found[1]["is_half"]:
                raise PatchError(
                    f"the UVs {found[1]['name']} of {mesh.path} are 16-bit floats, too coarse for new ones"
                )
            old = self._arrays[f"{mesh.number}.uv.{found[0]}"] if found else np.zeros((len(mesh.order), 2))
            uv = np.array(old, dtype=np.float64)
            moves = ~np.isnan(change.uv).any(axis=1)
            if found:
                moves &= ~(change.uv == old[mesh.order].astype(np.float32)).all(axis=1)
            uv[mesh.order[moves]] = change.uv[moves]
            vertex = self._arrays[f"{mesh.number}.vertices"]
            _, first, index = np.unique(np.column_stack([vertex, uv]), axis=0, return_index=True, return_inverse=True)
            order = np.argsort(np.argsort(first))  # values in the order in which they are met
            arrays |= {f"{number}.values": uv[np.sort(first)], f"{number}.index": order[index.ravel()]}
            name = found[1]["name"] if found else change.layer.name
            if not mesh.maps and name == "UVMap":
                name = "st"  # which materials look for
            described.append(dict(path=mesh.path, name=name))
        task = dict(
            task="write",
            path=str(self.path.absolute()),
            output=str(temporary),
            in_place=self.is_replaced_by(output),
            original=_from(output.parent, self.path),
            changes=described,
        )
        _asked(task, arrays)


def _from(folder, path):
    """How a file in the folder names the path."""
    path = os.path.realpath(path)
    try:
        name = os.path.relpath(path, os.path.realpath(folder))
    except ValueError:  # on another drive
        return Path(path).as_posix()
    return Path(name).as_posix() if name.startswith(os.pardir) else f"./{Path(name).as_posix()}"


def _asked(task, arrays):
    """Have the worker do it; returns its answer and the arrays with it."""
    with tempfile.TemporaryDirectory(prefix="qh-unwrap-") as folder:
        np.savez(Path(folder, "task.npz"), **arrays)
        Path(folder, "task.json").write_text(json.dumps(task), encoding="utf-8")
        command = [sys.executable, str(_WORKER), folder]
        run = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", errors="replace")
        answer = Path(folder, "answer.json")
        if not answer.is_file():
            lines = run.stderr.strip().splitlines() or [f"exit code {run.returncode}"]
            raise PatchError(f"USD's library failed ({lines[-1]})")
        found = json.loads(answer.read_text(encoding="utf-8"))
        if "error" in found:
            raise PatchError(found["error"])
        with np.load(Path(folder, "answer.npz")) as loaded:
            return found, dict(loaded)
