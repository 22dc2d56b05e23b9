# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a file that Blender wrote is whole.  Exporters may say that all went well though the disk is full.

Everything is read by small readers of our own, so that the open scene is not disturbed.
"""

import json
import re
import struct
from typing import NamedTuple

import bpy
import numpy as np

from .failures import FileError


class Content(NamedTuple):
    """How many faces every format has to hold, and how many triangles; `is_all` if there are no others."""

    faces: int
    triangles: int
    is_all: bool


_WITHOUT_FACES = {'EMPTY', 'CAMERA', 'LIGHT', 'LIGHT_PROBE', 'SPEAKER', 'ARMATURE', 'LATTICE'}


def content():
    """What of the open scene every exporter writes as it is: visible meshes without modifiers, each once."""
    faces, corners, is_all, seen = 0, 0, True, set()
    if any(collection.hide_render for collection in bpy.context.scene.collection.children_recursive):
        return Content(0, 0, False)  # some formats leave it out
    for obj in bpy.context.view_layer.objects:
        if obj.type in _WITHOUT_FACES and obj.instance_type == 'NONE':
            continue
        if _is_plain(obj) and obj.data not in seen:
            seen.add(obj.data)
            faces += len(obj.data.polygons)
            corners += len(obj.data.loops)
        else:
            is_all = False
    return Content(faces, corners - 2 * faces, is_all)


def _is_plain(obj):
    return (
        obj.type == 'MESH'
        and not obj.modifiers
        and obj.visible_get()
        and not obj.hide_render
        and obj.instance_type == 'NONE'
        and (obj.parent is None or obj.parent.instance_type == 'NONE')
    )


def check_image(path):
    """Raise `FileError` if a picture that we made is cut off."""
    check(path, readers=_IMAGE_READERS)


def check(path, expected=None, *, readers=None):
    """Raise `FileError` if the file is cut off, cannot be read, or has other faces than the `Content` expected.

    Of what is not known, such as the copy of a texture, which may be as odd as the original, only that it is not empty.
    """
    suffix = path.suffix.lower()
    reader = (_READERS if readers is None else readers).get(suffix)
    if not path.stat().st_size:
        raise FileError("it came out empty: is the disk full?")
    if reader is None:
        return
    try:
        found = reader(path)
    except Exception as error:  # of whatever kind: what cannot be read is not whole
        raise FileError(f"it does not read back ({error or type(error).__name__}): is the disk full?") from error
    if found is None or expected is None:
        return
    wanted = expected.triangles if suffix in (".glb", ".gltf") else expected.faces
    if found < wanted or (found != wanted and expected.is_all):
        raise FileError(f"it reads back with {found} faces in place of {wanted}: is the disk full?")


def _require(condition, text):
    if not condition:
        raise ValueError(text)


def _obj(path):
    data = path.read_bytes()
    _require(data.endswith(b"\n"), "it is cut off")
    return data.count(b"\nf ")


def _mtl(path):
    _require(path.read_bytes().endswith(b"\n"), "it is cut off")


_SIZES = dict(char=1, uchar=1, short=2, ushort=2, int=4, uint=4, float=4, double=8)


def _ply(path):
    """The number of faces in a binary file, whose elements have to end where the file does."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    elements = []  # name, number, properties
    for words in (line.split() for line in data[:end].decode("ascii", "replace").splitlines()):
        if words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            elements[-1][2].append(words[1:-1])
    offset, faces = end, 0
    for name, number, properties in elements:
        if name == "face":
            faces = number
        if all(kind[0] != "list" for kind in properties):
            offset += number * sum(_SIZES[kind[0]] for kind in properties)
            continue
        _require(len(properties) == 1 and properties[0][1] == "uchar", "its faces are of another kind")
        size = _SIZES[properties[0][2]]
        for _ in range(number):
            offset += 1 + size * data[offset]
    _require(offset == len(data), "it is cut off")
    return faces


