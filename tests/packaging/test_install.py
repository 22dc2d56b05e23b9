# SPDX-License-Identifier: GPL-3.0-or-later
import os
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.packaging

_SCRIPT = Path(__file__).with_name("install_and_unwrap.py")


@pytest.mark.parametrize(
    "label, python, packages",
    [
        ("blender4.2", "3.11", ["bpy==4.2.0", "numpy==1.24.3"]),  # the NumPy of the official build
        ("blender4.2", "3.11", ["bpy==4.2.23", "numpy==1.24.3"]),
        ("blender4.2", "3.11", ["bpy==4.5.15"]),
        ("blender5.1", "3.13", ["bpy==5.2.3"]),
    ],
    ids=["4.2.0", "4.2.23", "4.5.15", "5.2.3"],
)
def test_installs_and_unwraps_where_there_is_no_scipy(zips, blender, tmp_path, label, python, packages):
    done = _run(blender(python, *packages), zips, label, tmp_path)
    assert not done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(
    "label, python, packages",
    [("blender5.1", "3.11", ["bpy==4.5.15"]), ("blender4.2", "3.13", ["bpy==5.2.3"])],
    ids=["4.5.15", "5.2.3"],
)
def test_other_blenders_refuse_it(zips, blender, tmp_path, label, python, packages):
    done = _run(blender(python, *packages), zips, label, tmp_path)
    assert done.returncode and "This Blender version" in done.stdout + done.stderr


def _run(interpreter, zips, label, folder):
    (path,) = zips.glob(f"*-{label}-linux-x64.zip")
    return subprocess.run(
        [interpreter, _SCRIPT, path],
        env=os.environ | {"BLENDER_USER_RESOURCES": str(folder)},
        capture_output=True,
        text=True,
        timeout=180,
    )
