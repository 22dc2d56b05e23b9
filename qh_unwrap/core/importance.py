# SPDX-License-Identifier: GPL-3.0-or-later
"""Importance: regions that shall get more room in the map, and how far they have it.

Shapes at rest that are scaled by the root of their importance no longer fit together, so that a map gives the regions
less room than they want, or more where they bulge.  Then they have to ask for another power of it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import replace

import numpy as np

from .errors import UnwrapError
from .report import Result, Shape
from .settings import Settings
from .stepping import mapped
from .triangles import areas_in_space, corners_of, signed_areas

_NEAR = 0.05  # logarithm of a ratio of areas up to which it is as it is to be
_ROUNDS = 3  # other powers that are tried at most
_POWERS = 0.2, 4.0  # the least and the most

Results = list[Result | UnwrapError]
Unwrap = Callable[[Sequence[Shape], Settings], Generator[float, None, Results]]


def corrected(
    shapes: Sequence[Shape], results: Results, settings: Settings, unwrap: Unwrap
) -> Generator[float, None, Results]:
    """Results in which the important regions of shapes have the room that they want, as far as that can be.

    `unwrap` unwraps shapes anew.  A generator that yields the share that is done, from 0 to 1.
    """
    best = list(results)
    power = {k: 1.0 for k, shape in enumerate(shapes) if is_uneven(shape)}
    missing = {k: _missing(shapes[k], results[k]) for k in power}
    latest = dict(missing)
    for number in range(_ROUNDS):
        todo = [k for k, its in latest.items() if abs(its) > _NEAR]
        last, latest = latest, {}
        for k in todo:
            power[k] = float(np.clip(power[k] + last[k] / _wanted(shapes[k]), *_POWERS))
        for goes_on in (True, False):
            some = [k for k in todo if _can_go_on(shapes[k], best[k], settings) == goes_on]
            if not some:
                continue
            again = [_with(shapes[k], power[k], best[k] if goes_on else None) for k in some]
            steps = unwrap(again, replace(settings, initial="CURRENT", iterations=0) if goes_on else settings)
            found = yield from mapped(_part(number), steps)
            for k, result in zip(some, found, strict=True):
                old = best[k]
                if isinstance(result, UnwrapError) or isinstance(old, UnwrapError):
                    continue
                if old.report.injective and not result.report.injective:
                    continue
                latest[k] = _missing(shapes[k], result)
                if abs(latest[k]) < abs(missing[k]):
                    best[k] = _as_one_run(old, result) if goes_on else result
                    missing[k] = latest[k]
    return best


def _can_go_on(shape, result, settings):
    """Whether the map so far is a start for the next one: a valid one that nothing holds."""
    held = any(each is not None and np.any(each) for each in (shape.pinned, shape.partner))
    return settings.boundary == "FREE" and settings.refine > 0 and not held and result.report.injective


def _with(shape, power, start):
    """The shape with that power of its importance, and the map that it begins with, if it is to have one."""
    importance = np.asarray(shape.importance) ** power
    return replace(shape, importance=importance, uv=shape.uv if start is None else start.uv)


def _as_one_run(old, result):
    """The result with what there was before the run that it went on from."""
    first, last = old.report, result.report
    report = replace(
        last,
        before=first.before,
        iterations=first.iterations + last.iterations,
        changes=first.changes + last.changes,
    )
    return replace(result, report=report)


def is_uneven(shape: Shape) -> bool:
    """Whether some of its triangles are more important than others; also where the values are no good."""
    return shape.importance is not None and bool(np.ptp(shape.importance) != 0)


def _part(number):
    return lambda share: (number + share) / _ROUNDS


def _missing(shape, result):
    """The logarithm of what the more important half lacks in area beside the other, 0 where nothing can be said."""
    if isinstance(result, UnwrapError):
        return 0.0
    in_map = np.abs(signed_areas(corners_of(result.uv, np.asarray(shape.triangles))))
    has = _ratio(shape, in_map)
    return _wanted(shape) - has if np.isfinite(has) else 0.0


def _wanted(shape):
    """The logarithm of the ratio that the areas of both halves are to have, by their areas in space."""
    return _ratio(shape, _areas(shape) * shape.importance)


def _ratio(shape, area):
    """The logarithm of the ratio of areas (m,), by those in space, of the more important half by the other one."""
    level = np.log(shape.importance)
    more = level > (level.min() + level.max()) / 2
    in_space = _areas(shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.log(area[more].sum() / in_space[more].sum() / (area[~more].sum() / in_space[~more].sum())))


def _areas(shape):
    return areas_in_space(np.asarray(shape.vertices, dtype=np.float64), np.asarray(shape.triangles))
