# SPDX-License-Identifier: GPL-3.0-or-later
"""The standard streams, into which Blender prints as well; needs no Blender."""

import ctypes
import os
import re
import sys
import tempfile
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout, suppress
from functools import cache

from . import stopping

_MATTERS = re.compile(r"warning|error", re.IGNORECASE)


@contextmanager
def quiet(errors=False):
    """Keep what Blender prints from the standard output, which is for the table alone.

    errors   keep it from the standard error, too; warnings and errors among it follow later, unless there is an
             exception, which says it better
    """
    open_standard_streams()
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # Blender prints through a buffer of C, too
    with ExitStack() as stack:
        nowhere = stack.enter_context(open(os.devnull, "w"))
        later = stack.enter_context(tempfile.TemporaryFile("w+", errors="replace")) if errors else None
        with _redirected(library, 1, nowhere), redirect_stdout(nowhere):
            if later is None:
                yield
                return
            with _redirected(library, 2, later), redirect_stderr(_stream_2()):
                yield
        stopping.check()  # what Blender may have printed as an error of a handler
        later.seek(0)
        with suppress(OSError, ValueError):  # of a stream that is closed
            for line in later:
                if sys.stderr is not None and _MATTERS.search(line):
                    sys.stderr.write(line)


@cache
def _stream_2():
    """Python's way to stream 2, wherever that leads.  It stays open, since loggers of Blender's exporters keep it."""
    return open(2, "w", buffering=1, errors="backslashreplace", closefd=False)


def open_standard_streams():
    """Lead the standard streams that are closed to nowhere, lest a file that is opened later takes the place of one."""
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(handle)


@contextmanager
def _redirected(library, number, file):
    """Lead stream 1 or 2 to a file."""
    with stopping.undisturbed():
        library.fflush(None)
        saved = os.dup(number)
        os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        stopping.hold()
        library.fflush(None)
        os.dup2(saved, number)
        os.close(saved)
        stopping.release()
