# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrapping the chosen faces of objects: read, split into islands, unwrap each, place, write."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core import Distortion, UnwrapError, distortion, unwrap_steps
from ..core.errors import UVError
from ..core.islands import Island, find_islands
from . import mesh_arrays, placing
from .delaunay import triangulate
from .selection import Target


@dataclass
class Outcome:
    """What became of one island: its numbers, or the error that it failed with."""

    obj: str
    number: int
    faces: int
    area: float = 0.0
    before: Distortion | None = None
    after: Distortion | None = None  # of the UVs that Blender stores
    iterations: int = 0
    converged: bool = False
    warnings: tuple[str, ...] = ()
    error: str = ""

    @property
    def label(self):
        return f"{self.obj}, island {self.number} ({count(self.faces, 'face')})"

    def to_dict(self):
        """JSON-ready."""
        values = dict(object=self.obj, island=self.number, faces=self.faces)
        if self.error:
            return values | dict(error=self.error)
        return values | dict(
            before=self.before and self.before.to_dict(),
            after=self.after.to_dict(),
            iterations=self.iterations,
            converged=self.converged,
            warnings=list(self.warnings),
        )


@dataclass
class _Work:
    """One island on its way through."""

    target: Target
    mesh: mesh_arrays.MeshArrays
    island: Island
    outcome: Outcome
    uv: np.ndarray | None = None  # (n, 2) the new ones
    mirrored: bool = False

    @cached_property
    def old_uv(self):
        """(n, 2), None if there is no map or nothing in it; where the map is cut, of one of the corners."""
        if self.mesh.uv is None:
            return None
        corner_uv = self.mesh.uv[self.island.corners]
        if not np.isfinite(corner_uv).all() or not np.ptp(corner_uv, axis=0).any():
            return None
        uv = np.empty((len(self.island.vertices), 2))
        uv[self.island.corner_vertex] = corner_uv
        return uv

    @property
    def vertices(self):
        return self.mesh.vertices[self.island.vertices]

    @property
    def corner_uv(self):
        """The new UVs (c, 2) of its corners; where a vertex stayed, its corners stay to the last bit."""
        uv = self.uv[self.island.corner_vertex]
        if self.old_uv is not None and not self.is_cut:
            stayed = (self.uv == self.old_uv).all(axis=1)[self.island.corner_vertex]
            uv[stayed] = self.mesh.uv[self.island.corners[stayed]]
        return uv

    @property
    def is_cut(self):
        """Whether the old UVs have cuts where there is no seam."""
        gap = self.old_uv[self.island.corner_vertex] - self.mesh.uv[self.island.corners]
        return np.abs(gap).max() > 1e-5 * np.ptp(self.old_uv, axis=0).max()

    @property
    def pinned(self):
        pinned = np.zeros(len(self.island.vertices), dtype=bool)
        pinned[self.island.corner_vertex[self.mesh.pinned[self.island.corners]]] = True
        return pinned if pinned.any() else None


def unwrap_targets(targets, settings, placement, context):
    """Unwrap the targets' faces.  A generator: yields (iterations done, iterations at most), returns the outcomes.

    An island that fails is left as it was, and its outcome says why; nothing is written before all are done.
    """
    works = []
    for target in targets:
        mesh = mesh_arrays.read(target.obj)
        islands = find_islands(
            mesh.corner_vertex, mesh.corner_edge, mesh.face_start, mesh.seam, target.faces, mesh.corner_triangles
        )
        for number, island in enumerate(islands, start=1):
            works.append(_Work(target, mesh, island, Outcome(target.obj.name, number, len(island.faces))))

    rounds = settings.iterations + 1
    for done, work in enumerate(works):
        yield done * rounds, len(works) * rounds
        try:
            steps = _unwrap(work, settings)
            for iteration in steps:
                yield done * rounds + iteration, len(works) * rounds
        except UnwrapError as error:
            work.outcome.error = str(error)

    _place([work for work in works if work.uv is not None], settings, placement, context)
    placed = [work for work in works if work.uv is not None]
    if placed:
        with mesh_arrays.in_object_mode(context):
            for obj, group in itertools.groupby(placed, key=lambda work: work.target.obj):
                _write(obj, list(group))
    return [work.outcome for work in works]


