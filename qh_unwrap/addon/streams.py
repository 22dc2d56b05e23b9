# SPDX-License-Identifier: GPL-3.0-or-later
"""The standard streams, into which Blender prints as well; needs no Blender."""

import ctypes
import os
import re
import tempfile
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from functools import cache

from . import stopping

_WARNING = re.compile(
    r"""^(?:[\d:.]+\s+)?(?:[\w.]+\s+)?(?:\|\s*)?  # when, and who, in some versions of Blender and of its add-ons
    (?:WARN(?:ING)?|Warning|ERROR|\w*Error|(?=Cannot\ load))(?:\ \([\w.]+\))?:?\s*
    (?:in\ \w+\ at\ line\ \d+\ of\ \S+\ --\ |\S+:\d+\ \w+:\ )?  # where in the source
    (?P<text>.+)""",
    re.VERBOSE,
)
_OF_THE_PLACE = re.compile("Draco|MeshOptimizer|CUEW|HIPEW")  # libraries that may be missing, and are not needed


@contextmanager
def quiet(told=None):
    """Keep what Blender prints from the standard output, which is for the table alone.

    told     a list: keep it from the standard error, too, and append the warnings and errors among it, each once; not
             if there is an exception, which says it better
    """
    open_standard_streams()
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # Blender prints through a buffer of C, too
    with ExitStack() as stack:
        if told is None:
            nowhere = stack.enter_context(open(os.devnull, "w"))
            with _redirected(library, 1, nowhere), redirect_stdout(nowhere):
                yield
            return
        said = [stack.enter_context(_scratch()) for _ in range(2)]
        with (
            _redirected(library, 1, said[0]),
            _redirected(library, 2, said[1]),
            redirect_stdout(_stream_2()),
            redirect_stderr(_stream_2()),
        ):
            yield
        stopping.check()  # what Blender may have printed as an error of a handler
        for file in said:
            file.seek(0)
        told += warnings(line for file in said for line in file)


def _scratch():
    """A file without a name: in memory, if the system has such, since Pixar's library aborts if it cannot say that the
    disk is full."""
    if hasattr(os, "memfd_create"):
        return open(os.memfd_create("said"), "w+", errors="replace")
    return tempfile.TemporaryFile("w+", errors="replace")


def warnings(lines):
    """What the lines warn of, each once, without when and where that was found."""
    found = [match["text"].strip() for match in map(_WARNING.match, lines) if match]
    return list(dict.fromkeys(text for text in found if not _OF_THE_PLACE.search(text)))


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
