# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrapping as a session: it goes on step by step, shows how far it is, and can be led."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .air import Triangulator
from .batch import Batched, checked_pins
from .certificate import certified_pieces
from .course import Course
from .delaunay import triangulate as own_triangulate
from .distortion import measure_pieces
from .errors import PinError, UnwrapError, UVError
from .improvement import Steps
from .pieces import parts_of
from .report import Report, Result, Shape, State, face_warnings
from .settings import Settings
from .stepping import STEP

_GO_ON = "set Refine higher, or unwrap it again from the current UVs"


class Unwrapper:
    """Unwraps shapes, together and step by step.

    Parameters
    ----------
    shapes : sequence of `Shape`
    settings : Settings, the same for all
    triangulate : of the plane, for the boundary FREE; by default the core's own, see `air.Triangulator`

    A shape that cannot be unwrapped has its error among the `results`; the others go on.  Raises `SettingsError`
    where the settings exclude each other.
    """

    def __init__(
        self, shapes: Sequence[Shape], settings: Settings | None = None, triangulate: Triangulator | None = None
    ):
        self._settings = settings or Settings()
        self._settings.check_together()
        self._count = len(shapes)
        self._input: Batched | None = Batched(shapes, self._settings)
        self._course: Course | None = None
        self._steps: Steps | None = None
        self._began = False
        if self._input.batch is not None:
            self._course = Course(self._input.batch, self._settings, triangulate or own_triangulate)
            self._steps = self._course.run()

    def step(self) -> bool:
        """Go one step further; returns whether there was anything left to do."""
        return any(part == STEP for part in self.parts())

    def parts(self) -> Iterator[str]:
        """Go on; yields `STEP` after each step, and `PART` within one that takes long."""
        while self._steps is not None:
            self._began = True
            for part in self._steps:
                yield part
                break
            else:
                self._steps = None

    @property
    def settings(self) -> Settings:
        """Settings can be exchanged at any time: the session goes on with them from the map as it is.

        Raises `SettingsError` where they exclude each other.
        """
        return self._settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        settings.check_together()
        self._settings = settings
        self._go_on()

    def move(self, pinned: np.ndarray, uv: np.ndarray, shape: int = 0) -> None:
        """Pin vertices of a shape, (n,) bool or (n, 2) for U and V, where `uv` (n, 2) has them, as seen in its `state`.

        The session goes on from the map as it is.  Raises `PinError`, or `UVError` where UVs are no numbers.
        """
        course, given, k = self._course, self._input, self._piece(shape)
        if course is None or given is None or k is None:
            raise PinError("there is nothing to pin: it is not being unwrapped")
        if self._settings.boundary not in ("FREE", "KEEP"):
            raise PinError("pins need the boundary FREE or KEEP: unpin, or choose one of these")
        batch = course.batch
        its = batch.rows_of(k)
        n = its.stop - its.start
        pins = checked_pins(n, np.asarray(pinned))
        uv = np.asarray(uv, dtype=np.float64)
        if pins is None or uv.shape != (n, 2) or not np.isfinite(uv[pins.any(axis=1)]).all():
            raise UVError(f"the pins need UVs that are numbers, in the shape ({n}, 2)")
        pins, uv = given.sorted(shape, pins), given.sorted(shape, uv)
        if not batch.in_frame(self._settings)[k]:
            # From now on the map is where it is seen.
            shown = self._shown(k)
            for each in (course.now, course.best):
                each[its] = shown
            batch.uv[its], batch.has_uv[k], batch.mirror[k] = shown, True, 1
        course.sure[k] = False
        batch.pinned[its] = pins
        batch.uv[its] = np.where(pins, uv * batch.mirror[k], course.best[its])
        batch.start[its], batch.has_start[k] = batch.uv[its], False
        self._go_on()

    def _go_on(self):
        if self._course is not None:
            if self._steps is not None:
                self._steps.close()
            if self._began:
                self._steps = self._course.resume(self._settings)
            else:
                self._course.settings = self._settings
                self._steps = self._course.run()

    def cancel(self) -> None:
        """Stop for good, and hold nothing back."""
        if self._steps is not None:
            self._steps.close()
        self._steps = self._course = self._input = None

    def state(self, shape: int = 0) -> State | None:
        """The map of a shape as it is now, in the caller's frame, or None if there is none (yet)."""
        course, given, k = self._course, self._input, self._piece(shape)
        if course is None or given is None or k is None or not self._began:
            return None
        changes = course.changes[k]
        return State(
            iteration=len(changes),
            uv=given.restored(shape, self._shown(k) * course.batch.mirror[k]),
            change=changes[-1] if changes else np.inf,
            valid=bool(course.valid[k]),
            converged=bool(course.converged[k]),
            repaired=bool(course.repaired[k]),
        )

    def results(self) -> list[Result | UnwrapError]:
        """For every shape its `Result`, of the best map so far, or the error that it failed with."""
        if self._input is None or (self._course is not None and not self._began):
            raise UnwrapError("there are no results: the session was cancelled, or has not begun")
        found: dict[int, Result | UnwrapError] = dict(self._input.errors)
        if self._course is not None:
            made = self._made(self._course, self._input)
            for k, result in zip(self._course.batch.index.tolist(), made, strict=True):
                found[k] = result if isinstance(result, UnwrapError) else self._input.restored_result(k, result)
        return [found[k] for k in range(self._count)]

    def _piece(self, shape):
        if self._course is None:
            return None
        found = np.flatnonzero(self._course.batch.index == shape)
        return int(found[0]) if len(found) and found[0] not in self._course.faults else None

    def _shown(self, k):
        course = self._course
        its = course.batch.rows_of(k)
        one = course.batch.surface.one(k)
        return course.placed(course.now[its], np.array([k]), one)

    def _made(self, course, given):
        batch, surface = course.batch, course.batch.surface
        chosen = course.placed(course.best)
        before = measure_pieces(surface, batch.start) if batch.has_uv.any() else [None] * surface.piece_count
        after = measure_pieces(surface, chosen)
        certified = course.sure.copy()
        if not certified.all():
            part, rows = surface, np.ones(len(chosen), bool)
            if certified.any():
                part, rows = surface.of(~certified), batch.rows(~certified)
            certified[~certified] = certified_pieces(part, chosen[rows])
        flat = surface.sums(surface.degenerate.astype(int)).tolist()
        ends = np.append(surface.triangle_starts, len(surface.triangles)).tolist()
        uvs = parts_of(chosen * batch.mirror[surface.vertex_piece], surface.vertex_starts)
        loops, has_uv = surface.own_loops, batch.has_uv.tolist()
        its = zip(certified.tolist(), course.converged.tolist(), (batch.mirror[:, 0] < 0).tolist(), strict=True)
        for k, (injective, converged, mirrored) in enumerate(its):
            if k in course.faults:
                yield course.faults[k]
                continue
            warnings = course.warnings[k]
            if course.unfinished[k]:
                steps = course.settings.refine
                warnings += (f"it was still improving after {steps} steps: {_GO_ON}",)
            if flat[k]:
                its = surface.degenerate[ends[k] : ends[k + 1]]
                warnings += face_warnings(its, given.face(int(batch.index[k])))
            report = Report(
                before=before[k] if has_uv[k] else None,
                after=after[k],
                iterations=len(course.changes[k]),
                converged=converged,
                changes=tuple(course.changes[k]),
                injective=injective and not (after[k].flips or after[k].collapsed),
                mirrored=mirrored,
                warnings=warnings,
            )
            yield Result(uvs[k], report, loops[k])
