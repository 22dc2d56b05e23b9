# SPDX-License-Identifier: GPL-3.0-or-later
"""Other texture coordinates for the primitives of a glTF file that share their vertices."""

import numpy as np

from .gltf_file import INDICES, TYPES, VERTICES
from .gltf_usage import numbers

_LARGEST = {5121: 0xFF, 5123: 0xFFFF, 5125: 0xFFFFFFFF}  # what is no vertex but begins a strip anew
_WIDER = {5121: 5123, 5123: 5125}


class Pool:
    """Primitives with the same vertices, and the texture coordinates that their corners get."""

    def __init__(self, file, usage, semantic):
        self._file, self._usage, self._semantic = file, usage, semantic
        self._primitives, self._indices, self._uvs = [], [], []

    def add(self, primitive, index, uv):
        """A primitive with its corners' vertices (c,), and their UVs (c, 2), NaN where it does not matter."""
        self._primitives.append(primitive)
        self._indices.append(index)
        self._uvs.append(uv)

    def write(self):
        """Put the texture coordinates into the file; a vertex that needs several becomes several vertices."""
        attributes = self._primitives[0]["attributes"]
        number, count = attributes.get(self._semantic), self._file.json["accessors"][attributes["POSITION"]]["count"]
        index, uv = np.concatenate(self._indices), np.concatenate(self._uvs)
        old = np.zeros((count, 2), dtype=np.float32)
        stays = np.zeros(len(uv), dtype=bool)
        if number is not None:
            old = self._file.values(number)[:, :2].astype(np.float32)
            stays = (uv == turned(old)[index]).all(axis=1)
        values = turned(uv) + np.float32(0)  # which makes 0 of -0
        values[stays] = old[index[stays]]
        is_known, corner_vertex = ~np.isnan(uv).any(axis=1), index.copy()
        corner_vertex[is_known], source, values = _split(index[is_known], values[is_known], stays[is_known], old)
        self._place_texcoord(number, values, is_grown=len(source) > 0)
        if len(source):
            self._grow(number, source)
            ends = np.cumsum([len(each) for each in self._indices])[:-1]
            for primitive, now, before in zip(
                self._primitives, np.split(corner_vertex, ends), self._indices, strict=True
            ):
                if not np.array_equal(now, before):
                    self._place_index(primitive, now)

    def _place_texcoord(self, number, values, is_grown):
        old = self._file.json["accessors"][number] if number is not None else {}
        is_plain = old.get("componentType") == 5126 and old.get("type") == "VEC2"
        if is_plain and not is_grown and self._is_ours(number) and self._usage.is_alone(number):
            self._file.changing(self._file.json["bufferViews"][old["bufferView"]]["buffer"])
            rows = self._file.strided(old["bufferView"], old.get("byteOffset", 0), old["count"], 8)
            rows[:] = _bytes(values)
            accessor = old
        else:
            kept = {key: old[key] for key in ("name", "min", "max", "extras") if key in old}
            placed = self._placed(number, kept | dict(componentType=5126, type="VEC2"), _bytes(values))
            for primitive in self._primitives:
                primitive["attributes"][self._semantic] = placed
            accessor = self._file.json["accessors"][placed]
        for name, bound in (("min", np.min), ("max", np.max)):
            if name in accessor:
                accessor[name] = bound(values, axis=0).tolist()

    def _grow(self, texcoord, source):
        """Append to all other attributes and morph targets those of the vertices `source`."""
        done = {}
        first = self._primitives[0]
        for number in dict.fromkeys(numbers(first)):
            if number == first["attributes"][self._semantic]:
                continue
            accessor, rows = self._file.json["accessors"][number], self._file.rows(number)
            kept = {key: each for key, each in accessor.items() if key not in ("bufferView", "byteOffset", "sparse")}
            done[number] = self._placed(number, kept, np.concatenate([rows, rows[source]]))
        for primitive in self._primitives:
            for group in [primitive["attributes"], *primitive.get("targets", ())]:
                group.update({name: done.get(number, number) for name, number in group.items()})

    def _place_index(self, primitive, index):
        number = primitive.get("indices")
        old = self._file.json["accessors"][number] if number is not None else {}
        kept = {key: each for key, each in old.items() if key not in ("bufferView", "byteOffset", "sparse")}
        kind = old.get("componentType", 5123)
        while index.max() >= _LARGEST[kind]:
            kind = _WIDER[kind]
        if "min" in kept or "max" in kept:
            kept |= dict(min=[int(index.min())], max=[int(index.max())])
        rows = _bytes(index.astype(TYPES[kind])[:, None])
        if primitive.get("mode", 4) != 4:  # a strip or a fan, which cannot have the vertices that it needs now
            primitive["mode"] = 4
        is_ours = number is not None and self._usage.accessors[number] == 1
        kept |= dict(componentType=kind, type="SCALAR")
        primitive["indices"] = self._file.put(
            number if is_ours else None, kept, rows, INDICES, self._buffer, self._usage
        )

    def _placed(self, number, accessor, rows):
        """The number of an accessor with these elements: the old number, if nothing else uses it."""
        filled = np.pad(rows, ((0, 0), (0, -rows.shape[1] % 4)))  # elements of vertices begin at multiples of four
        old = number if number is not None and self._is_ours(number) else None
        stride = filled.shape[1] if filled.shape[1] != rows.shape[1] else None
        return self._file.put(old, accessor, filled, VERTICES, self._buffer, self._usage, stride)

    def _is_ours(self, number):
        ours = sum(numbers(primitive).count(number) for primitive in self._primitives)
        return self._usage.accessors[number] == ours

    @property
    def _buffer(self):
        """The buffer that new data goes to: that of the positions."""
        document = self._file.json
        accessor = document["accessors"][self._primitives[0]["attributes"]["POSITION"]]
        return document["bufferViews"][accessor["bufferView"]]["buffer"] if "bufferView" in accessor else 0


def turned(uv):
    """Texture coordinates of the file as Blender's UVs, or the other way round; V counts from the other side."""
    return np.column_stack([uv[:, 0], np.float32(1) - uv[:, 1]])


def _bytes(values):
    return np.ascontiguousarray(values).view(np.uint8)


def _split(index, values, stays, old):
    """Make several vertices of what has several values.

    Returns the vertices of the corners (c,), of which old vertex each of the new ones is a copy (e,), and the values of
    all vertices (n + e, 2).  The vertex itself keeps its old value, if any of its corners does, or takes the first.
    """
    bits = _bytes(values.astype(np.float32)).view(np.uint64).ravel()
    keys = np.stack([index.astype(np.uint64), bits], axis=1)
    unique, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    inverse, vertex = inverse.ravel(), unique[:, 0].astype(np.int64)
    is_kept = np.bincount(inverse, stays, len(unique)) > 0
    order = np.lexsort([first, ~is_kept, vertex])
    is_leader = np.ones(len(order), dtype=bool)
    is_leader[1:] = vertex[order][1:] != vertex[order][:-1]
    added = np.sort(first[order[~is_leader]])  # corners, in the order in which they are met
    number = vertex.copy()
    number[inverse[added]] = len(old) + np.arange(len(added))
    result = np.concatenate([old, values[added]])
    leaders = order[is_leader]
    result[vertex[leaders]] = values[first[leaders]]
    return number[inverse], index[added], result
