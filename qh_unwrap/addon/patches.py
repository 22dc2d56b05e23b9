# SPDX-License-Identifier: GPL-3.0-or-later
"""The file that was read, with new UVs in place of its old ones and nothing else changed."""

import bpy
import numpy as np

from ..patching import formats, matching
from ..patching.original import Layer
from . import checking, mesh_arrays
from .failures import FileError, UsageError

PATCH, EXPORT = "patch", "export"


def mode(write, source, output):
    """How the output is written, "patch" or "export", None if there is none; raises `UsageError` if it cannot be so."""
    if write not in (None, PATCH, EXPORT):
        raise UsageError(f"--write is {write!r}: choose patch or export")
    if output is None:
        if write == PATCH:
            raise UsageError("--write patch needs an output: pass -o")
        return None
    against = _reason_against(source, output)
    if write == PATCH and against:
        raise UsageError(f"--write patch cannot be done: {against}")
    if write is None:
        return EXPORT if against or bpy.app.binary_path else PATCH  # a package has no program
    return write


def _reason_against(source, output):
    suffix = output.suffix.lower()
    if source == "suzanne":
        return "'suzanne' is no file; use --write export"
    if source.suffix.lower() != suffix:
        return f"{source.name} and {output.name} have different formats; use --write export"
    if suffix not in formats.FORMATS:
        return f"{suffix} files are always exported, only {', '.join(formats.FORMATS)} can be patched"
    lacking = formats.lacks(suffix)
    return f"for {suffix} files this needs {lacking}: pip install 'qh-unwrap[files]', or use --write export" * bool(
        lacking
    )


class Patch:
    """The file, and the UVs that the objects have before they are unwrapped, in the `choosing.Maps` that are chosen."""

    def __init__(self, source, objects, maps):
        self._source = source
        self._old = {obj.name: _layer(obj, maps) for obj in objects}

    def stage(self, staging, output, outcomes):
        """Write the patched file to one that waits in `staging`; raises `PatchError` if that cannot be done."""
        original = formats.opened(self._source)
        changes = matching.changes(original, self._seen(outcomes))
        staging.write(output, lambda temporary: original.write(temporary, output.absolute(), changes), _check)

    def _seen(self, outcomes):
        faces = {}
        for outcome in outcomes:
            if not outcome.error:
                faces.setdefault(outcome.obj, []).append(outcome.face_indices)
        shown = {}
        for obj in bpy.data.objects:
            if obj.type == 'MESH' and obj.data.polygons:
                shown.setdefault(obj.data, []).append(obj)
        found = []
        for mesh, objects in shown.items():
            seen = _seen(mesh, objects)
            done = next((obj for obj in objects if obj.name in faces), None)
            if done:
                layer, old = self._old[done.name]
                _add_change(seen, mesh, layer, old, np.concatenate(faces[done.name]))
            found.append(seen)
        return found


def _layer(obj, maps):
    """The `Layer` that is worked on, and its UVs, None if the file has none."""
    layers = obj.data.uv_layers
    active = layers.active or (layers[0] if layers else None)
    if active is None:
        return Layer(0, "UVMap", is_new=True), None
    layer = Layer(layers.find(active.name), active.name, is_new=maps.are_made(obj))
    return layer, None if layer.is_new else mesh_arrays.uvs(obj.data, active.name)


def _seen(mesh, objects):
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    corner_vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner_vertex)
    sizes = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    points = points.reshape(-1, 3)
    places = [obj.matrix_world @ mesh.vertices[int(corner_vertex[0])].co for obj in objects]
    return matching.Seen(mesh.name, mesh.session_uid, points, corner_vertex, sizes, np.array(places))


def _add_change(seen, mesh, layer, old, faces):
    seen.layer, seen.old_uv = layer, old
    seen.uv = mesh_arrays.uvs(mesh, layer.name)
    if old is None:
        seen.changed = np.zeros(len(seen.sizes), dtype=bool)
        seen.changed[faces] = True
    else:
        moved = (old.view(np.uint32) != seen.uv.view(np.uint32)).any(axis=1)
        seen.changed = np.logical_or.reduceat(moved, np.cumsum(seen.sizes) - seen.sizes)


def _check(path):
    if path.suffix.lower() in (".usd", ".usda", ".usdc"):
        checking.check(path)
    elif not path.stat().st_size:
        raise FileError("it came out empty: is the disk full?")
