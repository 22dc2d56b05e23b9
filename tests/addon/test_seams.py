# SPDX-License-Identifier: GPL-3.0-or-later
"""Seams that are found: the operator that marks them, the option of the unwrap, the button, the command line."""

import bpy  # isort: skip
import dataclasses
import json

import bmesh
import numpy as np
import pytest
from scenes import add_cube, add_grid, changes, edit_mode, snapshot, uvs

import qh_unwrap
from qh_unwrap.addon import cutting, files, jobs, panels, selection, unwrapping
from qh_unwrap.addon.options import MeshOptions, SeamOptions
from qh_unwrap.cli import main
from qh_unwrap.core import Settings
from qh_unwrap.core import seams as seams_module
from qh_unwrap.core.seam_settings import SeamSettings

SEAM = "uv_seam" if bpy.app.version >= (4, 5, 0) else ".uv_seam"  # the attribute


def seams(obj):
    found = np.empty(len(obj.data.edges), dtype=bool)
    obj.data.edges.foreach_get("use_seam", found)
    return found


def edge_points(obj):
    """(e, 2, 3)"""
    points = np.array([vertex.co for vertex in obj.data.vertices])
    return points[[list(edge.vertices) for edge in obj.data.edges]]


def sphere(name="Ball"):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    bpy.context.object.name = name
    return bpy.context.object


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_a_cube_becomes_a_net(mode):
    cube = add_cube()
    before = snapshot(cube)
    if mode == 'EDIT':
        edit_mode()
    assert bpy.ops.uv.qh_seams() == {'FINISHED'}
    assert cube.mode == mode
    bpy.ops.object.mode_set(mode='OBJECT')
    assert seams(cube).sum() == 7
    (report,) = qh_unwrap.last_report()
    assert report["injective"] and report["cut_edges"] == 7
    assert report["after"]["symmetric_dirichlet"] == pytest.approx(1)
    assert changes(before, snapshot(cube)) == {SEAM, "UVMap"}


def test_seams_alone_leave_the_uvs():
    cube = add_cube()
    before = snapshot(cube)
    assert bpy.ops.uv.qh_seams(unwrap=False) == {'FINISHED'}
    assert changes(before, snapshot(cube)) == {SEAM}


def test_where_needed_only_what_cannot_be_unwrapped_is_cut():
    grid, torus = add_grid(4), None
    bpy.ops.mesh.primitive_torus_add(major_segments=16, minor_segments=8)
    torus = bpy.context.object
    grid.select_set(True)
    assert bpy.ops.uv.qh_unwrap(cut='NEEDED') == {'FINISHED'}
    assert not seams(grid).any()
    assert seams(torus).sum() == 16 + 8, "two loops"
    assert all(report["injective"] for report in qh_unwrap.last_report())


def test_the_unwrap_cuts_with_the_settings_of_the_panel():
    energies, seams_of = {}, bpy.context.scene.qh_seams
    for bound in (1.3, 1.03):
        sphere()
        seams_of.distortion = bound
        assert bpy.ops.uv.qh_unwrap(cut='DISTORTION') == {'FINISHED'}
        (report,) = qh_unwrap.last_report()
        energies[bound] = report["after"]["symmetric_dirichlet"]
        bpy.data.objects.remove(bpy.context.object)
    seams_of.property_unset("distortion")
    assert energies[1.03] <= 1.03 < energies[1.3] <= 1.3


def test_what_overlaps_itself_once_it_is_opened_is_cut_again(monkeypatch):
    bpy.ops.mesh.primitive_torus_add(major_segments=16, minor_segments=8)
    torus = bpy.context.object
    add_cube().location = (5, 0, 0)
    torus.select_set(True)
    asked = []

    def cut_to(polygons, settings, *others):
        result = yield from seams_module.cut_to(polygons, settings, *others)
        asked.append((settings.distortion, int(polygons.selected.sum())))
        if len(asked) == 1:  # as if its map overlapped itself
            charts = [dataclasses.replace(chart, certified=False) for chart in result.charts]
            result = dataclasses.replace(result, charts=charts)
        return result

    monkeypatch.setattr(cutting, "cut_to", cut_to)
    assert bpy.ops.uv.qh_unwrap(cut='NEEDED') == {'FINISHED'}
    assert len(qh_unwrap.last_report()) == 2 and all(report["injective"] for report in qh_unwrap.last_report())
    assert len(asked) == 3 and sorted(asked)[0][0] == 2, "only the torus at a smaller distortion"
    assert seams(torus).sum() == 24


def test_a_bound_that_holds_already_needs_no_cut():
    grid = add_grid(4)
    assert bpy.ops.uv.qh_seams(distortion=1.5) == {'FINISHED'}
    assert not seams(grid).any()


def test_only_selected_faces_are_cut():
    ball = sphere()
    edit_mode(lambda obj, face: obj.data.polygons[face].center.z > 0)
    assert bpy.ops.uv.qh_seams(distortion=1.02) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    cut = edge_points(ball)[seams(ball)]
    assert len(cut) and (cut[..., 2].max(axis=1) > 1e-6).all(), "none within the other half"


