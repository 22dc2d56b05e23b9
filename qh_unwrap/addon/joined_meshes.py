# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of several objects as one, for what looks at all of them together."""

import numpy as np

from ..core.pieces import starts_of
from . import tiles

_UNSET = "its UVs are unset: unwrap it"
_NO_NUMBERS = "its UVs are no numbers (NaN or infinite): unwrap it, or reset them"
_NOWHERE = "its vertices have coordinates that are no numbers (NaN or infinite): delete or move them"


class JoinedMeshes:
    """The meshes of all targets as one, of which faces without UVs are left out."""

    def __init__(self, targets, meshes):
        self.targets = targets
        self.face_counts = {target.obj.name: len(mesh.face_start) for target, mesh in zip(targets, meshes, strict=True)}
        self.face_starts = starts_of([mesh.face_start for mesh in meshes])
        corner_starts = starts_of([mesh.corner_vertex for mesh in meshes])
        vertex_starts = starts_of([mesh.vertices for mesh in meshes])
        edge_starts = starts_of([mesh.seam for mesh in meshes])
        slot_starts = starts_of([mesh.images for mesh in meshes])

        def joined(name, starts=None):
            parts = [getattr(mesh, name) for mesh in meshes]
            return np.concatenate(
                parts if starts is None else [part + first for part, first in zip(parts, starts, strict=True)]
            )

        self.corner_vertex = joined("corner_vertex", vertex_starts)
        self.corner_edge = joined("corner_edge", edge_starts)
        self.face_start = joined("face_start", corner_starts)
        self.corner_triangles = joined("corner_triangles", corner_starts)
        self.edge_count = sum(len(mesh.seam) for mesh in meshes)
        self.points = joined("vertices")[self.corner_vertex]
        self.slot = joined("slot", slot_starts)
        self.images = [image for mesh in meshes for image in mesh.images]
        pictures = [picture for mesh in meshes for picture in mesh.pictures]
        # Of every material: the number of what it shows, its image's aspect and pixels, and the tiles there are
        numbers = {image: number for number, image in enumerate(dict.fromkeys(self.images))}
        self.sheets = np.array([numbers[image] for image in self.images])
        self.slot_aspect = np.ones(len(self.images))
        self.slot_aspect[self.slot] = joined("aspect")
        self.pixels = np.array([picture.pixels if picture else 0 for picture in pictures], dtype=float)
        self.tiles = [picture.tiles if picture else tiles.ONLY for picture in pictures]
        uvs = [np.zeros((len(mesh.corner_vertex), 2)) if mesh.uv is None else mesh.uv for mesh in meshes]
        self.uv = np.concatenate(uvs)
        asked = np.concatenate([target.faces for target in targets])
        self._faults = self._without(asked, np.concatenate([mesh.fresh for mesh in meshes]))
        self.selected = asked & ~np.logical_or.reduce([faces for _, faces in self._faults])

    def _without(self, asked, fresh):
        """The faces, (f,) bool, that there is nothing to check of, with the reason."""

        def all_of(corners):
            return np.logical_and.reduceat(corners, self.face_start) if len(self.face_start) else np.zeros(0, bool)

        nowhere = asked & ~all_of(np.isfinite(self.points).all(axis=1))
        no_numbers = asked & ~nowhere & ~all_of(np.isfinite(self.uv).all(axis=1))
        unset = asked & ~nowhere & ~no_numbers & (fresh | all_of((self.uv == 0).all(axis=1)))
        return (_NOWHERE, nowhere), (_NO_NUMBERS, no_numbers), (_UNSET, unset)

    def object_of(self, faces):
        """The numbers of the targets that faces (k,) belong to."""
        return np.searchsorted(self.face_starts, faces, side="right") - 1

    def split(self, faces):
        """Faces (k,), ascending, by the names of their objects, and by their numbers in these."""
        owner = self.object_of(faces)
        return {self.targets[k].obj.name: faces[owner == k] - self.face_starts[k] for k in np.unique(owner).tolist()}

    def left_out(self):
        """Yield the reason for which faces cannot be checked, the name of their object, and their numbers in it."""
        for reason, faces in self._faults:
            for name, its in self.split(np.flatnonzero(faces)).items():
                yield reason, name, its
