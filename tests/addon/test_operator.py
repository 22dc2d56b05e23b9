# SPDX-License-Identifier: GPL-3.0-or-later
import dataclasses
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import pytest
from scenes import add_cube, add_grid, changes, edit_mode, snapshot, uvs

from qh_unwrap.addon import operators, panels, properties
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.core import Settings

_FIELDS = [field for kind in (Settings, MeshOptions) for field in dataclasses.fields(kind)]


def unwrap(**options):
    return bpy.ops.uv.qh_unwrap(**options)


def corners_of(obj, faces):
    return np.isin(np.repeat(np.arange(len(obj.data.polygons)), [p.loop_total for p in obj.data.polygons]), faces)


# What is unwrapped, and what is left alone


def test_unwraps_selected_faces_only():
    obj = add_grid(6)
    chosen = [7, 8, 13, 14]
    edit_mode(lambda _, face: face in chosen)
    before, old = snapshot(obj), uvs(obj)
    assert unwrap() == {'FINISHED'}
    assert changes(before, snapshot(obj)) == {"UVMap"}
    inside = np.repeat(np.isin(np.arange(36), chosen), 4)
    assert np.array_equal(uvs(obj)[~inside], old[~inside])
    assert not np.array_equal(uvs(obj)[inside], old[inside])
    (outcome,) = operators.last_outcomes
    assert (outcome.faces, outcome.after.flips, outcome.error) == (4, 0, "")


def test_changes_nothing_but_the_active_map():
    obj = add_grid(5)
    mesh = obj.data
    mesh.uv_layers.new(name="Other")
    mesh.uv_layers.new(name="Target")
    mesh.uv_layers.active = mesh.uv_layers["Target"]
    mesh.uv_layers["UVMap"].active_render = True
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Key").data[3].co.z = 0.7
    obj.vertex_groups.new(name="Group").add([1, 2, 3], 0.5, 'REPLACE')
    mesh.color_attributes.new("Colour", 'BYTE_COLOR', 'CORNER')
    edit_mode(lambda _, face: face not in (3, 4))
    bm = bmesh.from_edit_mesh(mesh)
    bm.faces.ensure_lookup_table()
    bm.faces[4].hide_set(True)
    bm.faces.active = bm.faces[6]
    bm.select_history.add(bm.faces[6])
    bm.loops.layers.uv["Target"]
    for loop in bm.faces[3].loops:
        loop[bm.loops.layers.uv["Target"]].pin_uv = True
    bmesh.update_edit_mesh(mesh)
    render = [layer.active_render for layer in mesh.uv_layers]
    before, old = snapshot(obj), uvs(obj)
    assert unwrap() == {'FINISHED'}
    assert changes(before, snapshot(obj)) == {"Target"}
    assert [layer.active_render for layer in mesh.uv_layers] == render
    spared = np.repeat(np.isin(np.arange(25), [3, 4]), 4)
    assert np.array_equal(uvs(obj)[spared], old[spared])
    before_keys = before["shape layers"]
    bpy.ops.object.mode_set(mode='OBJECT')
    assert snapshot(obj)["shape keys"] == before_keys


def test_hidden_faces_are_never_unwrapped():
    obj = add_grid(4)
    obj.data.polygons[5].hide = True
    old = uvs(obj)
    assert unwrap() == {'FINISHED'}
    hidden = corners_of(obj, [5])
    assert np.array_equal(uvs(obj)[hidden], old[hidden])
    assert sum(outcome.faces for outcome in operators.last_outcomes) == 15


def test_object_mode_takes_all_faces_of_selected_objects():
    one, other, unselected = add_grid(3, "One"), add_grid(4, "Other", location=(3, 0, 0)), add_grid(3, "Third")
    edit_mode(lambda _, face: face == 0)
    bpy.ops.object.mode_set(mode='OBJECT')
    unselected.select_set(False)
    before, third = snapshot(one), snapshot(unselected)
    assert unwrap() == {'FINISHED'}
    assert changes(before, snapshot(one)) == {"UVMap"}
    assert {(outcome.obj, outcome.faces) for outcome in operators.last_outcomes} == {("One", 9), ("Other", 16)}
    assert snapshot(unselected) == third and other.mode == 'OBJECT'