def test_hidden_faces_are_not_cut():
    ball = sphere()
    ball.data.polygons.foreach_set("hide", [polygon.center.z < 0 for polygon in ball.data.polygons])
    assert bpy.ops.uv.qh_seams(distortion=1.02) == {'FINISHED'}
    cut = edge_points(ball)[seams(ball)]
    assert len(cut) and (cut[..., 2].max(axis=1) > 1e-6).all()


def test_seams_that_are_there_stay():
    cube = add_cube()
    cube.data.edges[0].use_seam = cube.data.edges[5].use_seam = True
    assert bpy.ops.uv.qh_seams() == {'FINISHED'}
    assert seams(cube)[[0, 5]].all() and seams(cube).sum() >= 7


def test_seams_keep_away_from_a_vertex_group():
    ball = sphere()
    group = ball.vertex_groups.new(name="Face")
    group.add([vertex.index for vertex in ball.data.vertices if vertex.co.x > -0.3], 1.0, 'REPLACE')
    edit_mode()  # where the weights are those of the mesh that is edited
    assert bpy.ops.uv.qh_seams(vertex_group="Face", distortion=1.3) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    cut = edge_points(ball)[seams(ball)]
    assert len(cut) and (cut[..., 0].min(axis=1) <= -0.3).all()


def test_seams_follow_sharp_edges_and_borders_of_materials():
    share = []
    for way in ("none", "sharp", "material"):
        ball = sphere()
        circle = np.abs(edge_points(ball)[..., 1]).max(axis=1) < 1e-6  # of longitude
        if way == "sharp":
            ball.data.edges.foreach_set("use_edge_sharp", circle)
        if way == "material":
            for name in "AB":
                ball.data.materials.append(bpy.data.materials.new(name))
            sides = [polygon.center.y > 0 for polygon in ball.data.polygons]
            ball.data.polygons.foreach_set("material_index", np.array(sides, dtype=np.int32))
        assert bpy.ops.uv.qh_seams(distortion=1.3, creases=0, marks=5) == {'FINISHED'}
        share.append(circle[seams(ball)].mean())
        bpy.data.objects.remove(ball)
    assert share[0] < 0.3 < share[1] == share[2]


def test_a_vertex_group_of_everything_is_the_reason():
    ball = sphere()
    ball.vertex_groups.new(name="All").add(list(range(len(ball.data.vertices))), 1.0, 'REPLACE')
    for options in ({}, dict(unwrap=False)):
        with pytest.raises(RuntimeError, match="too few of its edges may be cut to open it"):
            bpy.ops.uv.qh_seams(vertex_group="All", **options)
    assert not seams(ball).any()


@pytest.mark.filterwarnings("error")
def test_where_symmetric_seams_do_not_suffice_others_come_to_them():
    bpy.ops.mesh.primitive_monkey_add()
    assert bpy.ops.uv.qh_seams(symmetry='X', distortion=1.05) == {'FINISHED'}
    for report in qh_unwrap.last_report():
        assert report["injective"] and report["after"]["symmetric_dirichlet"] <= 1.05


def test_unknown_vertex_group():
    cube = add_cube()
    with pytest.raises(RuntimeError, match="no vertex group Nose to spare"):
        bpy.ops.uv.qh_seams(vertex_group="Nose")
    assert not seams(cube).any()


def test_nothing_selected():
    add_cube()
    edit_mode(lambda obj, face: False)
    with pytest.raises(RuntimeError, match="No faces are selected"):
        bpy.ops.uv.qh_seams()


def test_stopped_half_way_nothing_is_changed():
    ball = sphere()
    before = snapshot(ball)
    targets = [selection.Target(ball, np.ones(len(ball.data.polygons), dtype=bool))]
    options = MeshOptions(cut='DISTORTION')
    whole = len(list(jobs.cut_and_unwrap(targets, Settings(), options, bpy.context, SeamSettings(distortion=1.01))))
    after = snapshot(ball)
    assert changes(before, after) == {SEAM, "UVMap"}
    steps = jobs.cut_and_unwrap(targets, Settings(), options, bpy.context, SeamSettings(distortion=1.001))
    for _ in range(whole // 2):
        next(steps)
    steps.close()
    assert not changes(after, snapshot(ball))


def test_what_cannot_be_unwrapped_is_not_cut(monkeypatch):
    cube = add_cube()

    def fail(shapes, *_):
        yield 0.0
        return [qh_unwrap.core.UnwrapError("it is tired") for _ in shapes]

    monkeypatch.setattr(unwrapping, "unwrap_variously", fail)
    with pytest.raises(RuntimeError, match="is tired"):
        bpy.ops.uv.qh_unwrap(cut='NEEDED')
    assert not seams(cube).any()


@pytest.mark.parametrize("mode", ['OBJECT', 'EDIT'])
def test_the_report_offers_to_cut_what_is_closed(mode):
    cube, grid = add_cube(), add_grid(3)
    cube.select_set(True)
    if mode == 'EDIT':
        edit_mode()
    assert not bpy.ops.uv.qh_unwrap_cut_closed.poll()
    bpy.ops.uv.qh_unwrap()
    assert bpy.ops.uv.qh_unwrap_cut_closed.poll()
    before = snapshot(grid)
    assert bpy.ops.uv.qh_unwrap_cut_closed() == {'FINISHED'}
    assert not changes(before, snapshot(grid)), "which was no trouble"
    (report,) = qh_unwrap.last_report()
    assert report["object"] == cube.name and report["injective"]
    assert not bpy.ops.uv.qh_unwrap_cut_closed.poll()


def test_what_is_cut_is_laid_out_beside_the_rest():
    bpy.ops.mesh.primitive_monkey_add()
    bpy.ops.uv.qh_unwrap(placement='PACK')
    assert bpy.ops.uv.qh_seams() == {'FINISHED'}
    assert not any(report["overlaps"] for report in qh_unwrap.last_report())


def test_a_tube_is_told_what_a_seam_would_bring():
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, end_fill_type='NOTHING')
    tube = bpy.context.object
    bpy.ops.uv.qh_unwrap()
    (report,) = qh_unwrap.last_report()
    assert report["warnings"] == ["it is a tube: a seam from end to end would bring its stretch from 1.247 to 1.000"]
    along = np.ptp(edge_points(tube)[..., 2], axis=1) > 1
    tube.data.edges[int(np.flatnonzero(along)[0])].use_seam = True
    bpy.ops.uv.qh_unwrap()
    (report,) = qh_unwrap.last_report()
    assert not report["warnings"] and report["after"]["l2_stretch"] == pytest.approx(1)