def _unwrap(work, settings):
    uv = work.old_uv
    if uv is not None and work.is_cut:
        if settings.boundary == "KEEP" or settings.initial == "CURRENT":
            raise UVError("its UVs are cut where there is no seam; mark the cuts with UV > Seams from Islands")
        uv = None
    steps = unwrap_steps(work.vertices, work.island.triangles, settings, uv=uv, pinned=work.pinned, triangulate=triangulate)
    result = yield from _iterations(steps)
    work.uv = result.uv
    work.outcome.before = result.report.before
    work.outcome.iterations = result.report.iterations
    work.outcome.converged = result.report.converged
    work.outcome.warnings = tuple(result.report.warnings)
    work.mirrored = result.report.mirrored


def _iterations(steps):
    while True:
        try:
            state = next(steps)
        except StopIteration as stop:
            return stop.value
        yield state.iteration


def _place(works, settings, placement, context):
    if settings.boundary == "KEEP":
        return
    loose = []
    for work in works:
        old = None if work.mesh.uv is None else work.mesh.uv[work.island.triangle_corners]
        if placement.placement == "UNIT":
            work.uv = placing.in_unit_square(work.uv)
        elif placement.placement == "ORIGINAL" and old is not None and placing.says_where(old):
            work.uv = placing.in_place(work.uv, work.island.triangles, old)
        else:
            loose.append(work)
    if not loose:
        return
    try:
        islands = [(work.vertices, work.island.triangles, work.uv) for work in loose]
        packed = placing.pack(islands, placement.margin, context)
    except UnwrapError as error:
        packed = [None] * len(loose)
        for work in loose:
            work.outcome.error = str(error)
    for work, uv in zip(loose, packed, strict=True):
        work.uv = uv


def _write(obj, works):
    corners = np.concatenate([work.island.corners for work in works])
    uv = np.concatenate([work.corner_uv for work in works])
    try:
        mesh_arrays.write(obj, corners, uv)
    except UnwrapError as error:
        for work in works:
            work.outcome.error = str(error)
        return
    for work in works:
        seen = work.uv * (-1, 1) if work.mirrored else work.uv
        work.outcome.after = distortion(work.vertices, work.island.triangles, seen)
        work.outcome.area = _area(work.vertices, work.island.triangles)


def _area(vertices, triangles):
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def summary(outcomes):
    """What happened in one line: "3 islands, stretch 1.310 → 1.090, no flips; 1 skipped: ..."."""
    done = [outcome for outcome in outcomes if not outcome.error]
    failed = [outcome for outcome in outcomes if outcome.error]
    parts = []
    if done:
        stretch = _shown(_mean(done, [outcome.after.l2_stretch for outcome in done]))
        if all(outcome.before for outcome in done):
            before = _shown(_mean(done, [outcome.before.l2_stretch for outcome in done]))
            stretch = f"{before} → {stretch}"
        flips = sum(outcome.after.flips for outcome in done)
        parts.append(f"{count(len(done), 'island')}, stretch {stretch}, {count(flips, 'flip')}")
    if failed:
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        first = f"{failed[0].label}: {failed[0].error}{more}"
        parts.append(f"{len(failed)} skipped: {first}" if done else first)
    return "; ".join(parts)


def change(before, after, name):
    """One measure of a `Distortion` before, if there was one, and after: "1.310 → 1.090"."""
    new = _shown(getattr(after, name))
    return f"{_shown(getattr(before, name))} → {new}" if before else new


def count(number, noun):
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _shown(value):
    return f"{value:.3f}" if value < 1e4 else f"{value:.1e}"


def _mean(outcomes, values):
    """Mean over the surface."""
    return np.average(values, weights=[outcome.area for outcome in outcomes])
