# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist had before is there again afterwards: modes, hiding, selection, and which UV map is worked on."""

import bpy
import numpy as np
import pytest
from scenes import add_cube, add_grid, edit_mode, uvs

from qh_unwrap.addon import mesh_arrays, modes


def hide(obj):
    obj.hide_set(True)


def hide_in_viewports(obj):
    obj.hide_viewport = True


def hide_collection(obj):
    bpy.context.view_layer.layer_collection.children[obj.name].hide_viewport = True


def hide_collection_in_viewports(obj):
    bpy.data.collections[obj.name].hide_viewport = True


def exclude_collection(obj):
    bpy.context.view_layer.layer_collection.children[obj.name].exclude = True


def forbid_selection(obj):
    obj.hide_select = True


def deselect(obj):
    obj.select_set(False)


_WAYS = (
    hide,
    hide_in_viewports,
    hide_collection,
    hide_collection_in_viewports,
    exclude_collection,
    forbid_selection,
    deselect,
)


def scene():
    """Two grids in Edit Mode, each in a collection of its own name, beside a cube that is selected and not edited."""
    objects = add_grid(4, "One"), add_grid(4, "Other", uv=False, location=(3, 0, 0)), add_cube("Bystander")
    for obj in objects[:2]:
        collection = bpy.data.collections.new(obj.name)
        bpy.context.scene.collection.children.link(collection)
        bpy.context.scene.collection.objects.unlink(obj)
        collection.objects.link(obj)
        obj.select_set(True)
    objects[2].select_set(False)
    bpy.context.view_layer.objects.active = objects[0]
    edit_mode()
    objects[2].select_set(True)
    return objects


def state(objects):
    view_layer = bpy.context.view_layer
    view_layer.update()
    active = view_layer.objects.active
    return (
        bpy.context.mode,
        active and active.name,
        list(bpy.context.objects_in_mode),
        [
            (obj.mode, obj.hide_viewport, obj.hide_select)
            + ((obj.select_get(), obj.hide_get(), obj.visible_get()) if obj.name in view_layer.objects else ())
            for obj in objects
        ],
    )


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("way", _WAYS)
def test_objects_return_to_edit_mode_whatever_hides_them(way, index):
    objects = scene()
    way(objects[index])
    before = state(objects)
    assert [obj.mode for obj in objects] == ['EDIT', 'EDIT', 'OBJECT']
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert state(objects) == before


@pytest.mark.parametrize("way", _WAYS)
def test_objects_return_to_edit_mode_when_writing_fails(way, monkeypatch):
    objects = scene()
    way(objects[1])
    before = state(objects)

    def fails(*_arguments):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(mesh_arrays, "write", fails)
    with pytest.raises(RuntimeError, match="by zero"):
        bpy.ops.uv.qh_unwrap()
    assert state(objects) == before


def test_an_active_object_that_is_not_edited_stays_active():
    objects = scene()
    bpy.context.view_layer.objects.active = objects[2]
    before = state(objects)
    with modes.in_object_mode(bpy.context):
        assert [obj.mode for obj in objects] == ['OBJECT', 'OBJECT', 'OBJECT']
    assert state(objects) == before


@pytest.mark.parametrize("boundary", ['FREE', 'KEEP'])
@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_the_first_map_counts_where_none_is_active(mode, boundary):
    """Blender 5 leaves none active where the active one is removed as an attribute."""
    obj = add_grid(5)
    mesh = obj.data
    mesh.uv_layers.new(name="Other")
    mesh.uv_layers.new(name="Active")
    mesh.uv_layers.active_index = 2
    mesh.attributes.remove(mesh.attributes["Active"])
    names, active = mesh.uv_layers.keys(), mesh.uv_layers.active and mesh.uv_layers.active.name
    old = {name: uvs(obj, name) for name in names}
    if mode == 'EDIT':
        edit_mode()
    assert bpy.ops.uv.qh_unwrap(boundary=boundary) == {'FINISHED'}
    if mode == 'EDIT':
        bpy.ops.object.mode_set(mode='OBJECT')
    assert mesh.uv_layers.keys() == names == ["UVMap", "Other"]
    changed = [name for name in names if not np.array_equal(uvs(obj, name), old[name])]
    assert changed == [active or "UVMap"]
