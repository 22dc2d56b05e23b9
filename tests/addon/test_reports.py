# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of thousands of islands fits in a few lines, and leads to those that need a look."""

import dataclasses
from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import pytest
from scenes import add_cube, add_grid, edit_mode, mesh_object, uvs

from qh_unwrap import cli
from qh_unwrap.addon import files, operators, panels, selection
from qh_unwrap.addon.last_run import last_run
from qh_unwrap.addon.outcome import Outcome, error_sentences, sentences, summary


def fins(count):
    """Stars of three squares at an edge: each square is an island that ends where more than two faces meet."""
    points, faces = [], []
    for k in range(count):
        first = len(points)
        points += [(3 * k, 0, 0), (3 * k, 1, 0)]
        for x, z in ((1, 0), (-1, 0), (0, 1)):
            second = len(points)
            points += [(3 * k + x, 0, z), (3 * k + x, 1, z)]
            faces.append([first, second, second + 1, first + 1])
    return mesh_object("Fins", points, faces)


def cubes(count):
    """Closed boxes in one mesh."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    points = np.concatenate([corners + (2 * k, 0, 0) for k in range(count)])
    faces = np.concatenate([sides + 8 * k for k in range(count)])
    return mesh_object("Cubes", points.tolist(), faces.tolist())


def test_warnings_of_one_kind_are_one_line():
    fins(50)
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert len(operators.last_outcomes) == 150
    assert list(sentences(operators.last_outcomes)) == [
        "150 islands (first: Fins, island 1): it ends at 1 edge where more than two faces meet"
    ]


def test_texts_that_differ_in_their_numbers_are_of_one_kind():
    outcomes = [
        Outcome("Cube", number, np.arange(3), alone=False, error=error)
        for number, error in enumerate(
            (
                "1 face has zero area",
                "it is closed: mark a seam",
                "21 faces have zero area",
                "it is closed: mark a seam",
            ),
            1,
        )
    ]
    assert error_sentences(outcomes) == [
        "2 islands (first: Cube, island 1): 1 face has zero area",
        "2 islands (first: Cube, island 2): it is closed: mark a seam",
    ]


def test_errors_of_one_kind_are_one_line(capfd):
    cubes(30)
    with pytest.raises(RuntimeError, match=r"Cubes, island 1 \(6 faces\) is closed: .* \(and 29 more\)"):
        bpy.ops.uv.qh_unwrap()
    assert len(error_sentences(operators.last_outcomes)) == 1


def test_errors_of_several_kinds_are_all_told():
    cubes(3)
    grid = add_grid(3)
    grid.data.vertices[5].co.x = np.nan
    add_grid(3, "Good", location=(0, 5, 0))
    for obj in bpy.context.scene.objects:
        obj.select_set(True)
    reports = []
    operator = SimpleNamespace(report=lambda kind, text: reports.append(text))
    bpy.ops.uv.qh_unwrap()
    assert operators.QH_OT_unwrap.finish(operator, (operators.last_outcomes, [])) == {'FINISHED'}
    assert len(reports) == 3 and "3 islands (first: Cubes, island 1): it is closed" in reports[0]
    assert reports[1].startswith("Grid (9 faces)") and "4 skipped: " in reports[2]


def test_command_line_tells_each_kind_once(tmp_path, capfd):
    cubes(5)
    add_grid(3)
    files.save(tmp_path / "in.blend")
    assert cli.main([str(tmp_path / "in.blend"), "--cut", "never"]) == 1
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert line.startswith("5 islands (first: Cubes, island 1): it is closed: mark a seam")


def test_command_line_says_when_nothing_is_visible(tmp_path, capfd):
    obj = add_grid(3)
    obj.data.polygons.foreach_set("hide", np.ones(9, dtype=bool))
    files.save(tmp_path / "in.blend")
    assert cli.main([str(tmp_path / "in.blend")]) == 3
    assert "there is nothing to unwrap: 1 object without visible faces: Grid" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("flips", "collapsed", "expected"),
    [(0, 0, "no flips"), (2, 0, "2 flips"), (0, 908, "908 collapsed"), (1, 908, "1 flip, 908 collapsed")],
)
def test_no_flips_is_not_said_of_a_collapsed_map(flips, collapsed, expected):
    add_grid(3)
    bpy.ops.uv.qh_unwrap()
    (outcome,) = operators.last_outcomes
    outcome.after = dataclasses.replace(outcome.after, flips=flips, collapsed=collapsed)
    assert summary([outcome]).endswith(f", {expected}")


# The panel


class Layout:
    """Stands for a layout of Blender's and notes the labels and buttons in their order."""

    def __init__(self, drawn=None):
        self.drawn = [] if drawn is None else drawn

    def column(self, **_options):
        return Layout(self.drawn)

    row = column

    def label(self, text, icon='NONE'):
        self.drawn.append(text)

    def operator(self, idname, **_options):
        button = SimpleNamespace(idname=idname)
        self.drawn.append(button)
        return button


