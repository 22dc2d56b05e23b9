# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets to know, and forgets again."""

import bpy

from .. import cli
from . import operators, panels, properties

_CLASSES = (
    properties.QHUnwrapSceneSettings,
    operators.QH_OT_unwrap,
    panels.QH_PT_uv_editor,
    panels.QH_PT_view_3d,
    panels.QH_PT_uv_editor_report,
    panels.QH_PT_view_3d_report,
)
_command = None


def register():
    global _command
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.qh_unwrap = bpy.props.PointerProperty(type=properties.QHUnwrapSceneSettings)
    # The U menu of the 3D View contains this menu too.
    bpy.types.IMAGE_MT_uvs_unwrap.append(panels.draw_menu)
    _command = bpy.utils.register_cli_command("qh_unwrap", cli.main)


def unregister():
    bpy.utils.unregister_cli_command(_command)
    bpy.types.IMAGE_MT_uvs_unwrap.remove(panels.draw_menu)
    del bpy.types.Scene.qh_unwrap
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    operators.last_outcomes.clear()
