# SPDX-License-Identifier: GPL-3.0-or-later
"""With shape keys it is the shape that Object Mode shows that counts, in every mode."""

import bmesh
import bpy
import numpy as np
import pytest
from scenes import add_grid, changes, edit_mode, snapshot, uvs

from qh_unwrap.addon import mesh_arrays
from qh_unwrap.addon.options import MeshOptions


def with_keys(value=0.5):
    """A flat grid with two shape keys, a hill in one corner and one in the other, the second with a vertex group."""
    obj = add_grid(8)
    points = np.array([vertex.co for vertex in obj.data.vertices]) * (1, 1, 0)
    obj.data.vertices.foreach_set("co", points.astype(np.float32).ravel())
    obj.shape_key_add(name="Basis")
    obj.vertex_groups.new(name="Some").add(list(range(0, 60)), 0.6, 'REPLACE')
    for name, corner in (("One", -0.5), ("Other", 0.5)):
        key = obj.shape_key_add(name=name)
        hill = np.exp(-4 * ((points[:, :2] - corner) ** 2).sum(axis=1))
        key.data.foreach_set("co", (points + hill[:, None] * (0, 0, 1)).astype(np.float32).ravel())
        key.value = value
    obj.data.shape_keys.key_blocks["Other"].vertex_group = "Some"
    bpy.context.view_layer.update()
    return obj


def seen_in_object_mode(obj):
    """The vertices as Blender evaluates them."""
    assert obj.mode == 'OBJECT' and not obj.modifiers
    seen = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.array([vertex.co for vertex in seen.vertices])


@pytest.mark.parametrize("solo", [False, True])
@pytest.mark.parametrize("active", [0, 1, 2])
@pytest.mark.parametrize("value", [0.0, 0.7, 1.0])
def test_the_shape_that_is_seen_is_read_in_both_modes(value, active, solo):
    obj = with_keys(value)
    obj.active_shape_key_index, obj.show_only_shape_key = active, solo
    bpy.context.view_layer.update()
    expected = seen_in_object_mode(obj)
    assert np.allclose(mesh_arrays.read(obj).vertices, expected, atol=1e-6)
    edit_mode()
    before = snapshot(obj)
    assert np.allclose(mesh_arrays.read(obj).vertices, expected, atol=1e-6)
    assert not changes(before, snapshot(obj))


@pytest.mark.parametrize("active", [0, 1])
def test_same_uvs_in_both_modes(active):
    found = []
    for mode in ('OBJECT', 'EDIT'):
        bpy.ops.wm.read_homefile(use_empty=True)
        obj = with_keys()
        obj.active_shape_key_index = active
        if mode == 'EDIT':
            edit_mode()
        assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
        found.append(uvs(obj))
    assert np.array_equal(*found)


@pytest.mark.parametrize("active", [0, 1])
def test_what_is_being_edited_counts_and_is_kept(active):
    obj = with_keys()
    obj.active_shape_key_index = active
    edit_mode()
    bm = bmesh.from_edit_mesh(obj.data)
    bm.verts.ensure_lookup_table()
    bm.verts[40].co.z += 0.3
    bmesh.update_edit_mesh(obj.data)
    kinds = ("scenes", "objects", "meshes", "shape_keys")
    counts = [len(getattr(bpy.data, kind)) for kind in kinds]
    read = [mesh_arrays.read(obj).vertices for _ in range(2)]
    assert [len(getattr(bpy.data, kind)) for kind in kinds] == counts, "nothing is left behind"
    bpy.ops.object.mode_set(mode='OBJECT')
    bpy.context.view_layer.update()
    expected = seen_in_object_mode(obj)
    assert np.allclose(read[0], expected, atol=1e-6) and np.array_equal(*read)


def test_values_that_are_animated_are_those_of_the_current_frame():
    obj = with_keys(0.0)
    key = obj.data.shape_keys.key_blocks["One"]
    for frame in (1, 11):
        key.value = (frame - 1) / 10
        key.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_set(6)
    expected = seen_in_object_mode(obj)
    assert expected[:, 2].max() > 0.1
    assert np.allclose(mesh_arrays.read(obj).vertices, expected, atol=1e-6)


def test_subdivision_smooths_the_shape_that_is_seen():
    obj = with_keys(1.0)
    obj.modifiers.new("Subdivision", 'SUBSURF')
    flat = mesh_arrays.read(obj, MeshOptions(use_subsurf_data=False)).vertices[:, 2].max()
    smooth = mesh_arrays.read(obj, MeshOptions(use_subsurf_data=True)).vertices[:, 2].max()
    assert 0.5 * flat < smooth < flat
