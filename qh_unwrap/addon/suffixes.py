# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats that can be read and written, by their suffixes; needs no Blender."""

READ = (".blend", ".obj", ".ply", ".stl", ".glb", ".gltf", ".fbx", ".usd", ".usda", ".usdc")
WRITTEN = tuple(suffix for suffix in READ if suffix != ".stl")  # which has no place for UVs
SPLIT = (".glb", ".gltf", ".stl", ".ply")  # what has its vertices split, or each face for itself


def sibling(path):
    """The other file that the format writes beside `path`, None if it writes none."""
    suffix = {".obj": ".mtl", ".gltf": ".bin"}.get(path.suffix.lower())
    return path.with_suffix(suffix) if suffix else None