def drawn():
    layout = Layout()
    panels.QH_PT_view_3d_report.draw(SimpleNamespace(layout=layout), bpy.context)
    texts = [each for each in layout.drawn if isinstance(each, str)]
    return texts, [each for each in layout.drawn if not isinstance(each, str)]


def test_panel_lists_first_what_needs_a_look():
    add_grid(3, "Clean")
    add_cube("Closed")
    for obj in bpy.context.scene.objects:
        obj.select_set(True)
    bpy.ops.uv.qh_unwrap()
    texts, buttons = drawn()
    assert texts.index("Closed (6 faces)") < texts.index("Clean (9 faces)")
    copy, *others = buttons
    selecting = [button for button in others if button.idname == "uv.qh_unwrap_select"]
    assert copy.idname == "uv.qh_unwrap_copy_report"
    assert [button.idname for button in others if button not in selecting] == ["uv.qh_unwrap_cut_closed"]
    assert [(button.object, button.island) for button in selecting] == 2 * [("Closed", 1)], "of the line, and its own"


def test_every_line_of_the_panel_leads_to_an_island():
    fins(3)
    bpy.ops.uv.qh_unwrap()
    texts, (_, button) = drawn()
    assert "9 islands (first: Fins," in " ".join(texts[:2])
    assert (button.object, button.island) == ("Fins", 1)


def test_panel_says_which_error_is_whose():
    add_cube("Closed")
    broken = add_grid(3, "Broken")
    broken.data.vertices[5].co.x = np.nan
    add_grid(3, "Clean", location=(3, 0, 0))
    for obj in bpy.context.scene.objects:
        obj.select_set(True)
    bpy.ops.uv.qh_unwrap()
    texts, _ = drawn()
    for name, word in (("Closed (6 faces)", "closed"), ("Broken (9 faces)", "coordinates")):
        assert word in " ".join(texts[texts.index(name) :][1:4])


def test_panel_is_short_whatever_there_is():
    fins(300)
    bpy.ops.uv.qh_unwrap()
    texts, _ = drawn()
    assert len(texts) < 40 and texts[-1] == "and 888 more"


# Select Island


def two_islands():
    obj = add_grid(4, "Panels")
    for edge in obj.data.edges:
        edge.use_seam = all(abs(obj.data.vertices[index].co.x) < 1e-6 for index in edge.vertices)
    return obj


def selected(obj):
    return [face.index for face in bmesh.from_edit_mesh(obj.data).faces if face.select]


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT', 'EDIT OTHER', 'EDIT BOTH'])
def test_selects_the_islands_faces(mode, uv_editor):
    other = add_grid(3, "Other", location=(5, 0, 0))
    obj = two_islands()
    bpy.ops.uv.qh_unwrap()
    expected = [polygon.index for polygon in obj.data.polygons if polygon.center.x > 0]
    number = next(each.number for each in operators.last_outcomes if each.face_indices.tolist() == expected)
    if mode != 'OBJECT':
        editing = {'EDIT': [obj], 'EDIT OTHER': [other], 'EDIT BOTH': [obj, other]}[mode]
        for each in (obj, other):
            each.select_set(each in editing)
        bpy.context.view_layer.objects.active = editing[-1]
        edit_mode()
    assert bpy.ops.uv.qh_unwrap_select(object="Panels", island=number) == {'FINISHED'}
    assert obj.mode == 'EDIT' and selected(obj) == expected
    assert bpy.context.view_layer.objects.active == obj
    assert other.mode == ('EDIT' if mode == 'EDIT BOTH' else 'OBJECT')
    if other.mode == 'EDIT':
        assert not selected(other)
    for sync in (True, False):
        bpy.context.scene.tool_settings.use_uv_select_sync = sync
        with bpy.context.temp_override(**uv_editor):
            (target,) = selection.targets(bpy.context)
        assert np.flatnonzero(target.faces).tolist() == expected, "in the UV Editor, too"


