# SPDX-License-Identifier: GPL-3.0-or-later
"""What the heatmap draws, in the versions of Blender that can draw without a window."""

import os
import subprocess
import sys
from pathlib import Path

import gpu
import numpy as np
import pytest

_HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    if not hasattr(gpu, "init"):
        pytest.skip("this Blender cannot draw without a window")
    path = tmp_path_factory.mktemp("drawn") / "pictures.npz"
    paths = os.pathsep.join(map(str, (_HERE, _HERE.parents[1])))
    environment = os.environ | {"PYTHONPATH": paths}
    command = [sys.executable, str(_HERE / "offscreen.py"), str(path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    if "gpu.init" in done.stderr:
        pytest.skip("there is nothing to draw with on this machine")
    assert path.is_file(), done.stderr
    with np.load(path) as found:
        return dict(found)


def share(picture, colour):
    """Of the pixels, those that have about this colour."""
    return (np.abs(picture.astype(int) - colour).max(axis=2) < 40).mean()


def test_the_map_has_its_colors_and_outlines(pictures):
    found = pictures["map"]
    assert share(found[70:, 70:], (215, 220, 220)) > 0.8  # what has about as many texels as all have together
    assert share(found[2:5, 2:5], (160, 15, 25)) == 1  # the face that is small here
    assert share(found[10:60, 10:60], (64, 64, 64)) == 1  # where that was
    assert share(found[10:60, 65:69], (5, 5, 5)) > 0.2  # an outline


def test_the_model_has_its_colors_and_outlines(pictures):
    found = pictures["model"]
    assert share(found, (64, 64, 64)) > 0.5  # what is beside it
    assert 0.003 < share(found, (150, 5, 20)) < 0.03  # the same face, which is no smaller than others here
    assert 0.003 < share(found, (5, 5, 5)) < 0.1


def test_the_legend_has_a_scale_and_words(pictures):
    found = pictures["legend"]
    assert share(found[:200], (64, 64, 64)) < 0.95 and share(found[200:], (64, 64, 64)) == 1
    assert share(found, (178, 5, 20)) > 0.001 and share(found, (20, 76, 153)) > 0.001
    assert share(found, (235, 235, 235)) > 0.002
