# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes that are unwrapped together, checked and joined to one surface of many pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import locality
from .boundary import outer_loop
from .certificate import enclosed_area
from .chart import Surface, normalised_pieces
from .distortion import checked_uv
from .domain import Fixed
from .errors import PinError, ShapeError, UnwrapError, UVError
from .pieces import joined
from .plane import Walls
from .report import Result, Shape
from .settings import Settings
from .topology import Topology, checked_arrays
from .walls import clear_walls


@dataclass(eq=False)
class Batch:
    """The sound ones of some shapes, as the pieces of one surface, and what is given of them."""

    surface: Surface
    index: np.ndarray  # (p,), the number of every piece's shape
    uv: np.ndarray  # (n, 2), the given UVs, seen in the mirror where they are mirrored
    has_uv: np.ndarray  # (p,) bool
    pinned: np.ndarray  # (n, 2) bool
    partner: np.ndarray | None  # (n, 2)
    mirror: np.ndarray  # (p, 2), what to multiply UVs with: -1 for U in a mirror
    start: np.ndarray  # (n, 2), the maps from which pins are led, seen like the UVs, which they are elsewhere
    has_start: np.ndarray  # (p,) bool
    crossing: np.ndarray  # (p,) bool, whether outlines that cross themselves are kept
    walls: Walls = None  # seen like the UVs

    @property
    def has_pins(self) -> np.ndarray:
        """(p,) bool"""
        return np.logical_or.reduceat(self.pinned[:, 0] | self.pinned[:, 1], self.surface.vertex_starts)

    @property
    def has_partners(self) -> np.ndarray:
        """(p,) bool"""
        if self.partner is None:
            return np.zeros(self.surface.piece_count, bool)
        apart = (self.partner != np.arange(len(self.uv))[:, None]).any(axis=1)
        return np.logical_or.reduceat(apart, self.surface.vertex_starts)

    @property
    def has_walls(self) -> np.ndarray:
        """(p,) bool"""
        if self.walls is None:
            return np.zeros(self.surface.piece_count, bool)
        return np.array([walls is not None for walls in self.walls])

    @property
    def has_hold(self) -> np.ndarray:
        """(p,) bool, whether anything says where the piece lies."""
        return self.has_pins | self.has_partners | self.has_walls

    @property
    def fixed(self) -> Fixed:
        """What pins and partners fix."""
        return Fixed(self.pinned, self.uv, self.partner)

    def in_frame(self, settings: Settings) -> np.ndarray:
        """(p,) bool, whether the old UVs hold the new ones."""
        if settings.boundary == "KEEP":
            return self.has_uv
        return self.has_uv & self.has_hold & (settings.boundary == "FREE")

    def apart(self, uv: np.ndarray) -> np.ndarray:
        """In which pieces (p,) bool of the map `uv` (n, 2) pins are elsewhere than they are to be."""
        away = self.pinned & (uv != self.uv)
        return np.logical_or.reduceat(away[:, 0] | away[:, 1], self.surface.vertex_starts)

    def rows(self, pieces: np.ndarray) -> np.ndarray:
        """(n,) bool, the vertices of the chosen pieces, (p,) bool."""
        return pieces[self.surface.vertex_piece]

    def rows_of(self, k: int) -> slice:
        """The vertices of piece k."""
        return slice(*self.surface.vertex_ends[k : k + 2])

    def of(self, pieces: np.ndarray) -> Batch:
        """The chosen pieces, (p,) bool, alone."""
        number, rows = self.surface.numbering(pieces), self.rows(pieces)
        fixed = self.fixed.of(rows, number)
        by_piece = (each[pieces] for each in (self.index, self.has_uv, self.mirror, self.has_start, self.crossing))
        index, has_uv, mirror, has_start, crossing = by_piece
        return Batch(
            surface=self.surface.of(pieces, number),
            index=index,
            uv=fixed.values,
            has_uv=has_uv,
            pinned=fixed.held,
            partner=fixed.partner,
            mirror=mirror,
            start=self.start[rows],
            has_start=has_start,
            crossing=crossing,
            walls=None if self.walls is None else [self.walls[k] for k in np.flatnonzero(pieces).tolist()],
        )


