# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory an island takes, and how much there is."""

import ctypes
import sys
from functools import cache

import numpy as np

from .errors import OutOfMemoryError

_PER_VERTEX = 3500  # bytes for each vertex, measured on large islands: up to 1400 for the factors, the rest for arrays
_KEPT = 31 * 2**20  # bytes: glibc keeps up to twice the largest block that it was given back, if that is below 32 MiB


@cache
def keep() -> None:
    """Let glibc keep the memory that a step gives back for the next one, instead of fetching fresh pages every time.

    The block that is given back here has never been written to, so that it takes no memory itself.
    """
    np.empty(_KEPT, np.uint8)


def suffices(vertices: int, free: int | None) -> bool:
    """Whether `free` bytes are enough for islands of so many vertices; True where None says that nobody knows."""
    return free is None or vertices * _PER_VERTEX <= free


def check(vertices: int, free: int | None) -> None:
    """Raise `OutOfMemoryError` where `free` bytes are known not to suffice."""
    if free is not None and not suffices(vertices, free):
        raise OutOfMemoryError(
            f"it needs about {vertices * _PER_VERTEX / 1e9:.1f} GB of memory and {free / 1e9:.1f} GB are free:"
            " mark seams to cut it into smaller islands, or close other programs"
        )


def free() -> int | None:
    """Bytes that programs can still take, None where the system does not say."""
    if sys.platform == "linux":
        return _free_on_linux()
    if sys.platform == "win32":
        return _free_on_windows()
    return None


def _free_on_linux():
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            found = [line.split() for line in lines if line.startswith("MemAvailable:")]
    except OSError:
        return None
    return int(found[0][1]) * 1024 if found else None


class _MemoryStatus(ctypes.Structure):
    _fields_ = [("length", ctypes.c_uint32), ("load", ctypes.c_uint32)] + [
        (name, ctypes.c_uint64)
        for name in ("total", "available", "total_page", "available_page", "total_virtual", "available_virtual", "rest")
    ]


def _free_on_windows():
    status = _MemoryStatus(length=ctypes.sizeof(_MemoryStatus))
    done = ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
    return status.available if done else None
