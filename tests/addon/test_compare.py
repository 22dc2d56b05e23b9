# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparisons on copies: the same numbers as on the original, which stays as it was; and plots of them."""

import bpy  # isort: skip
import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from everything_in_file import differences, everything
from scenes import add_cube, add_grid, edit_mode, mesh_object, uvs

from qh_unwrap.addon import comparing, figure, plotting, raster, selection, suzanne
from qh_unwrap.addon.comparison import HEAD, Comparison, Row, latest
from qh_unwrap.addon.figure import Look
from qh_unwrap.addon.last_run import last_run
from qh_unwrap.addon.lettering import letters
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.cli import main
from qh_unwrap.core import Settings, distortion, unwrap
from qh_unwrap.core.curves import FIGURE_11, Curves, curves
from qh_unwrap.core.stepping import finished
from tests.benchmarks.common import half_sphere

OFFERED = bpy.ops.uv.unwrap.get_rna_type().properties["method"].enum_items.keys()
NATIVE = ["Angle Based", "Conformal", *(["Minimum Stretch"] if "MINIMUM_STRETCH" in OFFERED else [])]
OPTIONS = MeshOptions()


@pytest.fixture(autouse=True)
def _forget():
    latest.comparison = None


def compare(methods=None, options=OPTIONS):
    methods = methods or comparing.blenders(Settings(), options)
    found = finished(comparing.compare(selection.targets(bpy.context), methods, bpy.context, options))
    return {row.name: row for row in found.rows}


def two_grids():
    """In Edit Mode, some faces of each selected: one with shape keys and materials, the other with a parent."""
    one, other = add_grid(6, "One"), add_grid(5, "Other", location=(3, 0, 0))
    one.shape_key_add(name="Basis")
    one.shape_key_add(name="Bent", from_mix=False).data[0].co.z = 1
    one.data.shape_keys.key_blocks["Bent"].value = 0.7
    one.data.materials.append(bpy.data.materials.new("Material"))
    one.vertex_groups.new(name="Group").add([0, 1], 0.5, 'REPLACE')
    other.modifiers.new("Subdivision", 'SUBSURF')
    other.parent = one
    other.data.polygons[3].hide = True
    edit_mode(lambda obj, face: face % 4 < 3)
    return one, other


# Comparing


@pytest.mark.parametrize("methods", ["BLENDER", "FIGURE_11"])
def test_the_original_stays_as_it_was(methods):
    one, _ = two_grids()
    bpy.ops.uv.qh_unwrap()
    one.update_from_editmode()  # which is needed to know its shape
    everything()  # reading some of it makes it
    before, said = everything(), list(last_run.outcomes)
    bpy.ops.uv.qh_compare(methods=methods)
    assert not differences(before, everything())
    assert last_run.outcomes == said and latest.comparison is not None


def test_the_original_stays_as_it_was_if_it_is_stopped():
    one, _ = two_grids()
    one.update_from_editmode()
    everything()
    before = everything()
    targets, methods = selection.targets(bpy.context), comparing.blenders(Settings(), OPTIONS)
    steps = comparing.compare(targets, methods, bpy.context, OPTIONS)
    for _ in range(8):
        next(steps)
    steps.close()
    assert not differences(before, everything())


def test_it_makes_no_step_to_undo():
    obj = add_grid()
    edit_mode()
    bpy.ops.ed.undo_push()
    before = uvs(obj)
    bpy.ops.uv.qh_unwrap(True)
    bpy.ops.uv.qh_compare(True)
    bpy.ops.ed.undo()
    assert np.array_equal(uvs(bpy.data.objects["Grid"]), before)


