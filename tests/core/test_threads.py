# SPDX-License-Identifier: GPL-3.0-or-later
import ctypes

import numpy as np
import pytest

from qh_unwrap.core import Surface, bands, threads

from . import shapes
from .test_bands import narrow_pieces


def test_one_thread_is_used_meanwhile_and_as_many_as_before_afterwards():
    library = threads._openblas()
    if library is None:
        pytest.skip("SciPy has another library here")
    before = library.scipy_openblas_get_num_threads()
    try:
        for count in (2, 1):
            library.scipy_openblas_set_num_threads(count)
            with threads.one_thread():
                assert library.scipy_openblas_get_num_threads() == 1
            assert library.scipy_openblas_get_num_threads() == count
        with pytest.raises(ZeroDivisionError), threads.one_thread():
            raise ZeroDivisionError
        library.scipy_openblas_set_num_threads(2)
        with pytest.raises(bands.IndefiniteError):
            bands._Bands(np.zeros(1, int), np.zeros(1, int), np.zeros(1, int), bands._SYMMETRIC, 0).factorized(
                -np.ones(1)
            )
        assert library.scipy_openblas_get_num_threads() == 2
    finally:
        library.scipy_openblas_set_num_threads(before)


@pytest.mark.parametrize("raised", [OSError, AttributeError])
def test_with_another_library_only_what_needs_no_threads_is_a_band(monkeypatch, raised):
    def load(_path):
        raise raised

    def is_narrow(surface):
        return narrow_pieces(surface).all()

    wide, row = Surface(*shapes.grid(30, 30)), Surface(*shapes.grid(1, 40))
    assert is_narrow(wide) and is_narrow(row)
    monkeypatch.setattr(ctypes, "CDLL", load)
    threads._openblas.cache_clear()
    try:
        assert not threads.is_known()
        assert not is_narrow(wide) and is_narrow(row)
        with threads.one_thread():
            pass
    finally:
        monkeypatch.undo()
        threads._openblas.cache_clear()
