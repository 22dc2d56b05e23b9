# SPDX-License-Identifier: GPL-3.0-or-later
"""The heatmap's colors and words, how it follows, and that it leaves no trace in the file."""

import bpy  # isort: skip
import bmesh
import numpy as np
import pytest
from everything_in_file import differences, everything
from scenes import add_cube, add_grid, edit_mode, mesh_object

from qh_unwrap.addon import evaluated, heat, heat_drawing
from qh_unwrap.addon.heatmap import heatmap
from qh_unwrap.addon.options import HeatSettings
from qh_unwrap.core import distortion

RED, BLUE, WHITE = (0.70, 0.02, 0.08), (0.08, 0.30, 0.60), (0.97, 0.97, 0.95)


@pytest.fixture(autouse=True)
def _off():
    yield
    heatmap.turn_off()


def turn_on(*objects):
    heatmap.turn_on(objects, heat_drawing.add)


def read(obj):
    bpy.context.view_layer.update()
    return evaluated.read(obj, bpy.context.view_layer)


def colours(obj, **settings):
    """The colors of the object's triangles, and the legend."""
    (found,), legend = heat.coloured([heat.measured(read(obj))], HeatSettings(**settings))
    return found, legend


def set_uvs(obj, change):
    """Have `change(u, v)` move the UVs, in any mode."""
    if obj.mode == 'EDIT':
        bm = bmesh.from_edit_mesh(obj.data)
        layer = bm.loops.layers.uv.active
        for face in bm.faces:
            for loop in face.loops:
                loop[layer].uv = change(*loop[layer].uv)
        bmesh.update_edit_mesh(obj.data)
    else:
        for each in obj.data.uv_layers.active.uv:
            each.vector = change(*each.vector)
        obj.data.update()


def two_squares(width=1.0, apart=0.0, name="Squares"):
    """Two unit squares side by side, of which the second one is so wide in the map and so far from the other."""
    points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    obj = mesh_object(name, points, [(0, 1, 4, 3), (1, 2, 5, 4)])
    left, right = 1 + apart, 1 + apart + width
    uv = [(0, 0), (1, 0), (1, 1), (0, 1), (left, 0), (right, 0), (right, 1), (left, 1)]
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.array(uv, dtype=np.float32).ravel())
    return obj


# What the colors say


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_measures_are_those_of_the_core(mode):
    obj = add_grid(6)
    set_uvs(obj, lambda u, v: (u + 0.3 * v * v, v))
    bpy.ops.object.mode_set(mode=mode)
    shown = read(obj)
    found = heat.measured(shown)
    points, triangles = shown.points.astype(float), shown.corner_vertex[found.corners]
    uv = np.empty((len(points), 2))
    uv[shown.corner_vertex] = shown.uv
    expected = distortion(points, triangles, uv)
    assert found.stretch == pytest.approx(expected.triangle_stretch, rel=1e-5)
    assert found.angle == pytest.approx(expected.triangle_angle, rel=1e-5)
    assert found.log_area == pytest.approx(expected.triangle_log_area, abs=1e-5)
    assert not found.wrong.any() and found.area.sum() == pytest.approx(expected_area(points, triangles))