def test_blenders_methods_are_as_on_the_original():
    suzanne.add()
    edit_mode()
    rows = compare()
    assert list(rows) == ["Current UVs", *NATIVE, "QH Unwrap"]
    assert rows["Current UVs"].error == "there are no UVs"
    for name in NATIVE:
        bpy.ops.uv.unwrap(method=name.upper().replace(" ", "_"), fill_holes=True, margin=OPTIONS.margin)
        current = compare()["Current UVs"]
        assert [current.l2_stretch, current.angle, current.area] == pytest.approx(
            [rows[name].l2_stretch, rows[name].angle, rows[name].area], rel=1e-4
        )
        assert (current.flips, current.overlaps) == (rows[name].flips, rows[name].overlaps)
        assert current.seconds is None and rows[name].seconds > 0


def test_ours_is_as_on_the_original():
    suzanne.add()
    edit_mode()
    row = compare()["QH Unwrap"]
    bpy.ops.uv.qh_unwrap()
    share = np.array([outcome.area for outcome in last_run.outcomes])
    stretch = np.array([outcome.after.l2_stretch for outcome in last_run.outcomes])
    assert row.l2_stretch == pytest.approx(stretch @ share / share.sum(), rel=1e-5)
    assert row.flips == row.overlaps == 0 and row.seconds > 0


def test_only_selected_faces_count_and_their_seams_stay():
    obj = add_grid(6)
    edit_mode(lambda obj, face: face < 12)
    assert len(compare()["QH Unwrap"].curves.angle) == 24
    bpy.ops.object.mode_set(mode='OBJECT')
    for edge in obj.data.edges:
        edge.use_seam = True
    (row,) = (row for name, row in compare().items() if name == "QH Unwrap")
    assert row.angle < 1.05 and row.error == ""  # each face for itself is nearly a square


def test_importance_counts_for_ours_and_for_minimum_stretch():
    obj = add_grid(8)
    obj.vertex_groups.new(name="other")
    group = obj.vertex_groups.new(name="uv_importance")
    group.add([vertex.index for vertex in obj.data.vertices if vertex.co.x < 0], 1.0, 'REPLACE')
    weighted = MeshOptions(use_weights=True, weight_factor=4.0)
    for name in {"QH Unwrap", "Minimum Stretch"} & {*NATIVE, "QH Unwrap"}:
        plain, its = (compare(options=options)[name] for options in (OPTIONS, weighted))
        assert its.area > plain.area + 0.3, name
    with pytest.raises(RuntimeError, match="missing"):
        bpy.context.scene.qh_unwrap.use_weights = True
        bpy.context.scene.qh_unwrap.weight_group = "missing"
        bpy.ops.uv.qh_compare()


def test_flips_and_overlaps_are_counted():
    obj = add_grid(4)
    corners = [obj.data.polygons[face].loop_indices for face in (0, 15)]
    values = obj.data.uv_layers.active.uv
    for here, there in zip(*corners, strict=True):
        values[here].vector = values[there].vector
    row = compare()["Current UVs"]
    assert row.overlaps == 2
    for here, (u, v) in zip(corners[0], [(0.1, 0.1), (0.1, 0.2), (0.2, 0.2), (0.2, 0.1)], strict=True):
        values[here].vector = (u, v)
    assert compare()["Current UVs"].flips == 0  # an island for itself, which is mirrored


def test_what_cannot_be_unwrapped_is_told_and_the_others_go_on():
    add_cube()
    rows = compare()
    assert "closed" in rows["QH Unwrap"].error
    assert rows["QH Unwrap"].curves is None and rows["Current UVs"].curves is not None


@pytest.mark.parametrize("methods", list(FIGURE_11))
def test_figure_11_has_the_data_of_the_benchmark(methods):
    vertices, triangles = half_sphere(8)
    mesh_object("Half", vertices.tolist(), triangles.tolist())
    rows = compare(comparing.of_figure_11(OPTIONS))
    expected = curves([distortion(vertices, triangles, unwrap(vertices, triangles, FIGURE_11[methods]).uv)])
    found = rows[methods].curves
    assert np.sort(found.angle) == pytest.approx(np.sort(expected.angle), rel=1e-4)
    assert np.sort(found.area) == pytest.approx(np.sort(expected.area), rel=1e-4)


# Table and figure


