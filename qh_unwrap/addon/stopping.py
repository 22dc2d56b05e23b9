# SPDX-License-Identifier: GPL-3.0-or-later
"""Ending a run from outside, by Ctrl C (SIGINT) or SIGTERM, so that nothing half done is left; needs no Blender."""

import signal
import threading
from contextlib import contextmanager

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stopped(BaseException):
    """The run shall end.  Not an `Exception`, since nobody but the command line may take it for an error."""

    def __init__(self, number):
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.exit_code = 128 + number  # what shells say of a program that a signal ended


class _State:
    listening = False
    held = 0  # how many want to finish what they are at
    number = None  # of the signal that came
    heard = False


_state = _State()


@contextmanager
def stoppable():
    """Raise `Stopped` where a signal comes; the first one counts, and further ones do not disturb the tidying up."""
    if _state.listening or threading.current_thread() is not threading.main_thread():
        yield
        return
    _state.number, _state.heard = None, False
    old = {number: signal.signal(number, _come) for number in _SIGNALS}
    _state.listening = True
    try:
        yield
    finally:
        _state.listening = False
        for number, handler in old.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)  # None: not one of Python's


def _come(number, _frame):
    if _state.number is None:
        _state.number = number
        check()


@contextmanager
def undisturbed():
    """Put a signal off until this is done."""
    hold()
    try:
        yield
    finally:
        release()
    check()


def hold():
    """Put signals off until `release`, for code that has to tidy up whatever else happens."""
    _state.held += 1


def release():
    """Let the next signal come through; one that came meanwhile waits for `check`."""
    _state.held -= 1


def check():
    """Raise `Stopped` if a signal has come, also where Blender made another exception of it on its way."""
    if _state.listening and _state.number is not None and not (_state.held or _state.heard):
        raise Stopped(_state.number)


def heard():
    """Say that the run ends for the signal's sake; from now on it disturbs nobody."""
    _state.heard = True
