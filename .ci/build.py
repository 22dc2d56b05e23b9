# SPDX-License-Identifier: GPL-3.0-or-later
"""
Build the extension's zips, one for each wheel in `wheels.sha256`: a platform and the Python of a Blender.

    python .ci/build.py [--out dist] [--cache FOLDER] [--debian]

Runs in any environment with bpy, whose own tool checks and packs each zip.  No zip holds two wheels: the first 4.2
releases ignore a wheel's Python tag and would install the wrong one.
"""

import argparse
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
SHIPPED = ("blender_manifest.toml", "__init__.py", "LICENSE", "README.md", "qh_unwrap")
WHEELS = [line.split()[::-1] for line in Path(__file__).with_name("wheels.sha256").read_text().splitlines()]
PLATFORMS = {
    r"win_amd64": "windows-x64",
    r"win_arm64": "windows-arm64",
    r"macosx_\d+_\d+_x86_64": "macos-x64",
    r"macosx_\d+_\d+_arm64": "macos-arm64",
    r"manylinux\w+_x86_64": "linux-x64",
}


class Target(NamedTuple):
    """The Blenders that run one Python."""

    label: str
    version_min: str
    version_max: str | None  # exclusive
    patch: int  # added to the version: no two builds of one version may be uploaded for a platform


TARGETS = {
    "cp311": Target("blender4.2", "4.2.0", "5.1.0", patch=0),
    "cp313": Target("blender5.1", "5.1.0", None, patch=1),
}
DEBIAN = Target("debian", "4.2.0", None, patch=1)  # its 4.3 runs on the system's Python 3.13; for tests only


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for the zips")
    parser.add_argument("--cache", type=Path, default=default_cache(), help="folder that keeps the wheels")
    parser.add_argument("--debian", action="store_true", help="only the variant for Debian's Blender 4.3, for tests")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name, sha256 in WHEELS:
        if not args.debian:
            print(build(name, sha256, TARGETS[python_tag(name)], args.out, args.cache))
        elif python_tag(name) == "cp313" and platform(name) == "linux-x64":
            print(build(name, sha256, DEBIAN, args.out, args.cache))


def default_cache():
    return Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")).expanduser() / "qh_unwrap"


def build(wheel_name, sha256, target, out, cache):
    """Make one zip and check it; returns its path."""
    wheel = fetch(wheel_name, sha256, cache / "wheels")
    manifest_text, version = manifest(wheel_name, target)
    zip_path = out / f"qh_unwrap-{version}-{target.label}-{platform(wheel_name)}.zip"
    with tempfile.TemporaryDirectory() as folder:
        staged = Path(folder)
        files = stage(staged)
        (staged / "blender_manifest.toml").write_text(manifest_text, encoding="utf-8")
        (staged / "wheels").mkdir()
        shutil.copy(wheel, staged / "wheels")
        zip_path.unlink(missing_ok=True)
        blender_tool("validate", staged)
        blender_tool("build", "--source-dir", staged, "--output-filepath", zip_path)
        blender_tool("validate", zip_path)
        check(zip_path, staged, {*files, f"wheels/{wheel_name}"})
    return zip_path


def fetch(name, sha256, folder):
    """The wheel from the folder, or else from the package index."""
    path = folder / name
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        package, version, python, abi, platforms = name.removesuffix(".whl").split("-")
        with tempfile.TemporaryDirectory(dir=folder) as download:
            command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
            command += ["--only-binary=:all:", "--implementation=cp", f"--python-version={python[2:]}", f"--abi={abi}"]
            command += [f"--platform={tag}" for tag in platforms.split(".")]
            subprocess.run([*command, f"--dest={download}", f"{package}=={version}"], check=True)
            (Path(download) / name).rename(path)
    if hashlib.sha256(path.read_bytes()).hexdigest() != sha256:
        raise SystemExit(f"{path} is not the wheel that was reviewed: remove it and build again")
    return path


def stage(folder):
    """Copy what ships into the folder, tracked files only; returns their names."""
    listed = ["git", "-C", str(ROOT), "ls-files", "-z"]
    untracked = _names([*listed, "--others", "--exclude-standard", *SHIPPED])
    if untracked:
        raise SystemExit(f"Not tracked by git, so they would be missing: {', '.join(untracked)}")
    files = _names([*listed, *SHIPPED])
    missing = [name for name in SHIPPED if not any(file == name or file.startswith(name + "/") for file in files)]
    if missing:
        raise SystemExit(f"Not in the repository: {', '.join(missing)}")
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, folder / file)
    return files


def _names(command):
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [name for name in output.split("\0") if name]


def manifest(wheel_name, target):
    """The manifest of one zip and its version: the repository's with wheel, platform and Blender versions."""
    text = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    major, minor, patch = map(int, tomllib.loads(text)["version"].split("."))
    if patch % 2:
        raise SystemExit("The manifest's version needs an even patch number: the odd one after it is Python 3.13's")
    version = f"{major}.{minor}.{patch + target.patch}"
    blender = [f'blender_version_min = "{target.version_min}"']
    if target.version_max:
        blender.append(f'blender_version_max = "{target.version_max}"')
    blender += [f'platforms = ["{platform(wheel_name)}"]', f'wheels = ["./wheels/{wheel_name}"]']
    text, versions = re.subn(r"(?m)^version = .*$", f'version = "{version}"', text)
    text, minima = re.subn(r"(?m)^blender_version_min = .*$", "\n".join(blender), text)
    assert versions == minima == 1
    return text, version


def python_tag(wheel_name):
    return wheel_name.split("-")[2]


def platform(wheel_name):
    """Blender's name for it."""
    tag = wheel_name.removesuffix(".whl").split("-")[4].split(".")[0]
    return next(name for pattern, name in PLATFORMS.items() if re.fullmatch(pattern, tag))


def blender_tool(*arguments):
    """Run bpy's own `blender --command extension`; any complaint stops the build."""
    bpy = importlib.util.find_spec("bpy")
    if bpy is None:
        raise SystemExit("Needs bpy: pip install bpy")
    (tool,) = Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    done = subprocess.run([sys.executable, tool, *arguments], capture_output=True, text=True)
    if done.returncode or done.stderr or re.search(r"error|warn", done.stdout, re.IGNORECASE):
        raise SystemExit(f"{' '.join(map(str, arguments))}:\n{done.stdout}{done.stderr}")


def check(zip_path, staged, expected):
    """The tool leaves out what it does not find, silently."""
    with zipfile.ZipFile(zip_path) as archive:
        found = {name for name in archive.namelist() if not name.endswith("/")}
        if found != expected:
            raise SystemExit(f"{zip_path}: {sorted(found ^ expected)} are missing or too many")
        changed = [name for name in found if archive.read(name) != (staged / name).read_bytes()]
        if changed:
            raise SystemExit(f"{zip_path}: {sorted(changed)} changed")


if __name__ == "__main__":
    main()
