# SPDX-License-Identifier: GPL-3.0-or-later
"""A glTF file's document and buffers, which can be added to; whatever else is in the file stays as it is."""

import base64
import json
import struct
from copy import deepcopy
from urllib.parse import quote, unquote

import numpy as np

from .json_text import rewritten
from .original import PatchError, copy_siblings

TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_COMPRESSED = ("EXT_meshopt_compression", "KHR_meshopt_compression")
VERTICES, INDICES = 34962, 34963  # what a view is used for


class GltfFile:
    """The document `json`, as it is changed, and the bytes of its buffers."""

    def __init__(self, path):
        self.path = path
        data = path.read_bytes()
        self._chunks = list(_chunks(data)) if data[:4] == b"glTF" else None
        text = self._chunks[0][1] if self._chunks else data
        self._text = text.decode("utf-8")
        self._mark = "\ufeff" * self._text.startswith("\ufeff")
        self._text = self._text.removeprefix("\ufeff")
        self._old = json.loads(self._text)
        self.json = deepcopy(self._old)
        self._buffers = {}
        self._changed = set()
        self._freed = {}  # of each buffer, the ranges of bytes that nobody reads any more

    def _of(self, name):
        return self.json.get(name, [])

    # Reading

    def buffer(self, number):
        """The bytes of a buffer, which can be changed."""
        if number not in self._buffers:
            self._buffers[number] = bytearray(self._bytes(number))
        return self._buffers[number]

    def _bytes(self, number):
        uri = self.json["buffers"][number].get("uri")
        if uri is None:
            binary = next((chunk for kind, chunk in self._chunks or () if kind == b"BIN\0"), None)
            if number or binary is None:
                raise PatchError(f"its buffer {number} has no data")
            return binary[: self.json["buffers"][number]["byteLength"]]
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        source = self.path.parent / unquote(uri)
        if not source.is_file():
            raise PatchError(f"its buffer {unquote(uri)} is not there")
        return source.read_bytes()

    def rows(self, number):
        """(n, k) uint8 the bytes of each element of an accessor, of a sparse one as well."""
        accessor = self.json["accessors"][number]
        size, count = element_size(accessor), accessor["count"]
        if "bufferView" in accessor:
            rows = np.array(self.strided(accessor["bufferView"], accessor.get("byteOffset", 0), count, size))
        else:
            rows = np.zeros((count, size), dtype=np.uint8)
        sparse = accessor.get("sparse")
        if sparse:
            places, values = sparse["indices"], sparse["values"]
            kind = np.dtype(TYPES[places["componentType"]])
            where = self.strided(
                places["bufferView"], places.get("byteOffset", 0), sparse["count"], kind.itemsize, True
            )
            where = np.ascontiguousarray(where).view(kind).ravel()
            rows[where] = self.strided(values["bufferView"], values.get("byteOffset", 0), sparse["count"], size, True)
        return rows

    def strided(self, view, offset, count, size, packed=False):
        """(n, k) uint8 the elements in a view of a buffer, as they lie there."""
        view = self.json["bufferViews"][view]
        if any(name in view.get("extensions", ()) for name in _COMPRESSED):
            raise PatchError("a mesh is compressed (EXT_meshopt_compression)")
        stride = size if packed else view.get("byteStride") or size
        start = view.get("byteOffset", 0) + offset
        data = np.frombuffer(self.buffer(view["buffer"]), dtype=np.uint8)
        end = start + (count - 1) * stride + size
        if count and end > len(data):
            raise PatchError("an accessor goes beyond the end of its buffer")
        shape = count, size
        return (
            np.lib.stride_tricks.as_strided(data[start:], shape, (stride, 1), writeable=True)
            if count
            else data[:0].reshape(0, size)
        )

    def values(self, number):
        """(n, k) the components of an accessor: as floats where they are floats or normalized, else as they are."""
        accessor = self.json["accessors"][number]
        kind = np.dtype(TYPES[accessor["componentType"]])
        width = _WIDTHS[accessor["type"]]
        values = self.rows(number)[:, : width * kind.itemsize]
        values = np.ascontiguousarray(values).view(kind)
        if accessor.get("normalized") and kind.kind in "iu":
            values = np.maximum(values.astype(np.float32) / np.float32(np.iinfo(kind).max), np.float32(-1))
        return values

    # Writing

    def _add(self, name, item):
        items = self.json.setdefault(name, [])
        items.append(item)
        return len(items) - 1

    def put(self, number, accessor, rows, target, buffer, usage, stride=None):
        """Put elements (n, k) uint8 at the end of a buffer.

        number   the accessor that these are to be from now on, None for a new one, whose number is returned
        stride   the distance of the elements, if they are filled up to it
        usage    says whether the bytes that the accessor had can go
        """
        content = self.changing(buffer)
        content.extend(bytes(-len(content) % 4))
        place = dict(buffer=buffer, byteOffset=len(content), byteLength=rows.size)
        place |= dict(byteStride=stride) if stride else {}
        content.extend(rows.tobytes())
        view = self.json["accessors"][number].get("bufferView") if number is not None else None
        if view is not None and usage.is_free(view):
            old = self.json["bufferViews"][view]
            start = old.get("byteOffset", 0)
            self._freed.setdefault(old["buffer"], []).append((start, start + old["byteLength"]))
            old.pop("byteStride", None)
            old.update(place)
        else:
            view = self._add("bufferViews", place | dict(target=target))
        accessor = dict(bufferView=view) | accessor | dict(count=len(rows))
        if number is None:
            return self._add("accessors", accessor)
        self.json["accessors"][number] = accessor
        return number

    def _drop_freed(self):
        """Leave out the bytes that nobody reads any more; what comes after them moves by multiples of four."""
        for number, ranges in self._freed.items():
            views = [view for view in self.json["bufferViews"] if view["buffer"] == number]
            if any("extensions" in each for each in [*views, self.json["buffers"][number]]):
                continue  # which may have places in the buffer of their own
            ranges = [(start + -start % 4, end - end % 4) for start, end in sorted(ranges)]
            content = self.changing(number)
            ends = [0, *(end for _, end in ranges)]
            starts = [*(start for start, _ in ranges), len(content)]
            removed = np.cumsum([0, *(max(end - start, 0) for start, end in ranges)])
            for view in views:
                passed = np.searchsorted(ends[1:], view.get("byteOffset", 0), side="right")
                if removed[passed]:
                    view["byteOffset"] = view["byteOffset"] - int(removed[passed])
            content[:] = b"".join(content[start:end] for start, end in zip(ends, starts, strict=True))

    def changing(self, number):
        """The bytes of a buffer that will be written again."""
        content = self.buffer(number)
        self._changed.add(number)
        return content

    def write(self, temporary, output, *, is_beside, is_replaced):
        """Write the file, and the buffers and images that it needs where the output will be."""
        self._drop_freed()
        for number in self._changed:
            self.json["buffers"][number]["byteLength"] = len(self._buffers[number])
        names, written = [], {}
        for name in ("buffers", "images"):
            for number, item in enumerate(self._of(name)):
                uri = item.get("uri")
                if uri is None or uri.startswith("data:"):
                    if uri and name == "buffers" and number in self._changed:
                        item["uri"] = uri.partition(",")[0] + "," + base64.b64encode(self._buffers[number]).decode()
                elif name == "buffers" and number in self._changed:
                    written[number] = unquote(uri)
                else:
                    names.append(unquote(uri))
        if is_beside and not is_replaced:  # the original goes on using its own buffers
            taken = {unquote(each.get("uri", "")) for each in self._of("buffers")}
            for number in written:
                written[number] = _free_name(output.stem, taken)
                taken.add(written[number])
                self.json["buffers"][number]["uri"] = quote(written[number])
        for number, name in written.items():
            place = (temporary.parent / name).resolve()
            if not place.is_relative_to(temporary.parent.resolve()):
                raise PatchError(f"its buffer {name} is not beside it")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(self._buffers[number])
        if not is_beside:
            copy_siblings(self.path.parent, names, temporary.parent)
        temporary.write_bytes(self._packed())

    def _packed(self):
        text = (self._mark + rewritten(self._text, self._old, self.json)).encode()
        if not self._chunks:
            return text
        chunks = [(b"JSON", text), *self._chunks[1:]]
        if 0 in self._changed and "uri" not in self.json["buffers"][0]:
            chunks = [(kind, self._buffers[0] if kind == b"BIN\0" else chunk) for kind, chunk in chunks]
        body = b"".join(
            struct.pack("<I4s", len(chunk) + -len(chunk) % 4, kind)
            + chunk
            + _FILLING.get(kind, b"\0") * (-len(chunk) % 4)
            for kind, chunk in chunks
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


_FILLING = {b"JSON": b" "}


def _chunks(data):
    """Yield kind and content of each part of a binary file."""
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2 or length > len(data):
        raise PatchError("it is no whole glTF 2 file")
    place = 12
    while place + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, place)
        yield kind, data[place + 8 : place + 8 + size]
        place += 8 + size


def _free_name(stem, taken):
    names = [f"{stem}.bin", *(f"{stem}.{number}.bin" for number in range(1, len(taken) + 2))]
    return next(name for name in names if name not in taken)


def element_size(accessor):
    """The bytes of an element, with what matrices of small numbers have between their columns."""
    item, width = np.dtype(TYPES[accessor["componentType"]]).itemsize, _WIDTHS[accessor["type"]]
    if accessor["type"].startswith("MAT"):
        columns = {4: 2, 9: 3, 16: 4}[width]
        return columns * (columns * item + -columns * item % 4)
    return width * item
