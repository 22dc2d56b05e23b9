# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF: the triangles of its primitives, and other texture coordinates for them.

A vertex that needs several texture coordinates becomes several vertices, with all attributes and morph targets.
"""

import json

import numpy as np

from .gltf_file import GltfFile
from .gltf_usage import Usage
from .gltf_vertices import Pool, turned
from .original import FileMesh, Original, PatchError

_DRACO = "KHR_draco_mesh_compression"


class GltfOriginal(Original):
    def __init__(self, path):
        self.path = path
        try:
            self._file = GltfFile(path)
            self.meshes = [self._mesh(number, each) for number, each in enumerate(self._file.json.get("meshes", ()))]
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise PatchError(f"its structure is not understood ({type(error).__name__}: {error})") from error

    def _mesh(self, number, mesh):
        name = mesh.get("name") or f"Mesh_{number}"
        found = FileMesh(name)
        found.number, found.parts = number, []
        points, corners, count = [], [], 0
        try:
            for primitive in mesh["primitives"]:
                if "POSITION" not in primitive["attributes"]:
                    continue
                if _DRACO in primitive.get("extensions", ()):
                    raise PatchError(f"{name} is compressed ({_DRACO})")
                index = self._triangles(primitive)
                if index is None:  # points and lines, which have no UVs
                    continue
                place = self._file.values(primitive["attributes"]["POSITION"]).astype(np.float32)
                found.parts.append((primitive, index))
                points.append(place[:, [0, 2, 1]] * np.array([1, -1, 1], dtype=np.float32))
                corners.append(index + count)
                count += len(place)
        except PatchError as refusal:
            found.refusal = str(refusal)
            return found
        if corners:
            found.points, found.corner_vertex = np.concatenate(points), np.concatenate(corners)
            found.sizes = np.full(len(found.corner_vertex) // 3, 3)
        return found

    def _triangles(self, primitive):
        """(c,) the vertices of the triangles, three by three; None if there are none."""
        mode = primitive.get("mode", 4)
        if mode < 4:
            return None
        if "indices" in primitive:
            index = self._file.values(primitive["indices"]).ravel().astype(np.int64)
        else:
            index = np.arange(self._file.json["accessors"][primitive["attributes"]["POSITION"]]["count"])
        first, second, third = index[:-2], index[1:-1], index[2:]
        if mode == 4:
            return index[: len(index) // 3 * 3]
        if mode == 5:  # a strip, in which every other triangle is turned
            is_odd = np.arange(len(first)) % 2 == 1
            return np.column_stack([first, np.where(is_odd, third, second), np.where(is_odd, second, third)]).ravel()
        return np.column_stack([np.full(len(second), index[0]), second, third]).ravel()

    def uv(self, mesh, layer):
        semantic, found = f"TEXCOORD_{layer.number}", []
        for primitive, index in mesh.parts:
            number = primitive["attributes"].get(semantic)
            if number is None:
                found.append(np.full((len(index), 2), np.nan, dtype=np.float32))
            else:
                found.append(turned(self._file.values(number)[:, :2].astype(np.float32))[index])
        found = np.concatenate(found)
        return None if np.isnan(found).all() else found

    def write(self, temporary, output, changes):
        pools, usage = {}, Usage(self._file)
        for change in changes:
            semantic = f"TEXCOORD_{change.layer.number}"
            changed, place = change.changed_corners, 0
            for primitive, index in change.mesh.parts:
                corners = slice(place, place + len(index))
                place += len(index)
                if changed[corners].any():
                    self._fill(primitive, change.layer.number, usage)
                    key = json.dumps([semantic, primitive["attributes"], primitive.get("targets")], sort_keys=True)
                    pool = pools.setdefault(key, Pool(self._file, usage, semantic))
                    pool.add(primitive, index, change.uv[corners])
        for pool in pools.values():
            pool.write()
        self._file.write(temporary, output, is_beside=self.is_beside(output), is_replaced=self.is_replaced_by(output))

    def _fill(self, primitive, number, usage):
        """Give it the sets of texture coordinates before this one, as the format wants, with what Blender shows."""
        for each in range(number):
            if f"TEXCOORD_{each}" not in primitive["attributes"]:
                pool = Pool(self._file, usage, f"TEXCOORD_{each}")
                pool.add(primitive, np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32))
                pool.write()
