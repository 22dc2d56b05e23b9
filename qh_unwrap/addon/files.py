# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files in and out for the command line, by Blender's own importers and exporters."""

import os
import re
from typing import NamedTuple

import bpy

from ..core.islands import cuts
from . import checking, formats, mesh_arrays, modes, origin, selection, suzanne, takes, writing
from .failures import FileError
from .formats import READERS, WRITERS
from .outcome import count, listed


class _Opened(NamedTuple):
    """What is known of a file that `load` opened."""

    scene: int  # the number of its scene, by which it is seen whether it is open still
    origin: origin.Origin
    left: modes.Left


_opened = None


def load(source):
    """Open the file (or make Blender's monkey) in place of what is open; returns the scene's meshes with faces."""
    global _opened
    if source == "suzanne":
        formats.new_scene()
        suzanne.add()
        found = origin.Origin()
    else:
        found = origin.of(source)
        _require_finished(READERS[source.suffix.lower()](str(source.absolute())))
        if found.suffix == ".fbx" and bpy.data.actions:
            found = found._replace(takes=tuple(takes.names(str(source))))
    bpy.context.view_layer.update()
    _opened = _Opened(bpy.context.scene.session_uid, found, modes.leave(bpy.context.view_layer))
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
    opened = _opened if _opened and _opened.scene == bpy.context.scene.session_uid else None
    formats.prepare(suffix, opened.origin if opened else origin.Origin())
    expected = checking.content()

    def write(temporary):
        if opened and suffix == ".blend":
            modes.come_back(opened.left)
        _require_finished(WRITERS[suffix](str(temporary)))
        if suffix == ".obj":
            _mend_paths(temporary.with_suffix(".mtl"))

    def check(file):
        checking.check(file, expected if file.suffix.lower() == suffix else None)

    staging.write(path, write, check, beside=formats.is_single(suffix))


def _mend_paths(materials):
    """Have the relative paths of pictures begin at the folder where the file will be, one above that where it waits."""
    if materials.exists():
        text = materials.read_text(encoding="utf-8", errors="surrogateescape")
        text = re.sub(r"^(map_.*? |bump .*?|refl .*?|norm .*?)\.\.[/\\]", r"\1", text, flags=re.MULTILINE)
        materials.write_text(text, encoding="utf-8", errors="surrogateescape")


def _require_finished(result):
    """Raise `FileError` where an operator gave up without an exception."""
    if result is not None and 'FINISHED' not in result:
        raise FileError("Blender gave up")


def missing_pictures():
    """A sentence, if pictures that the open file refers to are not where it says: Blender warns of few of them."""
    pictures = [image for image in bpy.data.images if image.source == 'FILE' and image.users and not image.packed_file]
    paths = [bpy.path.abspath(image.filepath, library=image.library) for image in pictures]
    names = sorted({os.path.basename(path) for path in paths if path and not os.path.exists(path)})
    return [f"{count(len(names), 'picture')} not found: {listed(names)}"] if names else []


def likely_size(path, source, objects):
    """A cautious guess, in bytes, of the size of the file that will be written: no more than it takes."""
    corners = sum(len(obj.data.loops) for obj in objects)
    vertices = sum(len(obj.data.vertices) for obj in objects)
    same_kind = source != "suzanne" and source.suffix.lower() == path.suffix.lower()
    return max(10 * vertices + 8 * corners, source.stat().st_size * 3 // 4 if same_kind else 0)
