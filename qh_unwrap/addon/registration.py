# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets to know, and forgets again."""

import bpy

from . import heat_operators, operators, panels, properties, report_operators
from .heatmap import heatmap
from .last_run import last_run

_CLASSES = (
    properties.QHUnwrapSceneSettings,
    properties.QHSeamsSceneSettings,
    properties.QHHeatSceneSettings,
    operators.QH_OT_unwrap,
    operators.QH_OT_seams,
    heat_operators.QH_OT_heatmap,
    report_operators.QH_OT_select,
    report_operators.QH_OT_pack_overlapping,
    report_operators.QH_OT_cut_closed,
    report_operators.QH_OT_copy_report,
    panels.QH_PT_uv_editor,
    panels.QH_PT_view_3d,
    panels.QH_PT_uv_editor_seams,
    panels.QH_PT_view_3d_seams,
    panels.QH_PT_uv_editor_distortion,
    panels.QH_PT_view_3d_distortion,
    panels.QH_PT_uv_editor_report,
    panels.QH_PT_view_3d_report,
)

_DISTORTION_MENUS = (bpy.types.IMAGE_MT_uvs, bpy.types.VIEW3D_MT_uv_map)
_SEAM_MENUS = (bpy.types.IMAGE_MT_uvs, bpy.types.VIEW3D_MT_uv_map, bpy.types.VIEW3D_MT_edit_mesh_edges)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.qh_unwrap = bpy.props.PointerProperty(type=properties.QHUnwrapSceneSettings)
    bpy.types.Scene.qh_seams = bpy.props.PointerProperty(type=properties.QHSeamsSceneSettings)
    bpy.types.Scene.qh_heatmap = bpy.props.PointerProperty(type=properties.QHHeatSceneSettings)
    # The U menu of the 3D View contains this menu too.
    bpy.types.IMAGE_MT_uvs_unwrap.append(panels.draw_menu)
    for menu in _SEAM_MENUS:
        menu.append(panels.draw_seam_menu)
    for menu in _DISTORTION_MENUS:
        menu.append(panels.draw_distortion_menu)


def unregister():
    heatmap.turn_off()
    for menu in _DISTORTION_MENUS:
        menu.remove(panels.draw_distortion_menu)
    for menu in _SEAM_MENUS:
        menu.remove(panels.draw_seam_menu)
    bpy.types.IMAGE_MT_uvs_unwrap.remove(panels.draw_menu)
    del bpy.types.Scene.qh_heatmap
    del bpy.types.Scene.qh_seams
    del bpy.types.Scene.qh_unwrap
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    last_run.forget()
