# SPDX-License-Identifier: GPL-3.0-or-later
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CACHE = Path(os.environ.get("QH_PACKAGING_CACHE", "~/.cache/qh_unwrap")).expanduser()


@pytest.fixture(scope="session", autouse=True)
def _asked_for():
    if not os.environ.get("QH_PACKAGING"):
        pytest.skip("takes minutes and downloads Blenders and wheels: set QH_PACKAGING=1")


@pytest.fixture(scope="session")
def build():
    """`build(folder, *options, root=ROOT)` runs the build of a checkout; returns the finished process."""

    def run(folder, *options, root=ROOT):
        command = [sys.executable, root / ".ci/build.py", "--out", folder, "--cache", CACHE, *options]
        return subprocess.run(command, capture_output=True, text=True)

    return run


@pytest.fixture(scope="session")
def zips(build, tmp_path_factory):
    """The folder with all zips."""
    folder = tmp_path_factory.mktemp("zips")
    done = build(folder)
    assert not done.returncode, done.stderr
    return folder


@pytest.fixture(scope="session")
def blender():
    """`blender(python, *packages)` is the interpreter of a kept environment with these packages and no SciPy."""

    def environment(python, *packages):
        folder = CACHE / "environments" / "-".join(packages)
        complete = folder / "complete"
        if not complete.exists():
            subprocess.run([_interpreter(python), "-m", "venv", "--clear", folder], check=True)
            subprocess.run([folder / "bin/python", "-m", "pip", "install", "--quiet", *packages], check=True)
            complete.touch()
        return folder / "bin/python"

    return environment


def _interpreter(version):
    pyenv = Path(os.environ.get("PYENV_ROOT", "~/.pyenv")).expanduser()
    found = [*pyenv.glob(f"versions/{version}.*/bin/python"), shutil.which(f"python{version}")]
    assert found[0], f"needs Python {version}"
    return found[0]
