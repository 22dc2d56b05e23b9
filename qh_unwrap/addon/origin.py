# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file says that Blender forgets when it reads it, for writing it again; needs no Blender."""

import json
import re
import struct
from pathlib import PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote

_COMPRESSED = (b"\x28\xb5\x2f\xfd", b"\x1f\x8b")  # Zstandard, and gzip before Blender 3.0
_HEAD = 1 << 16  # bytes, in which the settings of a whole .usda file stand


class Origin(NamedTuple):
    """Where the open file comes from."""

    suffix: str = ""  # of its name, small letters; empty for what was made here
    compressed: bool = False
    default_prim: str | None = None  # what other .usd files get that refer to this one
    y_up: bool = False
    metres: float = 1.0  # in a unit
    axes: tuple = ()  # UpAxis, its sign, FrontAxis, its sign, CoordAxis and its sign, in .fbx
    takes: tuple = ()  # the names of them
    pictures: str = ""  # the folder that they are in


def of(source):
    """The `Origin` of the file at this path."""
    suffix = source.suffix.lower()
    if suffix == ".blend":
        with source.open("rb") as file:
            return Origin(suffix, compressed=file.read(4).startswith(_COMPRESSED))
    if suffix in (".usd", ".usda", ".usdc"):
        return Origin(suffix, **_stage(source))
    if suffix == ".fbx":
        return Origin(suffix, **_settings(source))
    if suffix == ".gltf":
        return Origin(suffix, pictures=_folder_of_pictures(source))
    return Origin(suffix)


def _settings(source):
    """The unit and the axes of a binary .fbx file, which stand near its beginning."""
    with source.open("rb") as file:
        head = file.read(_HEAD)
    unit = re.search(rb"UnitScaleFactorS.{4}doubleS.{4}NumberS.{4}D(.{8})", head, re.DOTALL)
    numbers = []
    for name in (b"Up", b"Front", b"Coord"):
        for kind in (b"", b"Sign"):
            found = re.search(rb"\x00%sAxis%sS.{4}intS.{4}IntegerS.{4}I(.{4})" % (name, kind), head, re.DOTALL)
            numbers += struct.unpack("<i", found[1]) if found else ()
    centimetres = struct.unpack("<d", unit[1])[0] if unit else 1.0
    return dict(metres=centimetres / 100, axes=tuple(numbers) if len(numbers) == 6 else ())


def _folder_of_pictures(source):
    """The folder that all pictures of a .gltf file are in, within its own; empty if there is no such folder."""
    images = json.loads(source.read_text(encoding="utf-8")).get("images", ())
    names = [image["uri"] for image in images if not image.get("uri", "data:").startswith("data:")]
    paths = [PurePosixPath(unquote(name)) for name in names]
    folders = {path.parent for path in paths}
    if len(folders) != 1:
        return ""
    (folder,) = folders
    return "" if folder.is_absolute() or ".." in folder.parts or folder == PurePosixPath() else str(folder)


def _stage(source):
    """The settings of a USD file.  In a binary one they are unknown without Pixar's library."""
    with source.open("rb") as file:
        head = file.read(_HEAD)
    if head.startswith(b"#usda"):
        text = head.decode("utf-8", "replace")
        text = text[: _end_of_settings(text)]
        prim = re.search(r'defaultPrim\s*=\s*"([^"]+)"', text)
        axis = re.search(r'upAxis\s*=\s*"(\w)"', text)
        metres = re.search(r"metersPerUnit\s*=\s*([-+.\deE]+)", text)
        return dict(
            default_prim=prim and prim[1], y_up=not axis or axis[1] == "Y", metres=float(metres[1]) if metres else 0.01
        )
    try:
        from pxr import Usd, UsdGeom  # which Blender has, and its Python package has not
    except ImportError:
        return {}
    stage = Usd.Stage.Open(str(source))
    prim = stage.GetDefaultPrim()
    return dict(
        default_prim=prim.GetName() if prim else None,
        y_up=UsdGeom.GetStageUpAxis(stage) == "Y",
        metres=UsdGeom.GetStageMetersPerUnit(stage),
    )


def _end_of_settings(text):
    found = re.search(r"^\s*(def|over|class)\s", text, re.MULTILINE)
    return found.start() if found else len(text)