def _glb(path):
    with path.open("rb") as file:
        magic, _, length, size, kind = struct.unpack("<4sII I4s", file.read(20))
        _require(magic == b"glTF" and kind == b"JSON", "it is no glTF file")
        _require(length == path.stat().st_size, "it is cut off")
        return _gltf_triangles(json.loads(file.read(size)))


def _gltf(path):
    document = json.loads(path.read_text(encoding="utf-8"))
    for buffer in document.get("buffers", ()):
        uri = buffer.get("uri", "data:")
        if not uri.startswith("data:"):
            size = path.with_suffix(".bin").stat().st_size
            _require(size == buffer["byteLength"], "its .bin file is cut off")
    return _gltf_triangles(document)


def _gltf_triangles(document):
    accessors = document.get("accessors", ())
    primitives = [each for mesh in document.get("meshes", ()) for each in mesh["primitives"]]
    return sum(
        accessors[each.get("indices", each["attributes"]["POSITION"])]["count"] // 3
        for each in primitives
        if each.get("mode", 4) == 4
    )


def _fbx(path):
    from io_scene_fbx import parse_fbx  # comes with Blender

    root, _ = parse_fbx.parse(str(path))
    (objects,) = [element for element in root.elems if element and element.id == b"Objects"]
    faces = 0
    for element in objects.elems:
        if element.id == b"Geometry":
            for part in element.elems:
                if part.id == b"PolygonVertexIndex":
                    faces += int((np.asarray(part.props[0]) < 0).sum())  # the last corner of each
    return faces


def _usd(path):
    with path.open("rb") as file:
        head = file.read(24)
        if head.startswith(b"#usda"):
            return _usda(path)
        _require(head.startswith(b"PXR-USDC"), "it is no USD file")
        size = path.stat().st_size
        (start,) = struct.unpack("<q", head[16:])  # of the table of contents
        _require(0 < start < size, "it is cut off")
        file.seek(start)
        (count,) = struct.unpack("<Q", file.read(8))
        for _ in range(count):
            _, first, length = struct.unpack("<16sqq", file.read(32))
            _require(first + length <= size, "it is cut off")
    return _usd_faces(path)


def _usda(path):
    text = path.read_text(encoding="utf-8")
    _require(text.rstrip().endswith("}"), "it is cut off")
    arrays = re.findall(r"int\[\] faceVertexCounts = \[([^\]]*)\]", text)
    return sum(array.count(",") + 1 for array in arrays if array)


def _usd_faces(path):
    """The number of faces, None as a package, which lacks Pixar's library; what is installed is another copy of it."""
    if not bpy.app.binary_path:
        return None
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    return sum(len(mesh.GetFaceVertexCountsAttr().Get() or ()) for mesh in meshes)


def _blend(path):
    """The end that every file of Blender's has, compressed or not."""
    with path.open("rb") as file:
        head = file.read(4)
        file.seek(-64, 2)
        tail = file.read()
    if head == b"\x28\xb5\x2f\xfd":  # Zstandard, with a table of its parts at the end
        _require(tail.endswith(b"\xb1\xea\x92\x8f"), "it is cut off")
    else:
        _require(head == b"BLEN" and b"ENDB" in tail, "it is cut off")


def _png(path):
    data = path.read_bytes()
    _require(data.startswith(b"\x89PNG") and data[-8:-4] == b"IEND", "it is cut off")


def _jpeg(path):
    data = path.read_bytes()
    _require(data.startswith(b"\xff\xd8") and data.endswith(b"\xff\xd9"), "it is cut off")


_READERS = {
    ".obj": _obj,
    ".mtl": _mtl,
    ".ply": _ply,
    ".glb": _glb,
    ".gltf": _gltf,
    ".fbx": _fbx,
    ".usd": _usd,
    ".usda": _usd,
    ".usdc": _usd,
    ".blend": _blend,
}

_IMAGE_READERS = {".png": _png, ".jpg": _jpeg, ".jpeg": _jpeg}
