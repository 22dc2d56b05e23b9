# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavefront OBJ: what of its text says which UVs the faces have."""

import re
from functools import cached_property
from itertools import pairwise

import numpy as np

from .obj_siblings import siblings
from .obj_text import patched
from .original import FileMesh, Original, PatchError, copy_siblings

_LINE = re.compile(rb"(?:[^\n\\]+|\\[ \t\r\f\v]*\n|\\)*(?:\n|\Z)")  # a backslash joins it to the next one


class ObjOriginal(Original):
    """An OBJ file, line by line.

    lines          the text, cut into lines, of which some go on after a backslash
    vt             (t, 2) float32 the UVs, and vt_line (t,) the lines that they stand in
    data_line      the lines of all kinds of vertices
    object_line    the lines that begin an object
    face_line      (f,) the line of each face, and sizes (f,) its number of corners
    raw            (c, 2) the numbers that each corner has for its point and its UV, as they are written; 0 for none
    corner_vertex  (c,) the point that this means, from 0; corner_vt (c,) the same of the UV, -1 for none
    others         other lines that may use UVs
    """

    def __init__(self, path):
        self.path = path
        data = path.read_bytes()
        is_plain = b"\\" not in data and b"\r" not in data
        self.lines = data.splitlines(keepends=True) if is_plain else _LINE.findall(data)
        self._read()

    def _read(self):
        points, vts, sizes, raw = [], [], [], []
        self.others, library = [], []
        vt_line, data_line, object_line, face_line, known = [], [], [], [], []
        for number, line in enumerate(self.lines):
            words = line.replace(b"\\", b" ").split()
            word = words[0] if words else b""
            try:
                if word == b"v":
                    points.append([float(each) for each in words[1:4]])
                    data_line.append(number)
                elif word == b"vt":
                    vts.append(_uv(words))
                    vt_line.append(number)
                    data_line.append(number)
                elif word in (b"vn", b"vp"):
                    data_line.append(number)
                elif word == b"f":
                    corners = list(_corners(words))
                    raw += corners
                    sizes.append(len(corners))
                    face_line.append(number)
                    known.append((len(points), len(vts)))
            except ValueError:
                raise PatchError(f"line {number + 1} is not understood") from None
            if word == b"o":
                object_line.append(number)
            elif word in (b"l", b"surf"):
                self.others.append(number)
            elif word == b"mtllib":
                library.append(b" ".join(words[1:]))
        if any(len(point) != 3 for point in points):
            raise PatchError("there is a point without three coordinates")
        self._libraries = [name.decode("utf-8", "surrogateescape") for name in library]
        self._points = np.array(points, dtype=np.float32).reshape(-1, 3)
        self.vt = np.array(vts, dtype=np.float32).reshape(-1, 2)
        self.vt_line, self.data_line, self.object_line, self.face_line, self.sizes = (
            np.array(each, dtype=np.int64) for each in (vt_line, data_line, object_line, face_line, sizes)
        )
        self.raw = np.array(raw, dtype=np.int64).reshape(-1, 2)
        known = np.repeat(np.array(known, dtype=np.int64).reshape(-1, 2), self.sizes, axis=0)
        absolute = np.where(self.raw < 0, self.raw + known, self.raw - 1)
        self.corner_vertex, self.corner_vt = absolute[:, 0], absolute[:, 1]
        if ((absolute < (0, -1)) | (absolute >= known)).any():
            raise PatchError("a face has a point or a UV that is not above it")

    @cached_property
    def corner_face(self):
        """(c,) the face of each corner."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def _face_ranges(self):
        """The first face of each object and the one after its last; objects without faces are none."""
        cuts = np.searchsorted(self.face_line, self.object_line)
        bounds = np.unique(np.concatenate([[0], cuts, [len(self.sizes)]]))
        return list(pairwise(bounds))

    @cached_property
    def meshes(self):
        start = np.concatenate([[0], np.cumsum(self.sizes)])
        found = []
        for first, last in self._face_ranges:
            corners = slice(start[first], start[last])
            used, vertex = np.unique(self.corner_vertex[corners], return_inverse=True)
            mesh = FileMesh(self._name(first), self._points[used], vertex.ravel(), self.sizes[first:last])
            mesh.corners, mesh.faces = corners, slice(first, last)
            found.append(mesh)
        return found

    def _name(self, face):
        """The name of the object that the face is of."""
        number = np.searchsorted(self.object_line, self.face_line[face]) - 1
        if number < 0:
            return self.path.stem
        return b" ".join(self.lines[self.object_line[number]].split()[1:]).decode("utf-8", "replace")

    def uv(self, mesh, layer):
        number = self.corner_vt[mesh.corners]
        if not len(self.vt):
            return None
        return np.where((number >= 0)[:, None], self.vt[number], np.float32(np.nan))

    def write(self, temporary, output, changes):
        uv = np.full((len(self.raw), 2), np.nan, dtype=np.float32)
        changed = np.zeros(len(self.sizes), dtype=bool)
        for change in changes:
            uv[change.mesh.corners] = change.uv
            changed[change.mesh.faces] = change.changed
        temporary.write_bytes(patched(self, uv, changed))
        if not self.is_beside(output):
            copy_siblings(self.path.parent, siblings(self.path.parent, self._libraries), temporary.parent)


def _uv(words):
    return float(words[1]), float(words[2]) if len(words) > 2 and not words[2].startswith(b"#") else 0.0


def _corners(words):
    """Yield the numbers of the point and the UV of each corner."""
    for word in words[1:]:
        if word.startswith(b"#"):
            return
        numbers = word.split(b"/")
        yield int(numbers[0]), int(numbers[1]) if len(numbers) > 1 and numbers[1] else 0
