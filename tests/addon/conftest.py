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


@pytest.fixture
def uv_editor():
    """A context as in the UV Editor."""
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    old = area.ui_type
    area.ui_type = 'UV'
    region = next(region for region in area.regions if region.type == 'WINDOW')
    yield {"window": window, "area": area, "region": region}
    area.ui_type = old
