# SPDX-License-Identifier: GPL-3.0-or-later
"""Checking UVs in Blender: what is found, what is said, what is selected, and that nothing else changes."""

import bpy  # isort: skip  (the wheel knows bmesh only after this)
from types import SimpleNamespace

import bmesh
import numpy as np
import pytest
from scenes import add_cube, add_grid, changes, edit_mode, mesh_object, snapshot, uvs
from test_reports import Layout

import qh_unwrap
from qh_unwrap.addon import panels
from qh_unwrap.addon.last_run import last_run


def put(obj, uv):
    """Give the object's corners these UVs (c, 2)."""
    layer = obj.data.uv_layers.active or obj.data.uv_layers.new(name="UVMap", do_init=False)
    layer.uv.foreach_set("vector", np.asarray(uv, dtype=np.float32).ravel())


def flat_grid(size=4, name="Grid"):
    """A flat grid, whose UVs fill the square without distortion."""
    obj = add_grid(size, name)
    for vertex in obj.data.vertices:
        vertex.co.z = 0
    return obj


def check(**options):
    assert bpy.ops.uv.qh_check(**options) == {'FINISHED'}
    return qh_unwrap.last_report()


def selected(obj):
    return [face.index for face in bmesh.from_edit_mesh(obj.data).faces if face.select]


def image(obj, width=1024, height=512, tiles=()):
    """Give the object a material with an image."""
    picture = bpy.data.images.new("Picture", width, height, tiled=bool(tiles))
    for number in tiles:
        picture.tiles.new(number)
    material = bpy.data.materials.new("Painted")
    material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = picture
    obj.data.materials.append(material)
    return picture


def test_a_valid_map_is_said_to_be_so_and_nothing_changes():
    obj = flat_grid()
    before = snapshot(obj)
    (island,) = check()
    assert island["injective"] and island["faults"] == island["warnings"] == island["overlaps"] == []
    assert island["after"]["l2_stretch"] == pytest.approx(1, abs=1e-5)
    assert island["published"]["symmetric_dirichlet_energy"] == pytest.approx(2, abs=1e-5)
    assert not changes(before, snapshot(obj))
    edit_mode(lambda obj, face: face < 3)
    before = snapshot(obj)
    (island,) = check(only_selected=True)
    assert island["face_indices"] == [0, 1, 2] and len(check()[0]["face_indices"]) == 16
    assert not changes(before, snapshot(obj))


def test_what_we_certify_is_certified():
    bpy.ops.mesh.primitive_monkey_add()
    bpy.ops.uv.qh_unwrap(cut='DISTORTION')
    unwrapped = qh_unwrap.last_report()
    checked = check()
    assert len(checked) == len(unwrapped) and all(each["injective"] for each in checked)
    for one, other in zip(unwrapped, checked, strict=True):
        assert one["face_indices"] == other["face_indices"]
        assert one["after"] == pytest.approx(other["after"], rel=1e-4, abs=1e-4)


def test_flipped_overlapping_and_worst_faces_are_selected():
    obj = flat_grid()
    uv = uvs(obj)
    middle = (uv == uv[4 * 5 + 2]).all(axis=1)
    uv[middle] += (0.4, 0.4)
    put(obj, uv)
    (island,) = check()
    assert any("flipped" in text for text in island["faults"]) and "it overlaps itself" in island["faults"]
    assert bpy.ops.uv.qh_check_select(kind='FLIPPED') == {'FINISHED'}
    flipped = selected(obj)
    assert flipped and set(flipped) <= set(last_run.check.faces["overlapping"]["Grid"].tolist())
    bpy.ops.uv.qh_check_select(kind='OVERLAPPING')
    assert set(flipped) < set(selected(obj)) and len(selected(obj)) < 16
    bpy.ops.uv.qh_check_select(kind='WORST')
    assert len(selected(obj)) == 1
    bpy.ops.uv.qh_check_select(kind='LOOK')
    assert len(selected(obj)) == 16


def test_faces_of_several_objects_are_selected_and_others_left(uv_editor):
    one, good, other = flat_grid(name="One"), flat_grid(name="Good"), flat_grid(name="Other")
    for obj in (one, other):
        uv = uvs(obj)
        uv[(uv == (0, 0)).all(axis=1)] += 0.6
        put(obj, uv)
    edit_mode()
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    check()
    with bpy.context.temp_override(**uv_editor):
        assert bpy.ops.uv.qh_check_select(kind='FLIPPED') == {'FINISHED'}
        assert selected(one) == selected(other) == [0] and not selected(good)
        check(only_selected=True)  # which follows the selection of UVs
    assert {(each["object"], *each["face_indices"]) for each in qh_unwrap.last_report()} == {("One", 0), ("Other", 0)}


