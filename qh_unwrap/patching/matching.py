# SPDX-License-Identifier: GPL-3.0-or-later
"""Which mesh of a file is which of Blender's, proved by the positions of all corners."""

import re
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .original import Change, Layer, PatchError

_TOLERANCE = 1e-6  # of positions, by the size of the largest coordinate
_UV_TOLERANCE = 1e-3  # of UVs that only tell meshes apart which are alike
_NUMBER = re.compile(r"\.\d{3,}$")


@dataclass(eq=False)
class Seen:
    """A mesh as Blender read it."""

    name: str
    order: int  # in which it was made
    points: np.ndarray  # (n, 3)
    corner_vertex: np.ndarray  # (c,)
    sizes: np.ndarray  # (f,)
    places: np.ndarray  # (k, 3) where its first corner is in the scene, for each object that shows it
    layer: Layer | None = None  # what was worked on, None if nothing was
    old_uv: np.ndarray | None = None  # (c, 2) float32 before that
    uv: np.ndarray | None = None  # (c, 2) float32 now
    changed: np.ndarray | None = None  # (f,) bool

    @property
    def corner_points(self):
        return self.points[self.corner_vertex]


def changes(original, seen):
    """A `Change` for each of Blender's meshes whose UVs changed; raises `PatchError` where it is not certain which."""
    made = {}
    named, alike = _by_stem(original.meshes), _by_stem(sorted(seen, key=lambda each: each.order))
    lookup = _Lookup(original.meshes)
    for each in seen:
        if each.changed is None or not each.changed.any():
            continue
        stem = _stem(each.name)
        mesh, faces = _counterpart(original, lookup, each, named.get(stem, []), alike[stem])
        change = _change(each, mesh, faces)
        other = made.setdefault(id(mesh), change)
        if not np.array_equal(other.uv, change.uv, equal_nan=True):
            raise PatchError(f"{each.name} is one mesh in the file that Blender read as several, with other UVs now")
    return list(made.values())


class _Lookup:
    """The meshes of the file by their size and their first corner, of which there may be thousands."""

    def __init__(self, meshes):
        self._meshes = {}
        for mesh in meshes:
            if len(mesh.sizes) and not mesh.refusal:
                self._meshes.setdefault((len(mesh.sizes), len(mesh.corner_vertex)), []).append(mesh)
        self._firsts = {
            key: np.array([mesh.points[mesh.corner_vertex[0]] for mesh in group]) for key, group in self._meshes.items()
        }

    def like(self, seen):
        """Those that may be the same."""
        key = len(seen.sizes), len(seen.corner_vertex)
        if key not in self._meshes:
            return []
        distance = np.abs(self._firsts[key] - seen.points[seen.corner_vertex[0]]).max(axis=1)
        return [self._meshes[key][number] for number in np.flatnonzero(distance <= _tolerance(seen))]


def _by_stem(meshes):
    found = {}
    for mesh in meshes:
        found.setdefault(_stem(mesh.name), []).append(mesh)
    return found


def _change(seen, mesh, faces):
    """From the order of Blender's faces to that of the file's."""
    start, count = _starts(mesh.sizes), seen.sizes
    corners = np.repeat(start[faces] - _starts(count), count) + np.arange(len(seen.corner_vertex))
    uv = np.full((len(mesh.corner_vertex), 2), np.nan, dtype=np.float32)
    uv[corners] = seen.uv
    changed = np.zeros(len(mesh.sizes), dtype=bool)
    changed[faces] = seen.changed
    if len(faces) < len(mesh.sizes):
        _give_to_twins(mesh, faces, uv, changed)
    return Change(mesh, seen.layer, uv, changed)


def _give_to_twins(mesh, faces, uv, changed):
    """Give faces that Blender left out, since others have the same vertices, the UVs of those: else they would part."""
    corners = np.split(np.arange(len(mesh.corner_vertex)), np.cumsum(mesh.sizes)[:-1])
    there = {frozenset(mesh.corner_vertex[corners[face]].tolist()): face for face in faces.tolist()}
    for face in np.setdiff1d(np.arange(len(mesh.sizes)), faces).tolist():
        vertices = mesh.corner_vertex[corners[face]].tolist()
        twin = there.get(frozenset(vertices))
        if twin is not None and changed[twin]:
            places = dict(zip(mesh.corner_vertex[corners[twin]].tolist(), corners[twin].tolist(), strict=True))
            uv[corners[face]] = uv[[places[vertex] for vertex in vertices]]
            changed[face] = True


