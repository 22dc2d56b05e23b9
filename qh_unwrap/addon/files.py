# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files in and out for the command line, by Blender's own importers and exporters."""

import bpy

from ..core.islands import cuts
from . import checking, mesh_arrays, selection, suzanne, writing
from .failures import FileError


def _read_blend(filepath):
    return bpy.ops.wm.open_mainfile(filepath=filepath, load_ui=False, use_scripts=False)


def _importer(operator, **options):
    def read(filepath):
        _new_scene()
        return operator(filepath=filepath, **options)

    return read


def _new_scene():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)


_gltf = _importer(bpy.ops.import_scene.gltf)
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
        _require_finished(READERS[source.suffix.lower()](str(source.absolute())))
    if bpy.context.mode != 'OBJECT':
        bpy.ops.object.mode_set(mode='OBJECT')
    bpy.context.view_layer.update()
    return [obj for obj in selection.distinct_meshes(bpy.context.scene.objects) if obj.data.polygons]


def mark_cuts(objects, options):
    """Mark the cuts of the UVs as seams, where edges are welded all of them."""
    for obj in objects:
        mesh = mesh_arrays.read(obj, options)
        if mesh.uv is not None:
            seam = mesh.seam | cuts(mesh.corner_vertex, mesh.corner_edge, mesh.face_start, len(mesh.seam), mesh.uv)
            obj.data.edges.foreach_set("use_seam", seam if mesh.welded_edge is None else seam[mesh.welded_edge])


def save(path):
    """Write everything to `path`, which is replaced only when all went well."""
    with writing.Staging(overwrite=True) as staging:
        stage(staging, path)
        staging.put_in_place()


def stage(staging, path):
    """Write everything to a new file that waits in `staging` for the place of `path`."""
    suffix = path.suffix.lower()
    expected = checking.content()

    def write(temporary):
        _require_finished(WRITERS[suffix](str(temporary)))

    def check(file):
        checking.check(file, expected if file.suffix.lower() == suffix else None)

    staging.write(path, write, check, beside=suffix == ".blend")  # where paths are relative to its folder


def _require_finished(result):
    """Raise `FileError` where an operator gave up without an exception."""
    if result is not None and 'FINISHED' not in result:
        raise FileError("Blender gave up")


ONE_MAP = (".obj", ".ply")  # what holds a single UV map, which is the active one


def likely_size(path, source, objects):
    """A cautious guess, in bytes, of the size of the file that will be written: no more than it takes."""
    corners = sum(len(obj.data.loops) for obj in objects)
    vertices = sum(len(obj.data.vertices) for obj in objects)
    same_kind = source != "suzanne" and source.suffix.lower() == path.suffix.lower()
    return max(10 * vertices + 8 * corners, source.stat().st_size * 3 // 4 if same_kind else 0)