def made_up(name="Ours", look=Look("#2460a7"), ratios=(1.0, 1.5, 2.0), **others):  # noqa: B008 (it keeps no state)
    values = np.array(ratios)
    return Row(name, look, 0.5, "", 1.1, 1.2, 0.3, curves=Curves(values, values), **others)


def test_the_table_is_in_columns_and_says_what_failed():
    failed = Row("Theirs", Look("#c0392b"), None, "no such thing")
    found = Comparison("Cube, 3 triangles", (made_up(flips=12, overlaps=3), failed))
    head, ours, theirs = found.lines
    assert head.split() == list(HEAD)
    assert ours.split() == ["Ours", "1.100", "1.200", "0.300", "12", "3", "0.50"]
    assert theirs.split() == ["Theirs", *"–––––"] and found.remarks == ["Theirs: no such thing"]
    assert Comparison("", (failed,)).figure is None


def test_curves_go_from_the_smallest_value_to_the_largest():
    drawn = figure.distortion_figure("Title", [("Ours", Look("#2460a7"), Curves(np.array([4.0, 1, 2]), np.ones(3)))])
    angle, area, _ = (line for line in drawn.lines if line.colour == "#2460a7")
    assert (np.diff(angle.points[:, 0]) > 0).all() and (np.diff(angle.points[:, 1]) < 0).all()
    assert np.ptp(area.points[:, 1]) == pytest.approx(0)
    steps = np.diff(angle.points[:, 1])
    assert steps[0] == pytest.approx(steps[1], rel=0.01)  # the axis is logarithmic


@pytest.mark.parametrize("low, high", [(1, 1.1), (1, 3), (1, 40), (1e-4, 1e4)])
def test_there_is_a_handful_of_round_ticks(low, high):
    found = figure.ticks(low, high)
    assert 2 <= len(found) <= 10 and 1 in found and min(found) >= low * 0.999 and max(found) <= high * 1.001


def test_values_that_are_infinite_do_not_spoil_the_figure():
    wild = Curves(np.array([1, 1e200, np.inf]), np.array([0, 1, np.inf]))
    for line in figure.distortion_figure("Title", [("Wild", Look("#2460a7"), wild)]).lines:
        assert np.isfinite(line.points).all()


def test_svg_is_whole_and_has_all_curves_and_names():
    names = "Ours & <theirs>", "Others"
    methods = [(name, Look("#2460a7", dashes=(2, 3)), Curves(np.arange(1, 9.0), np.arange(1, 9.0))) for name in names]
    root = ElementTree.fromstring(figure.as_svg(figure.distortion_figure("Title", methods)))
    texts = [each.text for each in root.iter("{http://www.w3.org/2000/svg}text")]
    drawn = [each for each in root.iter("{http://www.w3.org/2000/svg}polyline") if each.get("stroke") == "#2460a7"]
    assert set(names) <= set(texts) and "Title" in texts
    assert len(drawn) == 6 and all(each.get("stroke-dasharray") == "2 3" for each in drawn)


def test_pixels_show_lines_and_letters():
    lines = [figure.Line(np.array([(10, 20), (50, 20)]), "#ff0000", 4)]
    lines.append(figure.Line(np.array([(10, 40), (50, 40)]), "#0000ff", 4, (10, 10)))
    found = raster.pixels_of(
        figure.Figure(60, 60, lines, [figure.Text("H", (30, 55), 10, "middle", "#000000")]), letters
    )
    assert found.shape == (60, 60, 3) and found[0, 0].tolist() == [1, 1, 1]
    assert found[20, 30] == pytest.approx([1, 0, 0]) and found[24, 30] == pytest.approx([1, 1, 1])
    assert found[40, 15] == pytest.approx([0, 0, 1]) and found[40, 25] == pytest.approx([1, 1, 1])
    letter = found[45:56, 20:40].mean(axis=2) < 0.5
    assert 10 < letter.sum() < 60 and 28 < np.flatnonzero(letter.any(axis=0)).mean() + 20 < 32


# In Blender