def test_several_objects_in_edit_mode():
    one, other = add_grid(4, "One"), add_grid(4, "Other", location=(3, 0, 0))
    edit_mode(lambda obj, face: obj == one or face < 8)
    before = {obj: snapshot(obj) for obj in (one, other)}
    active = bpy.context.view_layer.objects.active
    assert unwrap() == {'FINISHED'}
    for obj in (one, other):
        assert changes(before[obj], snapshot(obj)) == {"UVMap"}
    assert bpy.context.view_layer.objects.active == active
    assert set(bpy.context.objects_in_mode) == {one, other}
    assert {(outcome.obj, outcome.faces) for outcome in operators.last_outcomes} == {("One", 16), ("Other", 8)}


def test_object_in_edit_mode_need_not_be_selected():
    one, other = add_grid(3, "One"), add_grid(3, "Other")
    bystander = add_grid(3, "Bystander")
    bystander.select_set(False)
    bpy.context.view_layer.objects.active = one
    edit_mode()
    other.select_set(False)
    bystander.select_set(True)
    assert unwrap() == {'FINISHED'}
    assert set(bpy.context.objects_in_mode) == {one, other}
    assert [obj.select_get() for obj in (one, other, bystander)] == [True, False, True]
    assert bystander.mode == 'OBJECT'


def test_linked_duplicates_are_unwrapped_once():
    obj = add_grid(3)
    twin = bpy.data.objects.new("Twin", obj.data)
    bpy.context.collection.objects.link(twin)
    twin.select_set(True)
    assert unwrap() == {'FINISHED'}
    assert len(operators.last_outcomes) == 1
    bpy.ops.object.mode_set(mode='EDIT')
    editing = list(bpy.context.objects_in_mode)
    bpy.ops.mesh.select_all(action='SELECT')
    assert unwrap() == {'FINISHED'}
    assert list(bpy.context.objects_in_mode) == editing and len(operators.last_outcomes) == 1


