# SPDX-License-Identifier: GPL-3.0-or-later
"""What all formats have in common: a file's meshes, and what shall be changed of them."""

import os
import shutil
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


class PatchError(Exception):
    """The file cannot be patched; the message says why."""


@dataclass
class Layer:
    """A UV map as Blender knows it."""

    number: int
    name: str
    is_new: bool  # the file has nothing of the kind


@dataclass(eq=False)
class FileMesh:
    """A mesh of the file: its faces and corners in the order, and its points in the frame, of Blender's importer."""

    name: str
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # (n, 3)
    corner_vertex: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # (c,)
    sizes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # (f,) corners of each face
    places: np.ndarray | None = None  # (k, 3) where its first corner may be in the scene; None if that is not known
    refusal: str = ""  # why it cannot be patched

    @property
    def corner_points(self):
        return self.points[self.corner_vertex]


@dataclass
class Change:
    """New UVs of a mesh of the file."""

    mesh: FileMesh
    layer: Layer
    uv: np.ndarray  # (c, 2) float32 of all corners; NaN where Blender left out a face
    changed: np.ndarray  # (f,) bool, the faces whose UVs are new

    @property
    def changed_corners(self):
        return np.repeat(self.changed, self.mesh.sizes)


class Original(ABC):
    """A file that was read, to be written again with other UVs."""

    path: Path
    meshes: list[FileMesh]

    @abstractmethod
    def uv(self, mesh, layer):
        """(c, 2) float32 the UVs that the mesh's corners have in the file, NaN where there are none."""

    @abstractmethod
    def write(self, temporary, output, changes):
        """Write the patched file to `temporary`, and beside it what it needs in the folder of `output`."""

    def is_beside(self, output):
        """Whether the output is in the folder of the original."""
        return os.path.realpath(output.parent) == os.path.realpath(self.path.parent)

    def is_replaced_by(self, output):
        return os.path.realpath(output) == os.path.realpath(self.path)


def copy_siblings(folder, names, target):
    """Copy the files with these names, which are relative to `folder`, to the same places below `target`."""
    for name in dict.fromkeys(names):
        source = Path(folder, name)
        if os.path.isabs(name) or not source.is_file():  # its name stays as good or bad as it was
            continue
        relative = Path(os.path.normpath(name))
        if relative.parts[0] == os.pardir:
            raise PatchError(f"it names the file {name}, which cannot be copied to a place outside the output's folder")
        place = target / relative
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, place)