class Batched:
    """A batch made of shapes.

    Attributes
    ----------
    batch : Batch, None where no shape is sound
    errors : dictionary from the numbers of the others to their errors
    """

    def __init__(self, shapes: Sequence[Shape], settings: Settings):
        self.errors: dict[int, UnwrapError] = {}
        self._sorted: dict[int, locality.Sorted] = {}
        self._face = {k: shape.face for k, shape in enumerate(shapes) if shape.face is not None}
        checked: dict[int, Shape] = {}
        for k, shape in enumerate(shapes):
            try:
                checked[k] = self._checked(k, shape, settings)
            except UnwrapError as error:
                self.errors[k] = error
        self.batch = self._joined(checked, settings)

    def restored(self, k: int, uv: np.ndarray) -> np.ndarray:
        """Values at the vertices of shape k, (n, ...), in its own order."""
        return self._sorted[k].restored(uv) if k in self._sorted else uv

    def sorted(self, k: int, values: np.ndarray) -> np.ndarray:
        """Values at the vertices of shape k, (n, ...), in the batch's order."""
        return self._sorted[k].sorted(values) if k in self._sorted else values

    def face(self, k: int) -> np.ndarray | None:
        """The polygon that each triangle of shape k is a part of, (m,), in the batch's order, or None."""
        face = self._face.get(k)
        if face is None or k not in self._sorted:
            return face
        return np.asarray(face)[self._sorted[k].own_triangles(np.arange(len(face)))]

    def restored_result(self, k: int, result: Result) -> Result:
        """The result of shape k, in its own order."""
        return self._sorted[k].restored_result(result) if k in self._sorted else result

    def _checked(self, k, shape, settings):
        vertices, triangles = checked_arrays(shape.vertices, shape.triangles)
        n = len(vertices)
        uv, start = (None if given is None else checked_uv(n, given) for given in (shape.uv, shape.start))
        pinned = checked_pins(n, shape.pinned)
        if uv is None and settings.boundary == "FREE" and pinned is not None and pinned.any():
            raise UVError("pins need UVs, and there are none: unpin")
        if uv is None and settings.initial == "CURRENT":
            raise UVError("to start from the current UVs there must be some: choose another start")
        partner = None if shape.partner is None else np.asarray(shape.partner)
        if partner is not None and not (partner.shape == (n, 2) and ((partner >= 0) & (partner < n)).all()):
            raise ShapeError(f"partners must be vertices, in the shape ({n}, 2)")
        if partner is not None and uv is None:
            raise UVError("vertices that keep their distance need UVs, and there are none")
        if shape.face is not None and np.shape(shape.face) != (len(triangles),):
            raise ShapeError(f"there must be a face for each of the {len(triangles)} triangles")
        importance = checked_importance(len(triangles), shape.importance)
        if n <= locality.MANY:
            return Shape(vertices, triangles, uv, pinned, partner, None, importance, start, shape.crossing, shape.walls)
        mesh = self._sorted[k] = locality.Sorted(vertices, triangles)
        partner = None if partner is None else mesh.renumbered(partner)
        importance = mesh.sorted_triangles(importance)
        uv, pinned, start = (mesh.sorted(values) for values in (uv, pinned, start))
        return Shape(
            mesh.vertices,
            mesh.triangles,
            uv,
            pinned,
            partner,
            importance=importance,
            start=start,
            crossing=shape.crossing,
            walls=shape.walls,
        )

    def _joined(self, shapes, settings):
        while shapes:
            meshes = [each.vertices for each in shapes.values()], [each.triangles for each in shapes.values()]
            vertices, triangles, vertex_starts, triangle_starts = joined(*meshes)
            topology = Topology(triangles, len(vertices), vertex_starts, triangle_starts)
            faults = topology.faults()
            if not faults:
                vertices, faults = normalised_pieces(vertices, topology)
            if not faults:
                surface = Surface.of_topology(vertices, topology, _joined_importance(shapes))
                return _batch(shapes, surface, settings)
            index = list(shapes)
            for piece, error in faults.items():
                k = index[piece]
                if k in self._sorted:
                    error.triangles = self._sorted[k].own_triangles(np.asarray(error.triangles, dtype=int))
                self.errors[k] = error
                del shapes[k]
        return None