def test_a_plot_is_an_image_in_the_file():
    add_grid()
    edit_mode()
    for _ in range(2):  # the second one takes the place of the first
        bpy.ops.uv.qh_plot()
        (image,) = bpy.data.images
        assert image.name == plotting.NAME and image.packed_file and tuple(image.size) == (1200, 600)
    pixels = np.array(image.pixels[:]).reshape(600, 1200, 4)
    assert (pixels[..., 3] == 1).all() and pixels[-1, -1, :3].tolist() == [1, 1, 1]
    blue = np.abs(pixels[..., :3] - np.array(raster.rgb("#2460a7"))).max(axis=2) < 0.02
    assert blue.sum() > 300
    assert not bpy.data.curves and len(bpy.data.objects) == 1  # of the letters nothing is left


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_a_plot_is_saved_in_place_of_the_old_one(tmp_path, suffix):
    latest.comparison = Comparison("Grid, 3 triangles", (made_up(),))
    path = tmp_path / f"plot{suffix}"
    path.write_text("old")
    bpy.ops.uv.qh_plot_save(filepath=str(path))
    plotting.check(path)
    assert os.listdir(tmp_path) == [path.name] and path.stat().st_size > 1000
    assert not bpy.data.images


def test_a_plot_that_cannot_be_saved_leaves_the_old_one(tmp_path, monkeypatch):
    latest.comparison = Comparison("Grid, 3 triangles", (made_up(),))
    path = tmp_path / "plot.svg"
    path.write_text("old")
    monkeypatch.setattr(plotting, "as_svg", lambda _: "<svg>")
    with pytest.raises(RuntimeError, match="Cannot write"):
        bpy.ops.uv.qh_plot_save(filepath=str(path))
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["plot.svg"]
    with pytest.raises(RuntimeError, match=r"plot.jpg has neither .png nor .svg as its ending"):
        bpy.ops.uv.qh_plot_save(filepath=str(tmp_path / "plot.jpg"))
    with pytest.raises(RuntimeError, match="Cannot write"):
        bpy.ops.uv.qh_plot_save(filepath=str(tmp_path / "no folder" / "plot.svg"))


def test_what_there_is_nothing_for_is_said():
    with pytest.raises(RuntimeError, match="Needs a mesh in Edit Mode or selected meshes in Object Mode"):
        bpy.ops.uv.qh_compare()
    with pytest.raises(RuntimeError, match="Nothing has been compared yet"):
        bpy.ops.uv.qh_plot_save(filepath="plot.svg")
    add_grid()
    edit_mode(lambda obj, face: False)
    with pytest.raises(RuntimeError, match="No faces are selected"):
        bpy.ops.uv.qh_plot()


# On the command line


@pytest.mark.parametrize("name", ["plot.svg", "plot.png"])
def test_the_command_line_plots(tmp_path, capfd, name):
    path = tmp_path / name
    assert main(["suzanne", "--plot", str(path), "--quiet"]) == 0
    plotting.check(path)
    if path.suffix == ".svg":
        text = path.read_text()
        assert all(f">{method}<" in text for method in (*NATIVE, "QH Unwrap", "Suzanne, 968 triangles"))
    before = path.read_bytes()
    assert main(["suzanne", "--plot", str(path)]) == 2 and path.read_bytes() == before
    assert "exists: choose another name, or pass --overwrite" in capfd.readouterr().err
    assert os.listdir(tmp_path) == [name]


def test_the_command_line_says_what_plots_can_be(tmp_path, capfd):
    assert main(["suzanne", "--plot", str(tmp_path / "plot.jpg")]) == 2
    assert "plots can be .png, .svg" in capfd.readouterr().err
    assert main(["suzanne", "--check", "--plot", str(tmp_path / "plot.svg")]) == 2
    assert "leave out --plot" in capfd.readouterr().err


def test_the_documentation_shows_the_tables_head():
    text = (Path(__file__).parents[2] / "docs" / "comparing.md").read_text(encoding="utf-8")
    assert all(f"*{name}*" in text for name in HEAD[1:])