def test_concave_ngon():
    mesh = bpy.data.meshes.new("Letter")
    outline = [(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]
    mesh.from_pydata([*outline, (-2, 1, 1)], [], [[0, 1, 2, 3, 4, 5], [0, 5, 6]])
    obj = bpy.data.objects.new("Letter", mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    assert unwrap() == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    assert (outcome.faces, outcome.after.flips, outcome.after.collapsed) == (2, 0, 0)
    assert len(np.unique(uvs(obj), axis=0)) == 7


def test_vertex_between_two_quads_only():
    """As a dissolved edge leaves it: Blender cuts both quads along the same diagonal."""
    mesh = bpy.data.meshes.new("Doublet")
    points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 1, 0), (1, -1, 0)]
    mesh.from_pydata(points, [], [[0, 1, 2, 3], [2, 1, 0, 4]])
    obj = bpy.data.objects.new("Doublet", mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    assert unwrap() == {'FINISHED'}
    (outcome,) = operators.last_outcomes
    # Of both triangles with the same corners one is flipped in any map.
    assert (outcome.after.flips, outcome.after.collapsed) == (1, 0) and not outcome.injective
    assert any("same diagonal: triangulate them" in text for text in outcome.warnings)


def test_seams_split_and_open():
    obj = add_grid(4)
    for edge in obj.data.edges:
        one, other = (obj.data.vertices[index].co for index in edge.vertices)
        edge.use_seam = abs(one.x) < 1e-6 and abs(other.x) < 1e-6
    assert unwrap() == {'FINISHED'}
    assert [outcome.faces for outcome in operators.last_outcomes] == [8, 8]


def test_scale_of_the_object_counts():
    """A square grid stretched into a 4:1 strip unwraps as the strip that one sees."""
    obj = add_grid(8)
    for vertex in obj.data.vertices:
        vertex.co.z = 0
    obj.scale.x = 4
    bpy.context.view_layer.update()
    unwrap(boundary='RECTANGLE', aspect=0, placement='UNIT', iterations=20)
    width, height = np.ptp(uvs(obj), axis=0)
    assert max(width, height) / min(width, height) == pytest.approx(4, rel=0.02)


# UV maps


def test_without_a_map_makes_one():
    obj = add_grid(4, uv=False)
    assert not obj.data.uv_layers
    assert unwrap() == {'FINISHED'}
    assert obj.data.uv_layers.keys() == ["UVMap"]
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1


def test_without_a_map_in_edit_mode():
    obj = add_grid(4, uv=False)
    edit_mode()
    assert unwrap() == {'FINISHED'}
    assert obj.data.uv_layers.keys() == ["UVMap"] and obj.mode == 'EDIT'
    assert np.ptp(uvs(obj), axis=0).min() > 0.5


def test_eight_maps_only_the_active_one_changes():
    obj = add_grid(3)
    for number in range(7):
        obj.data.uv_layers.new(name=f"Map {number}")
    obj.data.uv_layers.active = obj.data.uv_layers["Map 4"]
    before = snapshot(obj)
    assert unwrap() == {'FINISHED'}
    assert changes(before, snapshot(obj)) == {"Map 4"}


def test_kept_outline_and_pins_stay_exactly():
    obj = add_grid(6)
    edit_mode()
    bm = bmesh.from_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    bm.verts.ensure_lookup_table()
    inner = next(vertex for vertex in bm.verts if not vertex.is_boundary)
    for loop in inner.link_loops:
        loop[layer].pin_uv = True
        loop[layer].uv.x += 0.02
    held = np.array([loop.vert == inner or loop.vert.is_boundary for face in bm.faces for loop in face.loops])
    bmesh.update_edit_mesh(obj.data)
    before, old = snapshot(obj), uvs(obj)
    assert unwrap(boundary='KEEP', placement='PACK') == {'FINISHED'}
    assert changes(before, snapshot(obj)) == {"UVMap"}
    new = uvs(obj)
    # Blender's own corners at a vertex differ in the last bit; now they agree, on one of them.
    vertex = np.array([loop.vertex_index for loop in obj.data.loops])
    for k in np.unique(vertex[held]):
        assert (new[vertex == k] == new[vertex == k][0]).all()
        assert (new[vertex == k][0] == old[vertex == k]).all(axis=1).any()
    assert not np.array_equal(new[~held], old[~held])
    assert operators.last_outcomes[0].after.flips == 0 and operators.last_outcomes[0].injective


def test_kept_outline_of_mirrored_uvs():
    obj = add_grid(4)
    mirrored = uvs(obj) * (-1, 1)
    obj.data.uv_layers.active.uv.foreach_set("vector", mirrored.astype(np.float32).ravel())
    assert unwrap(boundary='KEEP') == {'FINISHED'}
    assert operators.last_outcomes[0].after.flips == 0


def test_kept_outline_needs_uvs():
    add_grid(4, uv=False)
    with pytest.raises(RuntimeError, match=r"Grid \(16 faces\)"):
        unwrap(boundary='KEEP')


def test_kept_outline_needs_seams_at_its_cuts():
    obj = add_grid(2)
    moved = uvs(obj)
    moved[:4] += 1
    obj.data.uv_layers.active.uv.foreach_set("vector", moved.ravel())
    with pytest.raises(RuntimeError, match="Seams from Islands"):
        unwrap(boundary='KEEP')
    assert np.array_equal(uvs(obj), moved)
    assert unwrap() == {'FINISHED'}, "another boundary joins them again"
    assert len(np.unique(uvs(obj), axis=0)) == 9


# Failures


def test_failure_leaves_the_mesh_as_it_was():
    obj = add_cube()
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match=r"Cube \(6 faces\) is closed: mark a seam"):
        unwrap()
    assert snapshot(obj) == before
    edit_mode()
    before = snapshot(obj)
    with pytest.raises(RuntimeError, match=r"Cube \(6 faces\)"):
        unwrap()
    assert snapshot(obj) == before


def test_failure_leaves_no_new_map():
    bpy.ops.mesh.primitive_cube_add(calc_uvs=False)
    with pytest.raises(RuntimeError):
        unwrap()
    assert not bpy.context.object.data.uv_layers


