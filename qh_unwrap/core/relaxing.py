# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxing UVs where they lie: what is held stays to the last bit, and the rest goes to the least distortion."""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np

from .air import Triangulator
from .boundary import crossing_fault
from .certificate import certified_pieces, orientation
from .chart import Surface, numbered_edges
from .distortion import measure
from .energy import energies
from .errors import BorderError, ClosedError, GenusError, UnwrapError, UVError
from .pieces import Pieces
from .placing import in_place, is_mirrored, says_where
from .relax_settings import RelaxSettings, StraightenSettings
from .report import Result, Shape
from .settings import Settings
from .triangles import corners_of
from .unwrapping import unwrap_variously

_HALVINGS = 4  # of the way from a blend that is not valid to the relaxed map, which is
CANNOT = "no map of it without flips was found"


def relax_islands(
    shapes: Sequence[Shape], settings: RelaxSettings | None = None, triangulate: Triangulator | None = None
) -> Generator[float, None, list[Result | UnwrapError]]:
    """Relax the maps of islands, or of parts of islands, with what is pinned in its place.

    Parameters
    ----------
    shapes : with `uv`; `pinned` says what stays, the border of a part as well.  Whatever of a boundary is not pinned
        moves.
    settings : RelaxSettings
    triangulate : as in `unwrap_islands`

    A generator: yields the share that is done, from 0 to 1, and returns for every shape its `Result`, or the error that
    it failed with.  A map that is valid stays so, and has no more energy than before; one with flips is turned right,
    from a new start if need be.  Where nothing is pinned the island keeps its place, size, turn and mirroring.
    """
    settings = settings or RelaxSettings()
    tasks = [_task(shape, settings) for shape in shapes]
    results = yield from _unwrapped(tasks, triangulate)
    return [
        result if isinstance(result, UnwrapError) else _settled(shape, task, result, settings)
        for shape, task, result in zip(shapes, tasks, results, strict=True)
    ]


def straighten_islands(
    shapes: Sequence[Shape], settings: StraightenSettings | None = None, triangulate: Triangulator | None = None
) -> Generator[float, None, list[Result | UnwrapError]]:
    """Bring what is pinned in islands to where `uv` has it, the rest with it and to the least distortion.

    Parameters
    ----------
    shapes : with `uv`, `pinned` and `start`, the maps as they are
    settings : StraightenSettings
    triangulate : as in `unwrap_islands`

    A generator like `relax_islands`.  Where that cannot be had without flips there is an error and no result.
    """
    settings = settings or StraightenSettings()
    made = Settings(balance=settings.balance, refine=settings.steps)
    tasks: list[_Task | UnwrapError] = []
    for shape in shapes:
        flips, flat = _flips(shape.triangles, shape.start), _flattened(shape)
        if flips:
            tasks.append(UVError(f"{_counted(flips)}: relax it first"))
        elif flat:
            faces = "triangle would" if flat == 1 else "triangles would"
            tasks.append(UVError(f"{flat} of its {faces} become flat, with all corners on one line: select less"))
        else:
            tasks.append(_Task(made, shape))
    results = yield from _unwrapped(tasks, triangulate)
    return [
        UVError(f"{CANNOT} that is straight there: select less, or unpin some") if _has_flips(result) else result
        for result in results
    ]


class _Task(NamedTuple):
    """What is to be unwrapped, and how."""

    settings: Settings
    shape: Shape
    mirrored: bool = False  # beforehand, since nothing holds it
    is_loose: bool = False  # nothing holds it, so that it is to be put back in its place


def _flattened(shape):
    """How many triangles have all their corners on a line along U or V where the shape is pinned."""
    pinned, uv = np.asarray(shape.pinned)[shape.triangles], np.asarray(shape.uv)[shape.triangles]
    return int((pinned.all(axis=1) & (uv == uv[:, :1]).all(axis=1)).any(axis=1).sum())


def _has_flips(result):
    return not isinstance(result, UnwrapError) and bool(result.report.after.flips or result.report.after.collapsed)


