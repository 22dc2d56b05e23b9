# SPDX-License-Identifier: GPL-3.0-or-later
"""Importance in Blender: a vertex group gives regions more texels, in the operator and on the command line."""

import bpy
import numpy as np
import pytest
from scenes import add_grid, edit_mode, uvs
from test_check import put

import qh_unwrap
from qh_unwrap.addon import files, mesh_arrays
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.cli import main


def grouped(name="uv_importance", size=12):
    """A bent grid with a vertex group on one side of it."""
    obj = add_grid(size)
    group = obj.vertex_groups.new(name=name)
    group.add([vertex.index for vertex in obj.data.vertices if vertex.co.x > 0.25], 1.0, 'ADD')
    return obj


def ratio(obj):
    """UV area by area in space of the faces within the group, by the same of those without a vertex in it."""
    weights = [any(each.weight > 0 for each in vertex.groups) for vertex in obj.data.vertices]
    uv, found = uvs(obj), {}
    for face in obj.data.polygons:
        inside = {weights[vertex] for vertex in face.vertices}
        x, y = uv[list(face.loop_indices)].T.astype(float)
        area = abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2
        if len(inside) == 1:
            found.setdefault(inside.pop(), []).append((area, face.area))
    (more, in_space), (less, others) = (np.sum(found[key], axis=0) for key in (True, False))
    return more / in_space / (less / others)


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_a_vertex_group_gives_its_faces_more_room(mode):
    obj = grouped()
    if mode == 'EDIT':
        edit_mode()
    assert bpy.ops.uv.qh_unwrap(use_weights=True) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    assert 3 < ratio(obj) < 4.2
    (island,) = qh_unwrap.last_report()
    assert island["injective"] and not island["after"]["flips"]
    assert island["after"]["area"] > 0.3  # beside the true surface
    bpy.ops.uv.qh_unwrap()
    assert ratio(obj) == pytest.approx(1, abs=0.2)


def test_factor_one_is_as_without_a_group():
    obj = grouped()
    start = uvs(obj)
    bpy.ops.uv.qh_unwrap()
    expected = uvs(obj)
    put(obj, start)
    bpy.ops.uv.qh_unwrap(use_weights=True, weight_factor=1)
    assert np.array_equal(uvs(obj), expected)


def test_important_islands_are_packed_larger():
    obj = grouped(size=8)
    for edge in obj.data.edges:
        edge.use_seam = all(abs(obj.data.vertices[vertex].co.x) < 1e-5 for vertex in edge.vertices)
    group = obj.vertex_groups["uv_importance"]
    group.add([vertex.index for vertex in obj.data.vertices if vertex.co.x >= 0], 1.0, 'ADD')
    bpy.ops.uv.qh_unwrap(use_weights=True, placement='PACK')
    assert ratio(obj) > 2


def test_objects_without_the_group_are_unwrapped_as_ever():
    grouped()
    plain = add_grid(6, "Plain")
    bpy.ops.uv.qh_unwrap(use_weights=True)
    with_group = uvs(plain)
    bpy.ops.uv.qh_unwrap()
    assert np.allclose(with_group, uvs(plain), atol=1e-5)


def test_relax_gives_them_more_room_as_well():
    obj = grouped()
    bpy.ops.uv.qh_unwrap()
    before = ratio(obj)
    settings = bpy.context.scene.qh_unwrap
    settings.use_weights, settings.weight_factor = True, 4.0
    assert bpy.ops.uv.qh_relax(move_outline=True) == {'FINISHED'}
    assert qh_unwrap.last_report()[0]["injective"]
    assert before < 1.5 and 2.5 < ratio(obj) < 5


def test_seams_know_of_them():
    obj = grouped()
    wishes = [mesh_arrays.read(obj, MeshOptions(use_weights=use), "").wishes for use in (True, False)]
    assert sorted(set(wishes[0].importance.round(6))) == [1, 4] and wishes[1].importance is None


def test_a_missing_group_is_told(tmp_path, capfd):
    add_grid(4)
    with pytest.raises(RuntimeError, match="There is no vertex group uv_importance: paint one, choose another"):
        bpy.ops.uv.qh_unwrap(use_weights=True)
    files.save(tmp_path / "in.blend")
    assert main([str(tmp_path / "in.blend"), "--use-weights"]) == 2
    assert "There is no vertex group uv_importance" in capfd.readouterr().err


def test_on_the_command_line(tmp_path):
    grouped("face")
    files.save(tmp_path / "in.blend")
    arguments = ["--use-weights", "--weight-group", "face", "--weight-factor", "3"]
    assert main([str(tmp_path / "in.blend"), "-o", str(tmp_path / "out.blend"), *arguments]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out.blend"))
    assert 2.5 < ratio(bpy.data.objects["Grid"]) < 3.2
