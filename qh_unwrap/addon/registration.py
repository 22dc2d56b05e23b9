# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets to know, and forgets again."""

import bpy

from . import check_operators, compare_operators, heat_operators, operators, panels, properties, report_operators
from .comparison import latest
from .heatmap import heatmap
from .last_run import last_run

_CLASSES = (
    properties.QHUnwrapSceneSettings,
    properties.QHSeamsSceneSettings,
    properties.QHRelaxSceneSettings,
    properties.QHStraightenSceneSettings,
    properties.QHHeatSceneSettings,
    operators.QH_OT_unwrap,
    operators.QH_OT_seams,
    operators.QH_OT_relax,
    operators.QH_OT_straighten,
    check_operators.QH_OT_check,
    check_operators.QH_OT_check_select,
    heat_operators.QH_OT_heatmap,
    compare_operators.QH_OT_compare,
    compare_operators.QH_OT_compare_show,
    compare_operators.QH_OT_plot,
    compare_operators.QH_OT_plot_save,
    report_operators.QH_OT_select,
    report_operators.QH_OT_pack_overlapping,
    report_operators.QH_OT_cut_closed,
    report_operators.QH_OT_copy_report,
    panels.QH_PT_uv_editor,
    panels.QH_PT_view_3d,
    panels.QH_PT_uv_editor_seams,
    panels.QH_PT_view_3d_seams,
    panels.QH_PT_uv_editor_relax,
    panels.QH_PT_view_3d_relax,
    panels.QH_PT_uv_editor_distortion,
    panels.QH_PT_view_3d_distortion,
    panels.QH_PT_uv_editor_report,
    panels.QH_PT_view_3d_report,
)

_SETTINGS = {
    "qh_unwrap": properties.QHUnwrapSceneSettings,
    "qh_seams": properties.QHSeamsSceneSettings,
    "qh_relax": properties.QHRelaxSceneSettings,
    "qh_straighten": properties.QHStraightenSceneSettings,
    "qh_heatmap": properties.QHHeatSceneSettings,
}

_UV_MENUS = (bpy.types.IMAGE_MT_uvs, bpy.types.VIEW3D_MT_uv_map)
_ENTRIES = (
    (panels.draw_menu, (bpy.types.IMAGE_MT_uvs_unwrap,)),  # which the U menu of the 3D View contains too
    (panels.draw_relax_menu, _UV_MENUS),
    (panels.draw_seam_menu, (*_UV_MENUS, bpy.types.VIEW3D_MT_edit_mesh_edges)),
    (panels.draw_check_menu, _UV_MENUS),
    (panels.draw_distortion_menu, _UV_MENUS),
)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    for name, kind in _SETTINGS.items():
        setattr(bpy.types.Scene, name, bpy.props.PointerProperty(type=kind))
    for draw, menus in _ENTRIES:
        for menu in menus:
            menu.append(draw)


def unregister():
    heatmap.turn_off()
    for draw, menus in reversed(_ENTRIES):
        for menu in menus:
            menu.remove(draw)
    for name in _SETTINGS:
        delattr(bpy.types.Scene, name)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    last_run.forget()
    latest.comparison = None
