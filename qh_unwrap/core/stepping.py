# SPDX-License-Identifier: GPL-3.0-or-later
"""Work that is done in steps: generators that yield how far they are, and return a result."""


def finished(steps):
    """Take all steps; returns the result."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def mapped(function, steps):
    """The same steps, of which each yields what `function` makes of it."""
    while True:
        try:
            step = next(steps)
        except StopIteration as stop:
            return stop.value
        yield function(step)