def _starts(sizes):
    return np.cumsum(sizes) - sizes


def _counterpart(original, lookup, seen, named, alike):
    """The mesh of the file, and the number of each face in it.

    named   the meshes of the file that have the name, but for the number that Blender adds
    alike   Blender's meshes with that name, in the order in which it made them
    """
    if len(named) == len(alike) and (len(named) == 1 or named[0].places is None):
        mesh = named[alike.index(seen)]
        if mesh.refusal:
            raise PatchError(mesh.refusal)
        faces = _faces(seen, mesh)
        if faces is not None and _has_uv(original, mesh, seen, faces):
            return mesh, faces
    candidates = lookup.like(seen) or [mesh for mesh in named if len(mesh.sizes) > len(seen.sizes)]
    found = [(mesh, faces) for mesh in candidates if (faces := _faces(seen, mesh)) is not None]
    found = [(mesh, faces) for mesh, faces in found if _has_uv(original, mesh, seen, faces)]
    for narrower in (lambda mesh: _is_there(mesh, seen), lambda mesh: mesh.name == seen.name):
        if len(found) > 1:
            found = [each for each in found if narrower(each[0])] or found
    if not found:
        refusals = [mesh.refusal for mesh in named or original.meshes if mesh.refusal]
        raise PatchError(refusals[0] if refusals else f"Blender's faces of {seen.name} are not those in the file")
    if len(found) > 1:
        raise PatchError(f"the file has {len(found)} meshes that are alike, and any could be {seen.name}")
    return found[0]


def _stem(name):
    return _NUMBER.sub("", name)


def _is_there(mesh, seen):
    """Whether an object shows the mesh at one of the places where the file has it."""
    if mesh.places is None:
        return True
    size = max(np.abs(mesh.places).max(), np.abs(seen.places).max(), 1e-30)
    distances = np.abs(mesh.places[:, None] - seen.places[None]).max(axis=2)
    return bool((distances <= 1e-4 * size).any())


def _has_uv(original, mesh, seen, faces):
    """Whether the UVs before the run are those in the file."""
    if seen.layer.is_new or seen.old_uv is None:
        return True
    there = original.uv(mesh, seen.layer)
    if there is None:
        return False
    corners = np.repeat(_starts(mesh.sizes)[faces] - _starts(seen.sizes), seen.sizes) + np.arange(len(seen.old_uv))
    there, here = there[corners], seen.old_uv
    known = ~np.isnan(there).any(axis=1)
    return bool((np.abs(there - here) <= _UV_TOLERANCE * np.maximum(1, np.abs(here)))[known].all())


def _faces(seen, mesh):
    """(f,) for each of Blender's faces its number in the file's mesh; None if they are not the same."""
    if mesh.refusal or not len(mesh.sizes):
        return None
    if len(seen.sizes) < len(mesh.sizes):
        return _some_faces(seen, mesh, _tolerance(seen))
    if not np.array_equal(seen.sizes, mesh.sizes):
        return None
    if (np.abs(seen.corner_points - mesh.corner_points) <= _tolerance(seen)).all():
        return np.arange(len(seen.sizes))
    return None


def _tolerance(seen):
    return _TOLERANCE * np.abs(seen.points).max(initial=0)


def _some_faces(seen, mesh, tolerance):
    """The same where Blender left out faces, such as those without area."""
    if not (np.isfinite(seen.points).all() and np.isfinite(mesh.points).all()):
        return None
    _, first, place = np.unique(mesh.points, axis=0, return_index=True, return_inverse=True)
    place = first[np.ravel(place)]  # of each point, the first one at its place
    distance, nearest = cKDTree(mesh.points).query(seen.points)
    used = np.unique(seen.corner_vertex)
    if (distance[used] > tolerance).any():
        return None
    waiting = {}
    for number, key in reversed(list(enumerate(_keys(place[mesh.corner_vertex], mesh.sizes)))):
        waiting.setdefault(key, []).append(number)
    faces = []
    for key in _keys(place[nearest][seen.corner_vertex], seen.sizes):
        if not waiting.get(key):
            return None
        faces.append(waiting[key].pop())
    return np.array(faces)


def _keys(corner_places, sizes):
    return [tuple(part) for part in np.split(corner_places, np.cumsum(sizes)[:-1])]