def _task(shape, settings):
    """The `_Task` for a shape, or the error that it fails with."""
    n, triangles, uv = len(shape.vertices), np.asarray(shape.triangles), np.asarray(shape.uv, dtype=float)
    held = np.zeros((n, 2), bool)
    if shape.pinned is not None:
        held |= np.asarray(shape.pinned).reshape(n, -1)
    flips = _flips(triangles, uv)
    if settings.direction != "BOTH":
        if flips:
            return UVError(f"{_counted(flips)}: relax it in both directions first")
        held[:, "VU".index(settings.direction)] = True
    is_free = not held[rim(triangles, n)].all()
    made = Settings(
        boundary="FREE" if is_free else "KEEP",
        balance=settings.balance,
        refine=settings.steps,
        initial="CURRENT" if is_free and not flips else "AUTO",
    )
    if held.any() or (shape.walls is not None and not flips):
        return _Task(made, dataclasses.replace(shape, uv=uv, pinned=held if held.any() else None, crossing=True))
    mirrored = is_mirrored(corners_of(uv, triangles))
    seen = None if flips else uv * (-1, 1) if mirrored else uv
    return _Task(made, dataclasses.replace(shape, uv=seen, pinned=None, walls=None), mirrored, is_loose=True)


def rim(triangles: np.ndarray, n: int) -> np.ndarray:
    """The vertices on the boundary of triangles (m, 3) with n vertices, (k,)."""
    edges, of = numbered_edges(triangles, n)
    return np.unique(edges[np.bincount(of.ravel(), minlength=len(edges)) == 1])


def _flips(triangles, uv):
    """How many triangles do not follow the winding of most of them."""
    sign = orientation(np.asarray(uv), np.asarray(triangles))
    return int(min((sign <= 0).sum(), (sign >= 0).sum()))


def _counted(flips):
    return f"{flips} of its triangles {'is flipped or has' if flips == 1 else 'are flipped or have'} no area"


def _unwrapped(tasks, triangulate):
    """Carry out those tasks that are no errors; yields the share that is done, returns the results of all."""
    asked = [(task.settings, task.shape) for task in tasks if isinstance(task, _Task)]
    results = iter((yield from unwrap_variously(asked, triangulate)))
    return [_explained(next(results)) if isinstance(task, _Task) else task for task in tasks]


def _explained(result):
    """The result, or its error with a cure that helps here."""
    if isinstance(result, BorderError):
        return UVError(f"{result.fault}: {_CURE}")
    if isinstance(result, ClosedError | GenusError):
        return UVError("its UVs are not cut open anywhere, as a model's have to be: mark seams, and unwrap it first")
    return result


_CURE = "select all of its island, and let its outline move"


def _settled(shape, task, result, settings):
    """The result where the island was, no worse than before, and as far on as the settings want; or an error."""
    surface = Surface(shape.vertices, shape.triangles)
    if _has_flips(result):
        fault = crossing_fault(surface, np.asarray(shape.uv))
        if fault and task.settings.boundary == "KEEP":
            return UVError(f"{fault}: {_CURE}")
        cure = "unpin some" if task.settings.boundary == "FREE" else "let its outline move"
        return UVError(f"{CANNOT} with what is held: {cure}")
    old, uv = np.asarray(shape.uv, dtype=float), result.uv
    corners = corners_of(old, shape.triangles)
    if task.is_loose:
        uv = uv * (-1, 1) if task.mirrored else uv
        if says_where(corners):
            uv = in_place(Pieces([surface.vertices], [surface.triangles]), uv, corners)
    was_valid = _is_valid(surface, old)
    # Where triangles have an importance, the energy that has fallen is another one.
    if was_valid and shape.importance is None and not _gains(surface, old, uv, settings.balance):
        uv = old
    if settings.blend < 1:
        uv = _blended(surface, old, uv, settings.blend, was_valid)
    if uv is result.uv:
        return result
    report = dataclasses.replace(
        result.report,
        before=measure(surface, _upright(surface, old)),
        after=measure(surface, _upright(surface, uv)),
        injective=_is_valid(surface, uv),
        mirrored=is_mirrored(corners_of(uv, shape.triangles)),
    )
    return dataclasses.replace(result, uv=uv, report=report)


def _gains(surface, old, uv, balance):
    """Whether the new map is valid, and the energy is no higher."""
    before, after = (energies(surface, _upright(surface, each), balance)[0] for each in (old, uv))
    return after <= before and _is_valid(surface, uv)


def _is_valid(surface, uv):
    return bool(certified_pieces(surface, _upright(surface, uv))[0])


def _upright(surface, uv):
    """The map, seen in a mirror where it is mirrored."""
    return uv * (-1, 1) if is_mirrored(corners_of(uv, surface.triangles)) else uv


def _blended(surface, old, new, part, was_valid):
    """The map between `old` and `new`, or nearer to the new one where it would not be valid, though both are."""
    for _ in range(_HALVINGS):
        uv = np.where(new == old, old, old + part * (new - old))
        if not was_valid or _is_valid(surface, uv):
            return uv
        part = (part + 1) / 2
    return new
