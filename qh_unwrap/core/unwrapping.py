# SPDX-License-Identifier: GPL-3.0-or-later
"""From surfaces and settings to UVs and a report of them: one island or thousands."""

from __future__ import annotations

import traceback
from collections.abc import Generator, Sequence
from itertools import chain

import numpy as np

from . import memory
from .air import Triangulator
from .errors import InternalError, OutOfMemoryError, UnwrapError
from .importance import corrected, is_uneven
from .report import Result, Shape, State
from .session import Unwrapper
from .settings import Settings
from .stepping import PART, STEP, mapped

_TOGETHER = 5000  # triangles of the largest island that goes together with others
_AT_ONCE = 60_000  # triangles of islands that go together
_FIXED = 300  # triangles that take as long as what an island takes whatever its size
_LEFT = 0.75  # of an island after each step, by and large,
_LEFT_OF_PART = 0.95  # and after a part of one


def unwrap(
    vertices: np.ndarray,
    triangles: np.ndarray,
    settings: Settings | None = None,
    uv: np.ndarray | None = None,
    pinned: np.ndarray | None = None,
    triangulate: Triangulator | None = None,
) -> Result:
    """Unwrap a surface.

    Parameters
    ----------
    vertices, triangles, uv, pinned : as in `Shape`
    settings : Settings
    triangulate : of the plane, for the boundary FREE; by default the core's own, see `air.Triangulator`

    Returns a `Result`: `.uv` (n, 2), within the unit square or, where `uv` holds anything, in its frame, and
    `.report`.  Raises a subclass of `UnwrapError`.
    """
    session = Unwrapper([Shape(vertices, triangles, uv, pinned)], settings, triangulate)
    while session.step():
        pass
    return _only_result(session)


def unwrap_steps(
    vertices: np.ndarray,
    triangles: np.ndarray,
    settings: Settings | None = None,
    uv: np.ndarray | None = None,
    pinned: np.ndarray | None = None,
    triangulate: Triangulator | None = None,
) -> Generator[State, None, Result]:
    """Like `unwrap`, as a generator: yields the initial `State` and that after each step, returns the `Result`."""
    session = Unwrapper([Shape(vertices, triangles, uv, pinned)], settings, triangulate)
    while session.step():
        state = session.state()
        if state is not None:
            yield state
    return _only_result(session)


def _only_result(session):
    (result,) = session.results()
    if isinstance(result, UnwrapError):
        raise result
    return result


def unwrap_islands(
    shapes: Sequence[Shape], settings: Settings | None = None, triangulate: Triangulator | None = None
) -> Generator[float, None, list[Result | UnwrapError]]:
    """Unwrap many islands; what becomes of one does not depend on the others.

    A generator: yields the share that is done, from 0 to 1, and returns for every shape its `Result`, or the error that
    it failed with.  Raises `SettingsError` where the settings exclude each other.
    """
    settings = settings or Settings()
    settings.check_together()
    if not any(map(is_uneven, shapes)):
        return (yield from _unwrapped(shapes, settings, triangulate))
    results = yield from mapped(lambda share: share / 2, _unwrapped(shapes, settings, triangulate))

    def again(some: Sequence[Shape], its_settings: Settings) -> Generator[float, None, list[Result | UnwrapError]]:
        return _unwrapped(some, its_settings, triangulate)

    return (yield from mapped(lambda share: (1 + share) / 2, corrected(shapes, results, settings, again)))


def _unwrapped(shapes, settings, triangulate):
    found: dict[int, Result | UnwrapError] = {}
    work = [_FIXED + _size(shape) for shape in shapes]
    done, furthest, total = 0.0, 0.0, max(sum(work), 1)
    waiting = _portions(shapes)[::-1]
    memory.keep()
    while waiting:
        portion = waiting.pop()
        its_work = sum(work[k] for k in portion) / total
        try:
            memory.check(sum(len(shapes[k].vertices) for k in portion), memory.free())
            session = Unwrapper([shapes[k] for k in portion], settings, triangulate)
            left = 1.0
            for part in chain([PART], session.parts()):
                left *= _LEFT if part == STEP else _LEFT_OF_PART
                furthest = max(furthest, done + its_work * (1 - left))  # what is taken apart begins anew
                yield furthest
            results = session.results()
        except Exception as error:
            if len(portion) > 1:  # find out whose fault it is
                half = len(portion) // 2
                waiting += [portion[half:], portion[:half]]
                continue
            results = [_reported(error)]
        found.update(zip(portion, results, strict=True))
        done += its_work
        yield max(furthest, done)
    return [found[k] for k in range(len(shapes))]


def unwrap_variously(
    asked: Sequence[tuple[Settings, Shape]], triangulate: Triangulator | None = None
) -> Generator[float, None, list[Result | UnwrapError]]:
    """The same of islands with settings of their own; all of the same settings go together."""
    found: dict[int, Result | UnwrapError] = {}
    groups: dict[Settings, list[int]] = {}
    for k, (settings, _) in enumerate(asked):
        groups.setdefault(settings, []).append(k)
    for settings, group in groups.items():

        def overall(share: float, before: int = len(found), its: int = len(group)) -> float:
            return (before + its * share) / len(asked)

        steps = unwrap_islands([asked[k][1] for k in group], settings, triangulate)
        results = yield from mapped(overall, steps)
        found.update(zip(group, results, strict=True))
    return [found[k] for k in range(len(asked))]


def _portions(shapes):
    """Which shapes go together, lists of their numbers: the small ones, and every large one on its own."""
    portions, together, size = [], [], 0
    for k, shape in enumerate(shapes):
        its = _size(shape)
        if its > _TOGETHER:
            portions.append([k])
            continue
        if together and size + its > _AT_ONCE:
            portions.append(together)
            together, size = [], 0
        together.append(k)
        size += its
    return [*portions, together] if together else portions


def _size(shape):
    return len(shape.triangles) if hasattr(shape.triangles, "__len__") else 0


def _reported(error):
    """What is said of an island that failed with any exception."""
    if isinstance(error, UnwrapError):
        return error
    if isinstance(error, MemoryError):
        return OutOfMemoryError("the memory ran out: mark seams to cut it into smaller islands")
    traceback.print_exception(error)
    return InternalError(f"it could not be unwrapped ({type(error).__name__}: {error}): please report this")
