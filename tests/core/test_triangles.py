# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core import triangles


@pytest.mark.parametrize("at_once", [1, 4, 7, 100])
def test_sums_over_pieces_do_not_depend_on_the_parts_they_are_worked_out_in(monkeypatch, at_once):
    monkeypatch.setattr(triangles, "_AT_ONCE", at_once)
    values = np.random.default_rng(0).normal(size=(2, 20))
    starts = np.array([0, 3, 4, 7, 16])
    sums = triangles.sums_by_parts(lambda part: np.array([*part, part[0] * part[1]]), starts, values)
    whole = np.array([*values, values[0] * values[1]])
    expected = [whole[:, start:stop].sum(axis=1) for start, stop in zip(starts, [*starts[1:], 20], strict=True)]
    np.testing.assert_allclose(sums.T, expected)
