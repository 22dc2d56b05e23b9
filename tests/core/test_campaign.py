# SPDX-License-Identifier: GPL-3.0-or-later
"""A small part of `tests.benchmarks.campaign_free`: certified means that an independent checker finds nothing."""

import numpy as np
import pytest

from ..benchmarks.campaign_free import overlapping, together, unwrapped
from .patches import Patches

PATCHES = 120
OVERLAPS = 60


@pytest.fixture(scope="module")
def patches():
    return Patches()


def test_certified_maps_of_random_patches_are_clean(patches):
    cases = [unwrapped(patches, seed, largest=600) for seed in range(10_000, 10_000 + PATCHES)]
    assert all(np.isfinite(case.uv).all() for case in cases)
    assert not [case for case in cases if case.certified and not case.clean]
    assert not [case for case in cases if case.clean and not case.certified]
    assert not [case for case in cases if not case.certified]
    joined = together(cases)
    assert len(joined) > PATCHES / 2 and all(case.certified and case.clean for case in joined)


def test_maps_that_overlap_are_not_certified(patches):
    cases = [overlapping(patches, seed, largest=200) for seed in range(10_000, 10_000 + OVERLAPS)]
    assert all(np.isfinite(case.uv).all() for case in cases)
    overlap = [case for case in cases if not case.clean]
    assert len(overlap) > OVERLAPS / 2
    assert not any(case.certified for case in overlap)
