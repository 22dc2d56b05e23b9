# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faces count as selected, in the 3D view and the UV Editor, with sync on and off."""

import bpy  # isort: skip
import bmesh
import pytest
from scenes import add_grid, changes, edit_mode, select_uvs, snapshot

from qh_unwrap.addon import operators, selection

_FIVE = bpy.app.version >= (5, 0, 0)


def chosen_faces(context):
    return [list(target.faces.nonzero()[0]) for target in selection.targets(context)]


def test_sync_off_takes_faces_selected_in_both(uv_editor):
    obj = add_grid(3)
    edit_mode(lambda _, face: face < 6)
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    select_uvs(obj, {4, 5, 8})
    with bpy.context.temp_override(**uv_editor):
        assert isinstance(bpy.context.space_data, bpy.types.SpaceImageEditor)
        assert chosen_faces(bpy.context) == [[4, 5]]
    assert chosen_faces(bpy.context) == [[0, 1, 2, 3, 4, 5]], "outside the UV Editor the mesh selection counts"


def test_sync_off_and_a_corner_missing(uv_editor):
    """A face counts when all its corners are selected."""
    obj = add_grid(2)
    edit_mode()
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    select_uvs(obj, {0, 1})
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    loop = bm.faces[0].loops[0]
    if _FIVE:
        loop.uv_select_vert = False
        bm.faces[0].uv_select = False
    else:
        loop[bm.loops.layers.uv.active].select = False
    with bpy.context.temp_override(**uv_editor):
        assert chosen_faces(bpy.context) == [[1]]


def test_sync_on(uv_editor):
    """Blender 5 keeps a UV selection of its own even then, where it is valid."""
    obj = add_grid(3)
    edit_mode(lambda _, face: face < 6)
    bpy.context.scene.tool_settings.use_uv_select_sync = True
    with bpy.context.temp_override(**uv_editor):
        assert chosen_faces(bpy.context) == [[0, 1, 2, 3, 4, 5]]
        select_uvs(obj, {4, 5})
        assert chosen_faces(bpy.context) == [[4, 5] if _FIVE else [0, 1, 2, 3, 4, 5]]


def test_hidden_faces_never(uv_editor):
    obj = add_grid(3)
    edit_mode()
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    bm.faces[0].hide = True
    bm.faces[0].select = True
    assert chosen_faces(bpy.context) == [[1, 2, 3, 4, 5, 6, 7, 8]]


@pytest.mark.parametrize("sync", [False, True])
def test_unwrapping_keeps_the_uv_selection(uv_editor, sync):
    obj = add_grid(4)
    edit_mode(lambda _, face: face < 12)
    bpy.context.scene.tool_settings.use_uv_select_sync = sync
    select_uvs(obj, {0, 1, 2, 4, 5, 6, 8, 9, 10})
    before = snapshot(obj)
    with bpy.context.temp_override(**uv_editor):
        expected = chosen_faces(bpy.context)
        assert bpy.ops.uv.qh_unwrap(placement='PACK') == {'FINISHED'}
        assert chosen_faces(bpy.context) == expected
    assert changes(before, snapshot(obj)) == {"UVMap"}
    assert [outcome.faces for outcome in operators.last_outcomes] == [len(faces) for faces in expected]
    assert bpy.context.scene.tool_settings.use_uv_select_sync == sync


def test_packing_new_islands_keeps_the_uv_selection(uv_editor):
    obj = add_grid(4)
    for edge in obj.data.edges:
        edge.use_seam = True
    edit_mode()
    bpy.ops.mesh.select_mode(type='VERT')
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    select_uvs(obj, {0, 5, 7}, sticky=False)
    before = snapshot(obj)
    assert bpy.ops.uv.qh_unwrap(placement='PACK') == {'FINISHED'}
    assert changes(before, snapshot(obj)) == {"UVMap"}
    assert not bpy.context.scene.tool_settings.use_uv_select_sync
