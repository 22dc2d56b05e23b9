# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that is done in steps: generators that yield how far they are, and return a result."""

from collections.abc import Callable, Generator
from typing import Any, TypeVar

STEP, PART = "step", "part"  # what is yielded after a step, and within one, so that whoever waits can be heard

_Step = TypeVar("_Step")
_Mapped = TypeVar("_Mapped")
_Result = TypeVar("_Result")


def finished(steps: Generator[Any, None, _Result]) -> _Result:
    """The result of the steps, all of which are taken."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def mapped(
    function: Callable[[_Step], _Mapped], steps: Generator[_Step, None, _Result]
) -> Generator[_Mapped, None, _Result]:
    """The same steps with the same result, but each yields what `function` makes of what it yielded."""
    while True:
        try:
            step = next(steps)
        except StopIteration as stop:
            return stop.value
        yield function(step)