def test_selecting_can_be_undone():
    name = two_islands().name
    bpy.ops.uv.qh_unwrap()
    bpy.ops.ed.undo_push()
    assert bpy.ops.uv.qh_unwrap_select(True, object=name, island=1) == {'FINISHED'}
    assert bpy.data.objects[name].mode == 'EDIT'
    bpy.ops.ed.undo()
    assert bpy.data.objects[name].mode == 'OBJECT'


def rename(obj):
    obj.name = "Renamed"


def hide(obj):
    obj.hide_set(True)


def lose_faces(obj):
    obj.data.clear_geometry()


@pytest.mark.parametrize(
    ("change", "island", "message"),
    [
        (rename, 1, "There is no mesh object Panels in this view layer any more"),
        (hide, 1, "Panels is hidden: show it first"),
        (lose_faces, 1, "Panels has fewer faces than when it was unwrapped"),
        (lambda _: None, 7, "Panels has no island 7 in the last result"),
    ],
)
def test_says_why_an_island_cannot_be_selected(change, island, message):
    obj = two_islands()
    bpy.ops.uv.qh_unwrap()
    change(obj)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.uv.qh_unwrap_select(object="Panels", island=island)
    assert obj.mode == 'OBJECT'


def test_buttons_need_a_last_result():
    add_grid(3)
    operators.last_outcomes.clear()
    for operator in (bpy.ops.uv.qh_unwrap_select, bpy.ops.uv.qh_unwrap_copy_report):
        assert not operator.poll()
        with pytest.raises(RuntimeError, match="Nothing has been unwrapped yet"):
            operator()


# Pack Overlapping


def three_islands():
    """Three stripes of a grid, of which the first two come to lie on each other in a circle; a map far from them."""
    obj = add_grid(6, "Stripes")
    corner = [obj.data.vertices[loop.vertex_index].co for loop in obj.data.loops]
    x, y = np.array([(co.x, co.y) for co in corner]).T
    for edge in obj.data.edges:
        places = {round(obj.data.vertices[index].co.x, 5) for index in edge.vertices}
        edge.use_seam = len(places) == 1 and round(abs(places.pop()), 5) == 0.33333
    stripe = np.repeat(
        [int(polygon.center.x * 1.5 + np.sign(polygon.center.x) / 2) for polygon in obj.data.polygons], 4
    )
    values = np.column_stack([x / 2 + 0.1 * stripe + 5 * (stripe == 1), y / 2])
    obj.data.uv_layers.active.uv.foreach_set("vector", values.astype(np.float32).ravel())
    return obj, stripe


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_packs_what_overlaps_and_nothing_else(mode):
    obj, stripe = three_islands()
    if mode == 'EDIT':
        edit_mode()
    bpy.ops.uv.qh_unwrap(boundary='CIRCLE')
    assert [bool(outcome.overlaps) for outcome in operators.last_outcomes] == [True, True, False]
    before = uvs(obj)
    assert "uv.qh_unwrap_pack_overlapping" in [button.idname for button in drawn()[1]]
    assert bpy.ops.uv.qh_unwrap_pack_overlapping() == {'FINISHED'}
    assert obj.mode == mode
    after = uvs(obj)
    assert np.array_equal(after[stripe == 1], before[stripe == 1])
    low, high = (np.array([end(after[stripe == k], axis=0) for k in (-1, 0, 1)]) for end in (np.min, np.max))
    centre, radius = (low + high) / 2, (high - low).max(axis=1) / 2
    for one in range(3):
        for other in range(one):
            assert np.linalg.norm(centre[one] - centre[other]) > radius[one] + radius[other], "circles apart"
    for k in (-1, 0):  # the same shape as before, of another size and somewhere else
        z, w = (each[stripe == k] @ (1, 1j) for each in (before, after))
        z, w = z - z.mean(), w - w.mean()
        turn = np.vdot(z, w)
        np.testing.assert_allclose(w, z * turn / np.vdot(z, z), atol=1e-5)
    assert not last_run.overlapping and "uv.qh_unwrap_pack_overlapping" not in [each.idname for each in drawn()[1]]
    assert not bpy.ops.uv.qh_unwrap_pack_overlapping.poll()


