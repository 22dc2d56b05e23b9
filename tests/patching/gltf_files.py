# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF files made by hand, for the tests, and a check that they are valid; needs no Blender."""

import base64
import json
import struct
from pathlib import Path
from urllib.parse import unquote

import numpy as np

_CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
_KINDS = {code: np.dtype(name) for name, code in _CODES.items()}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_WIDTHS = {name: width for width, name in _TYPES.items()}


class Builder:
    """A document that arrays are added to."""

    def __init__(self):
        self.json = dict(asset=dict(version="2.0"), buffers=[{}], bufferViews=[], accessors=[], meshes=[], nodes=[])
        self.json |= dict(scene=0, scenes=[dict(nodes=[])])
        self.binary = bytearray()

    def view(self, data, **keys):
        self.binary.extend(bytes(-len(self.binary) % 4))
        self.json["bufferViews"].append(dict(buffer=0, byteOffset=len(self.binary), byteLength=len(data)) | keys)
        self.binary.extend(data)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, view=None, bounds=False, **keys):
        """Add an array (n, k) or (n,) as an accessor, in a view of its own unless one is given."""
        values = np.asarray(values)
        width = values.shape[1] if values.ndim == 2 else 1
        if view is None:
            size = values.itemsize * width
            stride = size + -size % 4
            if size != stride and values.ndim == 2:
                rows = np.zeros((len(values), stride), dtype=np.uint8)
                rows[:, :size] = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), size)
                view = self.view(rows.tobytes(), byteStride=stride)
            else:
                view = self.view(values.tobytes())
        accessor = dict(bufferView=view, componentType=_CODES[values.dtype.name], count=len(values), type=_TYPES[width])
        if bounds:
            accessor |= dict(
                min=np.atleast_1d(values.min(axis=0)).tolist(), max=np.atleast_1d(values.max(axis=0)).tolist()
            )
        self.json["accessors"].append(accessor | keys)
        return len(self.json["accessors"]) - 1

    def interleaved(self, **attributes):
        """Add arrays (n, k) to one view, element by element; returns the number of an accessor for each."""
        parts = [np.ascontiguousarray(each).view(np.uint8).reshape(len(each), -1) for each in attributes.values()]
        parts = [np.pad(each, ((0, 0), (0, -each.shape[1] % 4))) for each in parts]
        rows = np.concatenate(parts, axis=1)
        view = self.view(rows.tobytes(), byteStride=rows.shape[1])
        found, offset = {}, 0
        for (name, values), part in zip(attributes.items(), parts, strict=True):
            found[name] = self.accessor(values, view, name == "POSITION", byteOffset=offset)
            offset += part.shape[1]
        return found

    def mesh(self, *primitives, name="Mesh", node=None, **keys):
        self.json["meshes"].append(dict(name=name, primitives=list(primitives)) | keys)
        self.node(**dict(name=name, mesh=len(self.json["meshes"]) - 1) | (node or {}))
        return len(self.json["meshes"]) - 1

    def node(self, **keys):
        self.json["nodes"].append(keys)
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)

    def write(self, path, *, embedded=False, chunks=(), indent=None):
        """Write a .glb, with more chunks if wanted, or a .gltf with a .bin or all in one."""
        self.json["buffers"][0]["byteLength"] = len(self.binary)
        if path.suffix == ".glb":
            text = json.dumps(self.json, ensure_ascii=False, indent=indent).encode()
            parts = [(b"JSON", text + b" " * (-len(text) % 4))]
            parts += [(b"BIN\0", bytes(self.binary) + bytes(-len(self.binary) % 4)), *chunks]
            body = b"".join(struct.pack("<I4s", len(part), kind) + part for kind, part in parts)
            path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
            return path
        if embedded:
            data = base64.b64encode(self.binary).decode()
            self.json["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{data}"
        else:
            self.json["buffers"][0]["uri"] = f"{path.stem}.bin"
            path.with_suffix(".bin").write_bytes(self.binary)
        path.write_text(json.dumps(self.json, ensure_ascii=False, indent=indent), encoding="utf-8")
        return path


class Parsed:
    """A file read back."""

    def __init__(self, path):
        data = Path(path).read_bytes()
        self.chunks = []
        if data[:4] == b"glTF":
            assert struct.unpack_from("<II", data, 4) == (2, len(data))
            place = 12
            while place < len(data):
                size, kind = struct.unpack_from("<I4s", data, place)
                assert size % 4 == 0
                self.chunks.append((kind, data[place + 8 : place + 8 + size]))
                place += 8 + size
        self.text = (self.chunks[0][1] if self.chunks else data).decode()
        self.json = json.loads(self.text)
        self.buffers = [self._buffer(path, each) for each in self.json["buffers"]]

    def _buffer(self, path, buffer):
        uri = buffer.get("uri")
        if uri is None:
            return next(data for kind, data in self.chunks if kind == b"BIN\0")
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        return path.with_name(unquote(uri)).read_bytes()

    def array(self, number):
        """(n, k) the elements of an accessor that is not sparse."""
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = _KINDS[accessor["componentType"]], _WIDTHS[accessor["type"]]
        size = kind.itemsize * width
        stride = view.get("byteStride", size)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        assert start % kind.itemsize == 0 and stride % kind.itemsize == 0, "aligned"
        end = accessor.get("byteOffset", 0) + (accessor["count"] - 1) * stride + size
        assert end <= view["byteLength"], "within its view"
        buffer = self.buffers[view["buffer"]]
        assert view.get("byteOffset", 0) + view["byteLength"] <= self.json["buffers"][view["buffer"]]["byteLength"]
        places = start + stride * np.arange(accessor["count"])[:, None] + np.arange(size)
        return np.frombuffer(buffer, dtype=np.uint8)[places].copy().view(kind)

    def primitives(self):
        return [primitive for mesh in self.json["meshes"] for primitive in mesh["primitives"]]

    def check(self):
        """Assert what the specification asks of accessors."""
        for buffer, data in zip(self.json["buffers"], self.buffers, strict=True):
            assert 0 <= len(data) - buffer["byteLength"] < 4
        for number, accessor in enumerate(self.json["accessors"]):
            if "sparse" in accessor:
                continue
            values = self.array(number)
            for name, bound in (("min", np.min), ("max", np.max)):
                if name in accessor:
                    assert np.array_equal(bound(values, axis=0), np.array(accessor[name], dtype=values.dtype))
        for primitive in self.primitives():
            attributes = primitive["attributes"]
            numbers = [*attributes.values(), *(each for one in primitive.get("targets", ()) for each in one.values())]
            (count,) = {self.json["accessors"][number]["count"] for number in numbers}
            assert "min" in self.json["accessors"][attributes["POSITION"]]
            for number in numbers:
                accessor = self.json["accessors"][number]
                if "sparse" not in accessor:
                    view = self.json["bufferViews"][accessor["bufferView"]]
                    size = _KINDS[accessor["componentType"]].itemsize * _WIDTHS[accessor["type"]]
                    assert view.get("byteStride", size) % 4 == 0 and accessor.get("byteOffset", 0) % 4 == 0
            if "indices" in primitive:
                index = self.array(primitive["indices"])
                assert index.max() < min(count, np.iinfo(index.dtype).max)
            sets = sorted(name for name in attributes if name.startswith("TEXCOORD"))
            assert sets == [f"TEXCOORD_{number}" for number in range(len(sets))]


def grid(size=4, turn=0.0):
    """A bent grid: points (n, 3), texture coordinates (n, 2), triangles (t, 3)."""
    u, v = np.meshgrid(np.arange(size + 1) / size, np.arange(size + 1) / size)
    points = np.column_stack([2 * u.ravel(), np.sin(3 * u.ravel() + turn), -2 * v.ravel()]).astype(np.float32)
    corner = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    first = np.column_stack([corner, corner + 1, corner + size + 2])
    second = np.column_stack([corner, corner + size + 2, corner + size + 1])
    texcoords = np.column_stack([u.ravel(), v.ravel()]).astype(np.float32)
    return points, texcoords, np.stack([first, second], axis=1).reshape(-1, 3)


def box():
    """A cube with eight vertices, which have to be split where it is cut."""
    points = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=np.float32)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return points, np.array([(q[0], q[1], q[2], q[0], q[2], q[3]) for q in quads]).reshape(-1, 3)