def expected_area(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_red_is_what_gets_little_of_the_image_and_blue_what_gets_much():
    found, legend = colours(
        two_squares(width=1 / 9), quantity='AREA', limit=1.8
    )  # areas 9 : 1, 1.8 and 0.2 of the mean
    assert found[:2] == pytest.approx(np.tile(BLUE, (2, 1)), abs=1e-3)
    assert found[2:] == pytest.approx(np.tile(RED, (2, 1)))
    assert legend.ticks == ("× 1.8", "1", "1/1.8")
    assert legend.lines[0] == "Red: 1/1.8 of its share of the image, or less"
    assert "Of the surface 50 % is that red" in legend.lines[2]


def test_each_island_has_its_own_share_and_texel_density_compares_all():
    obj = two_squares(width=0.25, apart=0.5)
    assert colours(obj, quantity='AREA')[0] == pytest.approx(np.tile(WHITE, (4, 1)), abs=1e-3)
    found, legend = colours(obj, quantity='DENSITY', limit=1.05)
    assert found[:2] == pytest.approx(np.tile(BLUE, (2, 1)), abs=1e-3)
    assert found[2:] == pytest.approx(np.tile(RED, (2, 1)), abs=1e-3)
    assert (
        legend.ticks[1] == "810" and "As if what has no image had one of 1024 pixels" in legend.lines
    )  # of 1024^2 · 5/8


def test_texel_density_goes_by_the_image_the_scale_and_the_unit():
    obj = two_squares()
    image = bpy.data.images.new("Image", 512, 128)
    material = bpy.data.materials.new("Material")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = image
    obj.data.materials.append(material)
    obj.scale = (2, 2, 2)
    bpy.context.scene.unit_settings.scale_length = 0.5
    legend = colours(obj, quantity='DENSITY')[1]
    assert legend.ticks[1] == "256" and "no image" not in " ".join(legend.lines)
    assert heat.measured(read(obj)).angle == pytest.approx(4)  # squares become four times as wide as high


def test_red_in_angle_is_what_is_no_square_any_more():
    obj = add_grid(3)
    for vertex in obj.data.vertices:
        vertex.co.z = 0
    obj.scale = (1.5, 1, 1)
    found, legend = colours(obj, quantity='ANGLE', limit=1.5)
    assert found == pytest.approx(np.tile(RED, (len(found), 1)), abs=1e-3)
    assert legend.ticks == ("1", "1.22", "1.5")
    assert legend.lines == (
        "Red: squares become 1.5 times as long as wide, or longer",
        "Half below 1.5, 95 % below 1.5; 100 % of the surface is that red",
    )


def test_a_face_has_one_color():
    obj = mesh_object("Kite", [(0, 0, 0), (1, 0, 0), (1, 1, 0.5), (0, 1, 0)], [(0, 1, 2, 3)])
    obj.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.array([0, 0, 1, 0, 3, 1, 0, 1], dtype=np.float32))
    found, _ = colours(obj, quantity='AREA')
    assert (found[0] == found[1]).all() and not np.allclose(found[0], WHITE, atol=0.05)


def test_flipped_and_collapsed_triangles_and_unset_ones_are_black():
    obj = add_grid(6)
    values = obj.data.uv_layers.active.uv
    values[0].vector, values[1].vector = values[1].vector.copy(), values[0].vector.copy()  # faces 0, 5 and 10 are apart
    for loop in obj.data.polygons[5].loop_indices:
        values[loop].vector = (0, 0)
    values[obj.data.polygons[10].loop_start].vector = (np.nan, 0)
    found, legend = colours(obj)
    black = (found == np.float32(heat.WRONG)).all(axis=1)
    assert set(heat.measured(read(obj)).face[black].tolist()) == {0, 5, 10}
    assert legend.lines[-1].endswith("triangles are flipped or without area in the map")


def test_what_has_no_uvs_is_told():
    grid, bare = add_grid(), add_cube()
    bare.data.uv_layers.remove(bare.data.uv_layers[0])
    bare.data.update()
    heats = [heat.measured(read(obj)) for obj in (grid, bare)]
    found, legend = heat.coloured(heats, HeatSettings())
    assert found[1] is None and legend.lines[-1] == "Gray: no UVs"


def test_nothing_to_show_has_a_legend():
    for quantity in ('STRETCH', 'ANGLE', 'AREA', 'DENSITY'):
        assert heat.coloured([None], HeatSettings(quantity=quantity))[1].title


def test_hidden_faces_are_not_shown_in_edit_mode():
    obj = add_grid()
    obj.data.polygons[0].hide = True
    assert len(heat.measured(read(obj)).face) == 32  # as Object Mode shows it
    edit_mode()
    assert len(heat.measured(read(obj)).face) == 30


def test_modifiers_are_shown():
    obj = add_grid()
    obj.modifiers.new("Subdivision", 'SUBSURF').levels = 1
    for mode in ('OBJECT', 'EDIT'):
        bpy.ops.object.mode_set(mode=mode)
        shown = read(obj)
        assert len(shown.triangles) == 128 and len(heat.measured(shown).stretch) == 128


def test_outlines_are_those_of_the_map():
    obj = add_grid(4)
    assert len(heat.measured(read(obj)).outline) == 16
    for loop in obj.data.polygons[5].loop_indices:
        obj.data.uv_layers.active.uv[loop].vector.x += 3
    assert len(heat.measured(read(obj)).outline) == 24


# While it is on


