# SPDX-License-Identifier: GPL-3.0-or-later
import tomllib
from pathlib import Path

import qh_unwrap

_ROOT = Path(__file__).parents[2]
_MANIFEST = tomllib.loads((_ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))


def test_version_is_the_packages():
    assert _MANIFEST["version"] == qh_unwrap.__version__


def test_what_the_extension_platform_demands():
    assert _MANIFEST["id"] == "qh_unwrap"
    assert _MANIFEST["license"] == ["SPDX:GPL-3.0-or-later"]
    assert len(_MANIFEST["tagline"]) <= 64 and not _MANIFEST["tagline"].endswith(".")
    assert all(len(reason) <= 64 and not reason.endswith(".") for reason in _MANIFEST["permissions"].values())


def test_every_source_file_names_its_licence():
    for path in [*_ROOT.glob("*.py"), *_ROOT.glob("qh_unwrap/**/*.py"), *_ROOT.glob("tests/**/*.py")]:
        text = path.read_text(encoding="utf-8")
        assert not text or text.startswith("# SPDX-License-Identifier: GPL-3.0-or-later"), path