def rich():
    """A document with everything that must not be lost: two primitives with the same vertices, and what else there is.

    The mesh "Körper" has a skin, morph targets, an attribute of its own, colours, and lies interleaved; the second mesh
    uses its index accessor as well; there are cameras, lights, animations and what nobody knows.
    """
    made = Builder()
    points, texcoords, triangles = grid(5)
    count, half = len(points), len(triangles) // 2
    random = np.random.default_rng(1)
    attributes = made.interleaved(
        POSITION=points,
        NORMAL=np.tile(np.float32((0, 1, 0)), (count, 1)),
        TEXCOORD_0=texcoords,
        TEXCOORD_1=texcoords[:, ::-1].copy(),
        JOINTS_0=random.integers(0, 2, (count, 4), dtype=np.uint8),
    )
    attributes["WEIGHTS_0"] = made.accessor(np.full((count, 4), 0.25, dtype=np.float32))
    attributes["COLOR_0"] = made.accessor(random.integers(0, 255, (count, 3), dtype=np.uint8), normalized=True)
    attributes["_TEMPERATURE"] = made.accessor(random.random(count).astype(np.float32), name="warm")
    zeros = np.zeros((count, 3), dtype=np.float32)
    whole = made.accessor(random.random((count, 3)).astype(np.float32), bounds=True)
    places, values = np.array([1, 3, 20], dtype=np.uint16), random.random((3, 3)).astype(np.float32)
    sparse = dict(componentType=5126, type="VEC3", count=count, min=[0, 0, 0], max=values.max(axis=0).tolist())
    sparse["sparse"] = dict(
        count=3,
        indices=dict(bufferView=made.view(places.tobytes()), componentType=5123),
        values=dict(bufferView=made.view(values.tobytes())),
    )
    made.json["accessors"].append(sparse)
    targets = [dict(POSITION=whole, NORMAL=made.accessor(zeros)), dict(POSITION=len(made.json["accessors"]) - 2)]
    parts = [made.accessor(part.ravel().astype(np.uint8)) for part in (triangles[:half], triangles[half:])]
    primitives = [
        dict(attributes=dict(attributes), targets=[dict(each) for each in targets], indices=part, material=number)
        for number, part in enumerate(parts)
    ]
    made.json["materials"] = [dict(name="Haut"), dict(name="皮", extras=dict(roughness=1.50))]
    body = made.mesh(*primitives, name="Körper", weights=[0.0, 0.0], extras=dict(targetNames=["a", "b"], price=1e2))
    other = dict(attributes=dict(POSITION=made.accessor(points, bounds=True)), indices=parts[0])
    made.mesh(other, name="Other")
    matrices = np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (2, 1))
    joints = len(made.json["nodes"])
    made.json["nodes"] += [dict(name="Root", children=[joints + 1]), dict(name="Tip")]
    made.json["scenes"][0]["nodes"].append(joints)
    made.json["skins"] = [dict(joints=[joints, joints + 1], inverseBindMatrices=made.accessor(matrices))]
    made.json["nodes"][body]["skin"] = 0
    times = made.accessor(np.float32((0, 1)), bounds=True)
    turns = made.accessor(np.float32([(0, 0, 0, 1), (0, 1, 0, 0)]))
    sampler, channel = dict(input=times, output=turns), dict(sampler=0, target=dict(node=joints, path="rotation"))
    made.json["animations"] = [dict(name="Wave", samplers=[sampler], channels=[channel])]
    made.json["cameras"] = [dict(type="perspective", perspective=dict(yfov=0.5, znear=0.1))]
    made.node(name="Camera", camera=0)
    lights = dict(lights=[dict(type="point", color=[1, 0.5, 0.25])])
    made.json["extensions"] = dict(KHR_lights_punctual=lights, ACME_secret=dict(of=[1.0, 2e5, "ü"]))
    made.json["extensionsUsed"] = ["KHR_lights_punctual", "ACME_secret"]
    made.json["extras"] = dict(made_by="hand")
    return made
