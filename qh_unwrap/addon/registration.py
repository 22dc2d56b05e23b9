# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets to know, and forgets again."""

import bpy

from . import operators, panels, properties, report_operators
from .last_run import last_run

_CLASSES = (
    properties.QHUnwrapSceneSettings,
    operators.QH_OT_unwrap,
    report_operators.QH_OT_select,
    report_operators.QH_OT_pack_overlapping,
    report_operators.QH_OT_copy_report,
    panels.QH_PT_uv_editor,
    panels.QH_PT_view_3d,
    panels.QH_PT_uv_editor_report,
    panels.QH_PT_view_3d_report,
)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.qh_unwrap = bpy.props.PointerProperty(type=properties.QHUnwrapSceneSettings)
    # The U menu of the 3D View contains this menu too.
    bpy.types.IMAGE_MT_uvs_unwrap.append(panels.draw_menu)


def unregister():
    bpy.types.IMAGE_MT_uvs_unwrap.remove(panels.draw_menu)
    del bpy.types.Scene.qh_unwrap
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    last_run.forget()