@pytest.mark.parametrize("name", ["IMAGE_MT_uvs", "VIEW3D_MT_uv_map", "VIEW3D_MT_edit_mesh_edges"])
def test_it_stands_in_the_menus(name):
    assert panels.draw_seam_menu in getattr(bpy.types, name).draw._draw_funcs


def test_one_undo_takes_seams_and_uvs_back():
    bpy.ops.ed.undo_push(message="before")
    cube = add_cube()
    bpy.ops.ed.undo_push(message="cube")
    before = uvs(cube)
    bpy.ops.uv.qh_seams()
    bpy.ops.ed.undo_push(message="seams")
    bpy.ops.ed.undo()
    cube = bpy.context.object
    assert not seams(cube).any()
    np.testing.assert_array_equal(uvs(cube), before)


def test_welded_edges_are_cut_all_of_them():
    cube = add_cube()
    bm = bmesh.new()
    bm.from_mesh(cube.data)
    bmesh.ops.split_edges(bm, edges=bm.edges)
    bm.to_mesh(cube.data)
    bm.free()
    assert len(cube.data.edges) == 24
    assert bpy.ops.uv.qh_unwrap(cut='NEEDED', weld=True) == {'FINISHED'}
    (report,) = qh_unwrap.last_report()
    assert report["faces"] == 6 and report["injective"]
    points = np.round(np.sort(edge_points(cube), axis=1), 6).reshape(24, 6)
    marked = {tuple(each) for each in points[seams(cube)]}
    assert marked and all(tuple(each) not in marked for each in points[~seams(cube)])


@pytest.mark.parametrize("cut, energy", [("needed", 1.5), ("1.02", 1.02)])
def test_command_line(tmp_path, cut, energy):
    add_cube("Box")
    source, target, report = (tmp_path / name for name in ("in.blend", "out.blend", "report.json"))
    files.save(source)
    given = [] if cut == "needed" else ["--cut", cut]
    assert main([str(source), "-o", str(target), "--json", str(report), *given]) == 0
    found = json.loads(report.read_text())
    (cut,), (island,) = found["cuts"], found["islands"]
    assert island["certified"] and island["after"]["symmetric_dirichlet"] <= energy
    (box,) = files.load(target)
    assert seams(box).sum() == len(cut["edges"]) == island["cut_edges"]
    assert {tuple(edge.vertices) for edge in box.data.edges if edge.use_seam} == {tuple(pair) for pair in cut["edges"]}


def test_wrong_cut_on_the_command_line(tmp_path, capfd):
    assert main(["suzanne", "--cut", "much"]) == 2
    assert "neither never, needed nor a distortion" in capfd.readouterr().err
    with pytest.raises(qh_unwrap.UsageError, match="neither never"):
        qh_unwrap.unwrap_file("suzanne", cut="much")


def test_settings_reach_the_search(tmp_path):
    sphere()
    source = tmp_path / "ball.blend"
    files.save(source)
    report = qh_unwrap.unwrap_file(source, cut=1.02, symmetry="x", charts=2, vertex_group="None")
    values = {name: report["settings"][name] for name in ("cut", "distortion", "symmetry", "charts", "vertex_group")}
    assert values == dict(cut="DISTORTION", distortion=1.02, symmetry="X", charts=2, vertex_group="None")


def test_options_are_checked():
    with pytest.raises(qh_unwrap.core.errors.SettingsError):
        SeamOptions(vertex_group=3)
    with pytest.raises(qh_unwrap.core.errors.SettingsError):
        SeamOptions(until="NEVER")
