# SPDX-License-Identifier: GPL-3.0-or-later
"""One thread for small matrices.

SciPy's OpenBLAS wakes all its threads even for some matrices of a few dozen rows, and waits for them.  That gains
nothing, and where the processor is busy with something else it takes a hundred times as long as the work itself.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import scipy


@cache
def _openblas() -> ctypes.CDLL | None:
    """The library that SciPy's packages bring along, which is loaded already; None where SciPy has another."""
    package = Path(scipy.__file__).parent
    for folder in (package.parent / "scipy.libs", package / ".dylibs"):
        for path in sorted(folder.glob("libscipy_openblas*")):
            try:
                library = ctypes.CDLL(str(path))
                library.scipy_openblas_set_num_threads(library.scipy_openblas_get_num_threads())
            except (OSError, AttributeError):
                continue
            return library
    return None


def is_known() -> bool:
    """Whether the number of threads can be told."""
    return _openblas() is not None


@contextmanager
def one_thread() -> Iterator[None]:
    """LAPACK, as SciPy has it, keeps to one thread meanwhile, if that can be told to it."""
    library = _openblas()
    before = 1 if library is None else library.scipy_openblas_get_num_threads()
    if library is None or before == 1:
        yield
        return
    library.scipy_openblas_set_num_threads(1)
    try:
        yield
    finally:
        library.scipy_openblas_set_num_threads(before)
