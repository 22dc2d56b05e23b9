# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files in and out for the command line, by Blender's own importers and exporters."""

import ctypes
import os
import tempfile
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import bmesh
import bpy
import numpy as np

from ..core.islands import cuts
from . import mesh_arrays, selection, suzanne


def _read_blend(filepath):
    return bpy.ops.wm.open_mainfile(filepath=filepath, load_ui=False, use_scripts=False)


def _importer(operator, **options):
    def read(filepath):
        _new_scene()
        return operator(filepath=filepath, **options)

    return read


def _new_scene():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)


_gltf = _importer(bpy.ops.import_scene.gltf, merge_vertices=True)
_usd = _importer(bpy.ops.wm.usd_import)

READERS = {
    ".blend": _read_blend,
    ".obj": _importer(bpy.ops.wm.obj_import),
    ".ply": _importer(bpy.ops.wm.ply_import),
    ".stl": _importer(bpy.ops.wm.stl_import),
    ".glb": _gltf,
    ".gltf": _gltf,
    ".fbx": _importer(bpy.ops.import_scene.fbx),
    ".usd": _usd,
    ".usda": _usd,
    ".usdc": _usd,
}


def _exporter(operator, **options):
    return lambda filepath: operator(filepath=filepath, **options)


_usd = _exporter(bpy.ops.wm.usd_export, root_prim_path="")

WRITERS = {
    ".blend": _exporter(bpy.ops.wm.save_as_mainfile, copy=True),
    ".obj": _exporter(bpy.ops.wm.obj_export, path_mode='ABSOLUTE'),
    ".ply": _exporter(bpy.ops.wm.ply_export),
    ".glb": _exporter(bpy.ops.export_scene.gltf, export_format='GLB'),
    ".gltf": _exporter(bpy.ops.export_scene.gltf, export_format='GLTF_SEPARATE'),
    ".fbx": _exporter(bpy.ops.export_scene.fbx),
    ".usd": _usd,
    ".usda": _usd,
    ".usdc": _usd,
}


def load(source):
    """Open the file (or make Blender's monkey) in place of what is open; returns the scene's meshes with faces."""
    if source == "suzanne":
        _new_scene()
        suzanne.add()
    else:
        READERS[source.suffix.lower()](str(source.absolute()))
    if bpy.context.mode != 'OBJECT':
        bpy.ops.object.mode_set(mode='OBJECT')
    bpy.context.view_layer.update()
    return [obj for obj in selection.distinct_meshes(bpy.context.scene.objects) if obj.data.polygons]


def prepare(objects, *, weld, seams_from_islands):
    """Join vertices that formats like glTF split, and mark the cuts of the UVs as seams."""
    for obj in objects:
        if weld:
            _weld(obj.data)
        if seams_from_islands:
            _mark_cuts(obj)


def _weld(mesh):
    bm = bmesh.new()
    bm.from_mesh(mesh)
    size = np.ptp([vertex.co for vertex in bm.verts], axis=0).max()
    bmesh.ops.remove_doubles(bm, verts=bm.verts, dist=1e-6 * size)
    bm.to_mesh(mesh)
    bm.free()


def _mark_cuts(obj):
    mesh = mesh_arrays.read(obj)
    if mesh.uv is not None:
        cut = cuts(mesh.corner_vertex, mesh.corner_edge, mesh.face_start, len(mesh.seam), mesh.uv)
        obj.data.edges.foreach_set("use_seam", mesh.seam | cut)


def save(path):
    """Write everything to `path`, which is replaced only when all went well."""
    write = WRITERS[path.suffix.lower()]
    if path.suffix.lower() == ".blend":  # paths in it are relative to its folder
        temporary = path.absolute().with_name(f".qh-unwrap-{path.name}")
        try:
            write(str(temporary))
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    else:
        with replacing(path) as temporary:
            write(str(temporary))


def write_text(path, text):
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextmanager
def replacing(path):
    """A place for a new file beside `path`; it and its siblings (.mtl, .bin, textures) move there at the end."""
    path = path.absolute()
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".qh-unwrap-") as folder:
        yield Path(folder, path.name)
        written = [file for file in Path(folder).rglob("*") if file.is_file()]
        for file in sorted(written, key=lambda file: file.name == path.name):
            target = path.parent / file.relative_to(folder)
            target.parent.mkdir(exist_ok=True)
            os.replace(file, target)


@contextmanager
def quiet():
    """Keep what Blender prints from the standard output, which is for the table alone; errors are exceptions."""
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # Blender prints through a buffer of C, too
    library.fflush(None)
    saved = os.dup(1)
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            library.fflush(None)
            os.dup2(saved, 1)
            os.close(saved)