def test_island_fails_alone():
    grid, cube = add_grid(3), add_cube()
    before = snapshot(cube)
    assert unwrap() == {'FINISHED'}
    assert snapshot(cube) == before
    outcomes = {outcome.obj: outcome for outcome in operators.last_outcomes}
    assert outcomes["Cube"].error and not outcomes["Grid"].error
    assert np.ptp(uvs(grid), axis=0).min() > 0


def test_poll_says_what_is_needed():
    bpy.ops.object.camera_add()
    with pytest.raises(RuntimeError, match="Needs a mesh"):
        unwrap()


def test_leaves_no_data_behind():
    obj = add_grid(4, uv=False)
    kinds = ("meshes", "objects", "scenes", "collections")
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    edit_mode()
    unwrap(placement='PACK')
    assert {kind: len(getattr(bpy.data, kind)) for kind in kinds} == before
    assert bpy.context.object == obj


# Undo


@pytest.mark.parametrize("mode", ['EDIT', 'OBJECT'])
@pytest.mark.parametrize("placement", ['ORIGINAL', 'PACK'])
def test_undo_and_redo(mode, placement):
    names = [add_grid(4, "One").name, add_grid(5, "Other", location=(3, 0, 0)).name]
    if mode == 'EDIT':
        edit_mode(lambda _, face: face < 8)

    def now():
        return np.concatenate([uvs(bpy.data.objects[name]) for name in names])

    before = now()
    bpy.ops.ed.undo_push()
    assert bpy.ops.uv.qh_unwrap(True, placement=placement) == {'FINISHED'}
    after = now()
    assert not np.array_equal(before, after)
    bpy.ops.ed.undo()
    assert np.array_equal(now(), before)
    bpy.ops.ed.redo()
    assert np.array_equal(now(), after)
    assert bpy.data.objects[names[0]].mode == mode and len(bpy.data.scenes) == 1


@pytest.mark.parametrize("mode", ['EDIT', 'OBJECT'])
def test_copies_of_the_mesh_are_left_alone(mode):
    """Blender shares the arrays of a mesh with its copies until one of them changes."""
    obj = add_grid(4)
    if mode == 'EDIT':
        edit_mode()
    twin = bpy.data.objects.new("Twin", obj.data.copy())
    old = uvs(twin)
    assert unwrap() == {'FINISHED'}
    assert np.array_equal(uvs(twin), old) and not np.array_equal(uvs(obj), old)


def test_undo_removes_the_new_map_in_object_mode():
    name = add_grid(4, uv=False).name
    bpy.ops.ed.undo_push()
    bpy.ops.uv.qh_unwrap(True)
    after = uvs(bpy.data.objects[name])
    bpy.ops.ed.undo()
    assert not bpy.data.objects[name].data.uv_layers and len(bpy.data.scenes) == 1
    bpy.ops.ed.redo()
    assert np.array_equal(uvs(bpy.data.objects[name]), after) and len(bpy.data.scenes) == 1


# Properties


def test_operator_has_every_setting():
    properties = bpy.ops.uv.qh_unwrap.get_rna_type().properties
    assert [name for name in properties.keys() if name != "rna_type"] == [field.name for field in _FIELDS]  # noqa: SIM118
    for field in _FIELDS:
        found, meta = properties[field.name], field.metadata
        default = pytest.approx(field.default) if type(field.default) is float else field.default
        assert (found.default, found.name, found.description) == (default, meta["label"], meta["description"])
        if meta["choices"]:
            assert [item.identifier for item in found.enum_items] == [choice.identifier for choice in meta["choices"]]
        elif type(field.default) not in (bool, str):
            assert (found.hard_min, found.hard_max) == pytest.approx(meta["range"])
            assert (found.soft_min, found.soft_max) == pytest.approx(meta["soft_range"])


def test_smallest_and_largest_values_are_accepted():
    """Blender rounds them to 32 bits, which must not put them out of range."""
    scene = bpy.context.scene.qh_unwrap
    for field in _FIELDS:
        for value in field.metadata["range"] or ():
            setattr(scene, field.name, value)
            assert scene.as_keywords()[field.name] == pytest.approx(value)


