# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory an island takes, and how much there is."""

import ctypes
import sys

from .errors import OutOfMemoryError

_PER_VERTEX = 3500  # bytes, measured on large islands: the factors take up to 1.4 kB of them, arrays the rest


def suffices(vertices, free):
    """Whether the `free` bytes, None if these are not known, are enough for an island of so many vertices."""
    return free is None or vertices * _PER_VERTEX <= free


def check(vertices, free):
    """Raise `OutOfMemoryError` if they are not."""
    if not suffices(vertices, free):
        raise OutOfMemoryError(
            f"it needs about {vertices * _PER_VERTEX / 1e9:.1f} GB of memory and {free / 1e9:.1f} GB are free:"
            " mark seams to cut it into smaller islands, or close other programs"
        )


def free():
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