def _joined_importance(shapes):
    """That of all triangles, None where all count alike."""
    if all(shape.importance is None for shape in shapes.values()):
        return None
    its = (np.ones(len(each.triangles)) if each.importance is None else each.importance for each in shapes.values())
    return np.concatenate(list(its))


def _batch(shapes, surface, settings):
    n = len(surface.vertices)
    uv, pinned, partner = np.zeros((n, 2)), np.zeros((n, 2), bool), None
    start = np.zeros((n, 2))
    has_uv, has_start = (
        np.array([getattr(shape, name) is not None for shape in shapes.values()]) for name in ("uv", "start")
    )
    ends = np.append(surface.vertex_starts, n)
    for k, shape in enumerate(shapes.values()):
        its = slice(ends[k], ends[k + 1])
        if shape.uv is not None:
            uv[its] = shape.uv
        start[its] = uv[its] if shape.start is None else shape.start
        if shape.pinned is not None:
            pinned[its] = shape.pinned
        if shape.partner is not None:
            if partner is None:
                partner = np.column_stack([np.arange(n), np.arange(n)])
            partner[its] = shape.partner + ends[k]
    mirror = np.ones((len(shapes), 2))
    crossing = np.array([shape.crossing for shape in shapes.values()])
    index = np.array(list(shapes))
    if any(shape.walls is not None for shape in shapes.values()):
        walls = [shape.walls for shape in shapes.values()]
    else:
        walls = None
    batch = Batch(surface, index, uv, has_uv, pinned, partner, mirror, start, has_start, crossing, walls)
    # Where the old UVs hold the new ones and are mirrored, unwrap as seen in a mirror.
    for k in np.flatnonzero(batch.in_frame(settings)):
        its = start[batch.rows_of(k)]
        if enclosed_area(its[outer_loop(surface.one(k), its)]) < 0:
            batch.mirror[k, 0] = -1
    for each in (batch.uv, batch.start):
        each *= mirror[surface.vertex_piece]
    if walls is not None:
        for k, its in enumerate(walls):
            if its is not None:
                one, own = surface.one(k), batch.start[batch.rows_of(k)]
                walls[k] = clear_walls(its * mirror[k], [own[loop] for loop in one.loops])
    return batch


def checked_pins(n: int, pinned: np.ndarray | None) -> np.ndarray | None:
    """Pins as an (n, 2) array of bool, for U and V; raises `PinError`."""
    if pinned is None:
        return None
    pinned = np.asarray(pinned)
    if pinned.shape not in ((n,), (n, 2)) or pinned.dtype != bool:
        raise PinError(f"the pins must be True or False for each of the {n} vertices, or for U and V of each")
    return np.column_stack([pinned, pinned]) if pinned.ndim == 1 else pinned


def checked_importance(m: int, importance: np.ndarray | None) -> np.ndarray | None:
    """The importance of triangles as an array (m,), None where all have the same; raises `ShapeError`."""
    if importance is None:
        return None
    importance = np.asarray(importance, dtype=np.float64)
    if importance.shape != (m,) or not (np.isfinite(importance) & (importance > 0)).all():
        raise ShapeError(f"the importance must be a positive number for each of the {m} triangles")
    return importance if np.ptp(importance) else None