def test_scene_has_the_same_settings():
    assert bpy.context.scene.qh_unwrap.as_keywords() == dataclasses.asdict(Settings()) | dataclasses.asdict(
        MeshOptions()
    )


def test_settings_reach_the_core():
    add_grid(4)
    unwrap(iterations=1, weights='MEAN_VALUE', boundary='CIRCLE')
    assert operators.last_outcomes[0].iterations == 1
    unwrap(iterations=0, refine=0)
    assert operators.last_outcomes[0].iterations == 0


class Layout:
    """Stands for a layout of Blender's and notes what is drawn into it."""

    def __init__(self):
        self.rows, self.labels, self.buttons, self.parts = [], [], [], []

    def row(self, **_options):
        self.parts.append(Layout())
        return self.parts[-1]

    column = row

    def panel(self, idname, default_closed=False):
        return self.row(), self.row()

    def prop_search(self, owner, name, _data, _search):
        self.prop(owner, name)

    def prop(self, owner, name):
        assert hasattr(owner, name)
        self.rows.append(name)

    def label(self, text, icon='NONE'):
        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        self.labels.append(text)

    def operator(self, idname, **_options):
        self.buttons.append((idname, SimpleNamespace()))
        return self.buttons[-1][1]

    def all(self, what):
        return getattr(self, what) + [item for part in self.parts for item in part.all(what)]


def drawn(panel):
    layout = Layout()
    panel.draw(SimpleNamespace(layout=layout), bpy.context)
    return layout


@pytest.mark.parametrize("panel", [panels.QH_PT_uv_editor, panels.QH_PT_view_3d])
def test_panel_passes_the_scenes_settings_to_its_button(panel):
    bpy.context.scene.qh_unwrap.iterations = 3
    bpy.context.scene.qh_unwrap.boundary = 'RECTANGLE'
    bpy.context.scene.qh_unwrap.texel_density = 'GIVEN'
    bpy.context.scene.qh_unwrap.use_weights = True
    layout = drawn(panel)
    assert sorted(layout.all("rows")) == sorted(field.name for field in _FIELDS)
    buttons = dict(layout.all("buttons"))
    button = buttons.pop("uv.qh_unwrap")
    assert list(buttons) == ["uv.qh_check"]
    assert vars(button) == bpy.context.scene.qh_unwrap.as_keywords()
    assert (button.iterations, button.boundary) == (3, 'RECTANGLE')


def test_scripts_get_the_operators_own_defaults():
    bpy.context.scene.qh_unwrap.iterations = 0
    add_grid(4)
    unwrap()
    assert operators.last_outcomes[0].iterations > 0


def test_operator_forgets_what_a_script_set():
    add_grid(4)
    unwrap(iterations=0, refine=0)
    assert operators.last_outcomes[0].iterations == 0
    unwrap()
    assert operators.last_outcomes[0].iterations > 0


def test_menu_takes_the_panels_settings_and_keywords_win():
    class Operator(properties.OperatorProperties):
        """Stands for an operator that was called with some keywords."""

        def __init__(self, **keywords):
            self.properties = SimpleNamespace(is_property_set=keywords.__contains__)
            vars(self).update(keywords)

    scene = bpy.context.scene.qh_unwrap
    scene.iterations, scene.boundary = 3, 'CIRCLE'
    operator = Operator(iterations=9)
    operator.take_unset_from(scene)
    assert operator.as_keywords() == scene.as_keywords() | {"iterations": 9}


def test_panel_shows_the_last_result():
    add_grid(4)
    add_cube()
    unwrap()
    text = "\n".join(drawn(panels.QH_PT_view_3d_report).all("labels"))
    assert "Grid (16 faces)" in text and "no flips" in text
    assert "Cube (6 faces)" in text and "seam" in text


def test_menu_entry_appears_once():
    def count(menu):
        return menu._dyn_ui_initialize().count(panels.draw_menu)

    assert count(bpy.types.IMAGE_MT_uvs_unwrap) == 1
    assert count(bpy.types.VIEW3D_MT_uv_map) == count(bpy.types.IMAGE_MT_uvs) == 0
