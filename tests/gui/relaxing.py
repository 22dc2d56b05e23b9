# SPDX-License-Identifier: GPL-3.0-or-later
"""
Relaxing and straightening in Blender's window, as the pages in docs/ show it.

A driver like `driver.py`, for the same harness.
"""

import bpy  # isort: skip  (the wheel knows bmesh only after this)
import bmesh
import numpy as np
from driver import show_checker, uvs

_SIZE = 24  # quads along a side of the sheet


def steps(gui):
    gui.workspace("UV Editing")
    yield 1
    _add_sheet(gui)
    show_checker(gui)
    _look(gui)
    yield 1
    with gui.override('IMAGE_EDITOR'):
        bpy.ops.image.view_all(fit_view=True)
    yield 1
    settings = bpy.context.scene.tool_settings
    settings.use_uv_select_sync = False
    settings.uv_select_mode = 'FACE'
    _select(lambda x, y: np.hypot(x - 0.1, y) < 0.7)
    yield 1
    gui.shot("30_before.png")
    gui.move('IMAGE_EDITOR', fx=0.5, fy=0.5)
    yield 0.5
    before, chosen = uvs(), _selected()
    yield from _from_menu(gui, "31_uv_menu.png")
    after = uvs()
    assert not np.array_equal(before, after), "the menu entry did nothing"
    assert np.array_equal(before[~chosen], after[~chosen]), "what is not selected moved"
    gui.shot("32_relaxed.png")
    yield from _press(gui, "ctrl+z", "undo did not restore", before)

    with gui.override('IMAGE_EDITOR'):
        bpy.ops.uv.select_all(action='SELECT')
    yield from _run(gui, bpy.ops.uv.qh_relax, "33_outline_moved.png", move_outline=True)

    settings.uv_select_mode = 'EDGE'
    _turn(0.25)
    _select_edges(
        lambda i, j: {i % (_SIZE + 1), j % (_SIZE + 1)} == {8} or {i // (_SIZE + 1), j // (_SIZE + 1)} == {15}
    )
    yield 1
    gui.shot("34_edges.png")
    yield from _run(gui, bpy.ops.uv.qh_straighten, "35_straight_edges.png", shape='LINES')
    gui.key("ctrl+z")
    yield 2

    settings.uv_select_mode = 'FACE'
    _select(lambda x, y: -0.4 < x < 0.7 and -0.5 < y < 0.4)
    yield 1
    gui.shot("36_quads.png")
    yield from _run(gui, bpy.ops.uv.qh_straighten, "37_rectangle.png", shape='RECTANGLE')

    gui.sidebar('IMAGE_EDITOR')
    yield 1
    gui.sidebar('IMAGE_EDITOR', "QH Unwrap")
    yield 1
    gui.shot("38_panel.png")


def _from_menu(gui, shot):
    """Relax from the UV menu of the UV Editor, by its name."""
    with gui.override('IMAGE_EDITOR'):
        bpy.ops.wm.call_menu(name="IMAGE_MT_uvs")
    yield 1
    gui.shot(shot)
    gui.key("space")  # to search in the menu
    yield 1
    gui.type("Harmonic Relax")
    yield 1
    gui.key("Return")
    yield from _until_done(gui)


def _run(gui, operator, shot, **options):
    """Call an operator of ours in the UV Editor, and take a picture when it has ended."""
    with gui.override('IMAGE_EDITOR'):
        operator('INVOKE_DEFAULT', **options)
    yield from _until_done(gui)
    gui.shot(shot)


def _until_done(gui):
    """Until an operator of ours that goes on beside the window has ended, and the window is drawn."""
    for _ in range(100):
        yield 0.3
        if not any(each.bl_idname.startswith("UV_OT_qh") for each in gui.window.modal_operators):
            break
    yield 1.5


def _press(gui, key, text, expected):
    gui.key(key)
    yield 2
    assert np.array_equal(uvs(), expected), text


def _add_sheet(gui):
    """A sheet with a hill, whose UVs are its view from above."""
    with gui.override('VIEW_3D'):
        if bpy.context.mode != 'OBJECT':
            bpy.ops.object.mode_set(mode='OBJECT')
        bpy.ops.object.select_all(action='SELECT')
        bpy.ops.object.delete()
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=_SIZE, y_subdivisions=_SIZE, calc_uvs=True)
        mesh = bpy.context.object.data
        points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", points.ravel())
        points[:, 2] = 0.7 * np.exp(-6 * ((points[:, 0] - 0.1) ** 2 + points[:, 1] ** 2))
        mesh.vertices.foreach_set("co", points.ravel())
        mesh.update()
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
        bpy.ops.ed.undo_push(message="Sheet")


def _look(gui):
    with gui.override('VIEW_3D'):
        bpy.ops.view3d.view_axis(type='TOP')
        bpy.ops.view3d.view_orbit(angle=0.9, type='ORBITUP')
        bpy.ops.view3d.view_selected()
    gui.area('VIEW_3D').spaces.active.overlay.show_overlays = False


def _mesh():
    bm = bmesh.from_edit_mesh(bpy.context.object.data)
    return bm, bm.loops.layers.uv.active


def _choose(chosen_face, chosen_side):
    """Select UVs: the faces and sides of which the functions say so."""
    bm, layer = _mesh()
    new = bpy.app.version >= (5, 0, 0)
    for face in bm.faces:
        whole = chosen_face(face)
        if new:
            face.uv_select = whole
        for loop in face.loops:
            side = whole or chosen_side(loop)
            corner = side or chosen_side(loop.link_loop_prev)
            if new:
                loop.uv_select_vert, loop.uv_select_edge = corner, side
            else:
                loop[layer].select, loop[layer].select_edge = corner, side
    if new:
        bm.uv_select_sync_valid = True
    bmesh.update_edit_mesh(bpy.context.object.data)
    bpy.ops.ed.undo_push(message="Select")


def _select(inside):
    _choose(lambda face: inside(*face.calc_center_median()[:2]), lambda loop: False)


def _select_edges(chosen):
    _choose(lambda face: False, lambda loop: chosen(loop.vert.index, loop.link_loop_next.vert.index))


def _turn(angle):
    bm, layer = _mesh()
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for face in bm.faces:
        for loop in face.loops:
            loop[layer].uv = turn @ (np.array(loop[layer].uv) - 0.5) + 0.5
    bmesh.update_edit_mesh(bpy.context.object.data)
    bpy.ops.ed.undo_push(message="Turn")


def _selected():
    bm, layer = _mesh()
    if bpy.app.version >= (5, 0, 0):
        return np.array([loop.uv_select_vert for face in bm.faces for loop in face.loops])
    return np.array([loop[layer].select for face in bm.faces for loop in face.loops])