def test_without_uvs_there_is_a_message_and_no_error():
    cube = add_cube("Bare")
    while cube.data.uv_layers:
        cube.data.uv_layers.remove(cube.data.uv_layers[0])
    (only,) = check()
    assert only["error"] == "its UVs are unset: unwrap it"
    grid = add_grid(3, "New")
    put(grid, np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (9, 1)))
    broken = flat_grid(name="Broken")
    uv = uvs(broken)
    uv[5] = np.nan
    put(broken, uv)
    found = {(each["object"], each["island"]): each for each in check()}
    assert found["New", 1]["faces"] == 9 and "unset" in found["New", 1]["error"]
    assert found["Broken", 1]["faces"] == 15 and found["Broken", 1]["injective"]
    assert found["Broken", 2]["face_indices"] == [1] and "no numbers" in found["Broken", 2]["error"]


def test_stacks_are_no_fault_and_lying_on_each_other_is_one():
    grid = flat_grid(2)
    square = np.array([(0, 0), (0.4, 0), (0.4, 0.4), (0, 0.4)])
    put(grid, np.concatenate([square, square, square + (0.5, 0), square + (0.6, 0.1)]))
    found = check()
    assert [each["stacked"] for each in found] == [1, 1, 0, 0]
    assert [each["overlaps"] for each in found] == [[], [], ["Grid, island 4 (1 face)"], ["Grid, island 3 (1 face)"]]
    bpy.ops.uv.qh_check_select(kind='LOOK')
    assert selected(grid) == [2, 3]
    with pytest.raises(RuntimeError, match="No island of the last result lies on another"):
        bpy.ops.uv.qh_unwrap_pack_overlapping()  # which knows the islands that were unwrapped alone


def test_mirrored_islands_are_told_and_selected_and_are_no_fault():
    grid = flat_grid(2)
    uv = uvs(grid)
    uv[4:8] = uv[4:8][::-1]
    put(grid, uv)
    found = check()
    assert [each["mirrored"] for each in found] == [False, True] and all(each["injective"] for each in found)
    assert not any(each["faults"] for each in found) and found[1]["warnings"] == ["it is mirrored"]
    bpy.ops.uv.qh_check_select(kind='MIRRORED')
    assert selected(grid) == [1]


def test_tiles_are_those_of_the_image():
    grid = flat_grid(2)
    square = np.array([(0, 0), (0.4, 0), (0.4, 0.4), (0, 0.4)])
    put(grid, np.concatenate([square, square + (0.2, 1.3), square + (0.9, 0.5), square - (0.5, 3)]))
    texts = [each["faults"] for each in check()]
    assert texts[0] == [] and "tile 1011, outside of the 0 to 1 square" in texts[1][0]
    assert "over the border" in texts[2][0] and "outside of all tiles" in texts[3][0]
    image(grid, tiles=(1002, 1011))
    assert [bool(each["faults"]) for each in check()] == [False, False, True, True]


def test_texel_density_is_in_pixels_per_metre():
    grid = flat_grid(2)  # 2 by 2 metres on the whole square
    assert check()[0]["texel_density"] is None
    image(grid, 1024, 1024)
    assert check()[0]["texel_density"] == pytest.approx(512)
    grid.scale = (2, 2, 2)
    bpy.context.scene.unit_settings.scale_length = 0.5
    bpy.context.view_layer.update()
    assert check()[0]["texel_density"] == pytest.approx(512) == pytest.approx(last_run.check.texel_density)


def test_the_panel_shows_it():
    obj = flat_grid()
    image(obj)
    check()
    layout = Layout()
    panels.QH_PT_view_3d_report.draw(SimpleNamespace(layout=layout), bpy.context)
    assert "362.0 pixels per metre" in layout.drawn
    assert [each.kind for each in layout.drawn if getattr(each, "idname", "") == "uv.qh_check_select"] == [
        'FLIPPED',
        'MIRRORED',
        'OVERLAPPING',
        'WORST',
        'LOOK',
    ]


def test_a_mesh_that_changed_since_is_not_selected_in():
    obj = flat_grid()
    put(obj, uvs(obj) + 5)
    check()
    bpy.ops.object.mode_set(mode='EDIT')
    bm = bmesh.from_edit_mesh(obj.data)
    bm.faces.ensure_lookup_table()
    bmesh.ops.delete(bm, geom=[bm.faces[3]], context='FACES')
    bmesh.update_edit_mesh(obj.data)
    with pytest.raises(RuntimeError, match="Grid has other faces than when it was checked: check again"):
        bpy.ops.uv.qh_check_select(kind='LOOK')


def test_it_says_what_it_needs():
    with pytest.raises(RuntimeError, match="Needs a mesh in Edit Mode or selected meshes"):
        bpy.ops.uv.qh_check()
    mesh_object("Points", [(0, 0, 0)], [])
    with pytest.raises(RuntimeError, match="no faces to check"):
        bpy.ops.uv.qh_check()
