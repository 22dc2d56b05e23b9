# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender gets to know, and forgets again."""

import bpy

from . import operators, panels, properties, report_operators
from .last_run import last_run

_CLASSES = (
    properties.QHUnwrapSceneSettings,
    properties.QHSeamsSceneSettings,
    properties.QHRelaxSceneSettings,
    properties.QHStraightenSceneSettings,
    operators.QH_OT_unwrap,
    operators.QH_OT_seams,
    operators.QH_OT_relax,
    operators.QH_OT_straighten,
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
    panels.QH_PT_uv_editor_report,
    panels.QH_PT_view_3d_report,
)

_SCENE_SETTINGS = {
    "qh_unwrap": properties.QHUnwrapSceneSettings,
    "qh_seams": properties.QHSeamsSceneSettings,
    "qh_relax": properties.QHRelaxSceneSettings,
    "qh_straighten": properties.QHStraightenSceneSettings,
}
_MENUS = (
    (bpy.types.IMAGE_MT_uvs_unwrap, panels.draw_menu),  # which the U menu of the 3D View contains as well
    (bpy.types.IMAGE_MT_uvs, panels.draw_relax_menu),
    (bpy.types.VIEW3D_MT_uv_map, panels.draw_relax_menu),
    (bpy.types.IMAGE_MT_uvs, panels.draw_seam_menu),
    (bpy.types.VIEW3D_MT_uv_map, panels.draw_seam_menu),
    (bpy.types.VIEW3D_MT_edit_mesh_edges, panels.draw_seam_menu),
)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    for name, kind in _SCENE_SETTINGS.items():
        setattr(bpy.types.Scene, name, bpy.props.PointerProperty(type=kind))
    for menu, draw in _MENUS:
        menu.append(draw)


def unregister():
    for menu, draw in _MENUS:
        menu.remove(draw)
    for name in _SCENE_SETTINGS:
        delattr(bpy.types.Scene, name)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    last_run.forget()
