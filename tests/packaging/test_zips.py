# SPDX-License-Identifier: GPL-3.0-or-later
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bpy
import pytest
from packaging.requirements import Requirement

pytestmark = pytest.mark.packaging

_ROOT = Path(__file__).parents[2]
_RELEASES = {
    "blender4.2": dict(
        python="cp311",
        scipy="1.15.3",
        version="0.1.0",
        blender=("4.2.0", "5.1.0"),
        numpy=["1.24.3", "1.26.4"],  # what those Blenders ship
        platforms=["windows-x64", "macos-x64", "macos-arm64", "linux-x64"],
    ),
    "blender5.1": dict(
        python="cp313",
        scipy="1.18.1",
        version="0.1.1",
        blender=("5.1.0", None),
        numpy=["2.2.0", "2.5.5"],
        platforms=["windows-x64", "windows-arm64", "macos-arm64", "linux-x64"],
    ),
}
_WHEEL_PLATFORMS = {
    "windows-x64": r"win_amd64",
    "windows-arm64": r"win_arm64",
    "macos-x64": r"macosx_10_\d+_x86_64",
    "macos-arm64": r"macosx_12_0_arm64",
    "linux-x64": r"manylinux_2_(17|27)_x86_64\..*",
}
_ZIPS = {
    f"qh_unwrap-{release['version']}-{label}-{platform}.zip": (release, platform)
    for label, release in _RELEASES.items()
    for platform in release["platforms"]
}


def test_one_zip_for_each_platform_and_python(zips):
    assert {path.name for path in zips.iterdir()} == _ZIPS.keys()


@pytest.mark.parametrize("name", _ZIPS)
def test_zip_holds_the_extension_and_one_wheel(zips, name):
    release, platform = _ZIPS[name]
    with zipfile.ZipFile(zips / name) as archive:
        names = archive.namelist()
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    tracked = subprocess.run(["git", "ls-files", "qh_unwrap"], cwd=_ROOT, capture_output=True, text=True, check=True)
    sources = {"blender_manifest.toml", "__init__.py", "LICENSE", "README.md", *tracked.stdout.split()}
    (wheel,) = set(names) - sources
    assert sources < set(names) and len(names) == len(set(names))
    pattern = rf"wheels/scipy-{release['scipy']}-{release['python']}-{release['python']}-{_WHEEL_PLATFORMS[platform]}"
    assert re.fullmatch(pattern + r"\.whl", wheel)
    assert manifest["wheels"] == [f"./{wheel}"]
    assert not [name for name in names if re.search(r"__pycache__|\.pyc|tests|egg-info|\.zip|/\.|^\.", name)]


@pytest.mark.parametrize("name", _ZIPS)
def test_manifest_of_zip(zips, name):
    release, platform = _ZIPS[name]
    ours = tomllib.loads((_ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    with zipfile.ZipFile(zips / name) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert manifest["version"] == release["version"]
    assert manifest["platforms"] == [platform]
    assert (manifest["blender_version_min"], manifest.get("blender_version_max")) == release["blender"]
    own = {"version", "platforms", "wheels", "blender_version_min", "blender_version_max"}
    assert {key: manifest[key] for key in manifest.keys() - own} == {key: ours[key] for key in ours.keys() - own}


@pytest.mark.parametrize("name", _ZIPS)
def test_blenders_own_validation_is_clean(zips, name):
    tool = Path(bpy.utils.resource_path('LOCAL')) / "scripts/addons_core/bl_pkg/cli/blender_ext.py"
    done = subprocess.run([sys.executable, tool, "validate", zips / name], capture_output=True, text=True)
    assert not done.returncode and not done.stderr
    assert "Success" in done.stdout and not re.search(r"error|warn", done.stdout, re.IGNORECASE)


@pytest.mark.parametrize("name", _ZIPS)
def test_wheel_suits_blenders_numpy_and_carries_its_licence(zips, name, tmp_path):
    release, _ = _ZIPS[name]
    with zipfile.ZipFile(zips / name) as archive:
        (wheel,) = (entry for entry in archive.namelist() if entry.endswith(".whl"))
        archive.extract(wheel, tmp_path)
    info = f"scipy-{release['scipy']}.dist-info"
    with zipfile.ZipFile(tmp_path / wheel) as archive:
        assert archive.testzip() is None
        assert b"SciPy Developers" in archive.read(f"{info}/LICENSE.txt")
        metadata = archive.read(f"{info}/METADATA").decode()
    requirements = [Requirement(text) for text in re.findall(r"(?m)^Requires-Dist: (.*?)\s*$", metadata)]
    (numpy,) = (requirement for requirement in requirements if requirement.name == "numpy")
    assert all(version in numpy.specifier for version in release["numpy"])
    assert [requirement for requirement in requirements if requirement.marker is None] == [numpy]  # needs nothing else


def test_variant_for_debian_is_built_only_when_asked_for(build, tmp_path):
    assert not build(tmp_path, "--debian").returncode
    (path,) = tmp_path.iterdir()
    with zipfile.ZipFile(path) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert "debian" in path.name and "cp313" in manifest["wheels"][0]
    assert manifest["blender_version_min"] == "4.2.0" and "blender_version_max" not in manifest


def test_what_git_does_not_track_stops_the_build(build, tmp_path):
    """It would be missing from the zips, silently."""
    checkout = tmp_path / "checkout"
    subprocess.run(["git", "clone", "--quiet", _ROOT, checkout], check=True)
    (checkout / "qh_unwrap/new.py").touch()
    done = build(tmp_path / "zips", root=checkout)
    assert done.returncode and "qh_unwrap/new.py" in done.stderr
