# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import pytest

import qh_unwrap


@pytest.fixture(scope="session", autouse=True)
def _registered():
    """Blender 4.5 hangs at exit if a class is still registered."""
    qh_unwrap.register()
    yield
    qh_unwrap.unregister()


@pytest.fixture(autouse=True)
def _empty_scene():
    bpy.ops.wm.read_homefile(use_empty=True)
