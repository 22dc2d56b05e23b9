# SPDX-License-Identifier: GPL-3.0-or-later
"""Which formats can be patched, and what that takes."""

from importlib.util import find_spec

from .gltf import GltfOriginal
from .obj import ObjOriginal
from .usd import UsdOriginal

_ORIGINALS = {
    ".obj": ObjOriginal,
    ".glb": GltfOriginal,
    ".gltf": GltfOriginal,
    ".usd": UsdOriginal,
    ".usda": UsdOriginal,
    ".usdc": UsdOriginal,
}
FORMATS = tuple(_ORIGINALS)
_USD = (".usd", ".usda", ".usdc")


def lacks(suffix):
    """What has to be installed before files with this suffix can be patched; nothing if all is there."""
    return "usd-core" if suffix in _USD and find_spec("pxr") is None else ""


def opened(path):
    """The original; raises `PatchError` where it cannot be patched."""
    return _ORIGINALS[path.suffix.lower()](path)