def test_it_leaves_the_file_as_it_was(tmp_path):
    one, other = add_grid(4, "One"), add_grid(4, "Other", location=(3, 0, 0))
    one.data.materials.append(bpy.data.materials.new("Material"))
    edit_mode(lambda obj, face: face % 3 == 0)
    use()
    everything()  # reading some of it makes it
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "without.blend"), copy=True)
    before = everything()
    turn_on(one, other)
    assert not differences(before, everything())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "with.blend"), copy=True)
    use()
    heatmap.colour(HeatSettings(quantity='AREA'))
    heatmap.turn_off()
    assert not differences(before, everything())
    saved = []
    for name in ("without", "with"):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / f"{name}.blend"))
        everything()
        saved.append(everything())
    assert not differences(*saved)


def use():
    """Go through modes and selections, and end with some faces selected in Edit Mode."""
    for mode in ('OBJECT', 'SCULPT', 'OBJECT', 'EDIT'):
        bpy.ops.object.mode_set(mode=mode)
        heatmap.refresh()
    bpy.ops.mesh.select_all(action='SELECT')
    heatmap.refresh()
    edit_mode(lambda obj, face: face % 3 == 0)
    bpy.context.view_layer.update()
    heatmap.refresh()


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_it_follows_the_uvs(mode):
    obj = add_grid()
    bpy.ops.object.mode_set(mode=mode)
    turn_on(obj)
    (entry,) = heatmap.entries
    before = entry.heat
    set_uvs(obj, lambda u, v: (u * u, v))
    bpy.context.view_layer.update()
    assert bpy.app.timers.is_registered(heatmap.again)
    heatmap.refresh()
    assert entry.heat is not before and not np.allclose(entry.heat.angle, before.angle)


def test_it_follows_the_shape_but_not_the_place():
    obj = add_grid()
    turn_on(obj)
    (entry,) = heatmap.entries
    before = entry.heat
    obj.location.x = 3
    bpy.context.view_layer.update()
    heatmap.refresh()
    assert entry.heat is before
    obj.scale.x = 3
    bpy.context.view_layer.update()
    heatmap.refresh()
    assert entry.heat is not before


def test_selecting_measures_nothing_anew():
    obj = add_grid()
    edit_mode()
    turn_on(obj)
    (entry,) = heatmap.entries
    before = entry.heat
    bpy.ops.mesh.select_all(action='DESELECT')
    bpy.context.view_layer.update()
    heatmap.refresh()
    assert entry.heat is before


def test_other_objects_measure_nothing_anew():
    shown, other = add_grid(name="Shown"), add_grid(name="Other")
    turn_on(shown)
    set_uvs(other, lambda u, v: (u * u, v))
    bpy.context.view_layer.update()
    assert not heatmap.entries[0].is_stale


def test_it_follows_undo_and_another_name():
    obj = add_grid()
    bpy.ops.ed.undo_push()
    turn_on(obj)
    before = heatmap.entries[0].heat.angle.copy()
    edit_mode()
    bpy.ops.ed.undo_push()
    bpy.ops.uv.qh_unwrap(True)
    heatmap.refresh()
    assert not np.allclose(heatmap.entries[0].heat.angle, before)
    bpy.ops.ed.undo()
    heatmap.refresh()
    assert heatmap.entries[0].heat.angle == pytest.approx(before)
    bpy.data.objects["Grid"].name = "Renamed"
    assert heatmap.entries[0].find().name == "Renamed"


def test_an_object_that_goes_is_left_out():
    one, other = add_grid(name="One"), add_grid(name="Other")
    turn_on(one, other)
    bpy.data.objects.remove(one)
    bpy.context.view_layer.update()
    heatmap.look_again()
    heatmap.refresh()
    assert [entry.find() for entry in heatmap.entries] == [None, other]


def test_another_file_ends_it(tmp_path):
    turn_on(add_grid())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    assert heatmap.is_on
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "file.blend"))
    assert not heatmap.is_on


def test_nothing_is_left_behind_once_it_is_off():
    before = [len(each) for each in handlers()]
    turn_on(add_grid())
    assert [len(each) for each in handlers()] != before
    heatmap.look_again()
    heatmap.turn_off()
    assert [len(each) for each in handlers()] == before and not bpy.app.timers.is_registered(heatmap.again)


def handlers():
    its = bpy.app.handlers
    return [its.depsgraph_update_post, its.undo_post, its.redo_post, its.frame_change_post, its.load_pre]


def test_without_a_window_it_says_what_it_needs():
    add_grid()
    with pytest.raises(RuntimeError, match="Needs Blender's window"):
        bpy.ops.uv.qh_heatmap()