def test_packing_what_overlaps_can_be_undone():
    obj, _ = three_islands()
    bpy.ops.uv.qh_unwrap(boundary='CIRCLE')
    before = uvs(obj)
    bpy.ops.ed.undo_push()
    assert bpy.ops.uv.qh_unwrap_pack_overlapping(True) == {'FINISHED'}
    assert not np.array_equal(uvs(bpy.data.objects["Stripes"]), before)
    bpy.ops.ed.undo()
    assert np.array_equal(uvs(bpy.data.objects["Stripes"]), before)


@pytest.mark.parametrize(
    ("change", "message"),
    [(rename, "There is no mesh object Stripes"), (lose_faces, "Stripes has fewer faces")],
)
def test_says_why_it_cannot_pack(change, message):
    obj, _ = three_islands()
    bpy.ops.uv.qh_unwrap(boundary='CIRCLE')
    change(obj)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.uv.qh_unwrap_pack_overlapping()


def test_nothing_to_pack():
    add_grid(3)
    bpy.ops.uv.qh_unwrap()
    with pytest.raises(RuntimeError, match="No island of the last result lies on another"):
        bpy.ops.uv.qh_unwrap_pack_overlapping()


# Copy Report


def test_report_has_versions_settings_and_lines():
    cubes(2)
    fins(2).select_set(True)
    bpy.data.objects["Cubes"].select_set(True)
    bpy.ops.uv.qh_unwrap(balance=0.5)
    assert bpy.ops.uv.qh_unwrap_copy_report() == {'FINISHED'}
    text = last_run.text("9.9.9")
    for part in ("QH Unwrap ", "Blender 9.9.9", "NumPy ", "SciPy ", "balance=0.5", "placement=ORIGINAL"):
        assert part in text
    assert "2 islands (first: Cubes, island 1): it is closed" in text
    assert "6 islands (first: Fins, island 1): it ends at 1 edge" in text
    assert text.splitlines()[-1] == summary(operators.last_outcomes)


# What the errors name


def no_faces(obj):
    obj.data.clear_geometry()


def hidden_faces(obj):
    obj.data.polygons.foreach_set("hide", np.ones(9, dtype=bool))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (no_faces, "Grid has no faces: select a mesh that has some"),
        (hidden_faces, "Grid has no visible faces: press Alt H in Edit Mode to show them"),
    ],
)
def test_objects_without_visible_faces(change, message):
    change(add_grid(3))
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.uv.qh_unwrap()


@pytest.mark.parametrize(
    ("value", "fault"), [(np.nan, "some of its UVs are no numbers"), (0.5, "all its UVs are in one place")]
)
@pytest.mark.parametrize(
    ("options", "cure"),
    [
        ({"boundary": 'KEEP'}, "unwrap it with another boundary than Keep first"),
        ({"boundary": 'CIRCLE', "initial": 'CURRENT'}, "choose another start than Current UVs"),
    ],
)
def test_uvs_that_mean_nothing(value, fault, options, cure):
    obj = add_grid(3)
    values = uvs(obj)
    values[: 1 if np.isnan(value) else None] = value
    obj.data.uv_layers[0].uv.foreach_set("vector", values.ravel())
    with pytest.raises(RuntimeError, match=f"{fault}: {cure}"):
        bpy.ops.uv.qh_unwrap(**options)
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}, "otherwise they do not matter"


def test_what_is_endless_is_shown_so():
    outcome = Outcome("Cube", 1, np.arange(6), area=1.0)
    outcome.after = SimpleNamespace(l2_stretch=3e48, flips=0, collapsed=2)
    outcome.injective = True
    assert summary([outcome]) == "1 island, stretch ∞, 2 collapsed"
