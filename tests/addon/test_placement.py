# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np
import pytest
from scenes import add_grid, edit_mode, mesh_object, uvs
from scipy.spatial import Delaunay

from qh_unwrap.addon import operators, packing
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.addon.outcome import sentences, summary
from qh_unwrap.core import placing
from qh_unwrap.core.pieces import Pieces


def set_uvs(obj, values):
    obj.data.uv_layers.active.uv.foreach_set("vector", np.asarray(values, dtype=np.float32).ravel())


def turned(uv, angle, scale, shift):
    c, s = np.cos(angle), np.sin(angle)
    return scale * uv @ np.array([[c, s], [-s, c]]) + shift


def area_and_centre(obj, faces=slice(None)):
    quads = uvs(obj).astype(float).reshape(-1, 4, 2)[faces]
    x, y = quads.transpose(2, 0, 1)
    areas = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2
    return areas.sum(), areas @ quads.mean(axis=1) / areas.sum()


def overlap(one, other):
    """Whether two convex islands overlap."""
    return (Delaunay(one).find_simplex(other) >= 0).any() or (Delaunay(other).find_simplex(one) >= 0).any()


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_original_keeps_centre_area_and_turn(angle):
    obj = add_grid(6)
    set_uvs(obj, turned(uvs(obj), angle, 0.3, (2.2, -1.4)))
    old_area, old_centre = area_and_centre(obj)
    old = uvs(obj)
    bpy.ops.uv.qh_unwrap()
    area, centre = area_and_centre(obj)
    assert area == pytest.approx(old_area, rel=1e-4)
    assert np.allclose(centre, old_centre, atol=0.01)
    z, w = ((uv - uv.mean(axis=0)) @ (1, 1j) for uv in (uvs(obj), old))
    assert abs(np.angle(np.vdot(z, w))) < 0.02


def in_place(uv, triangles, old):
    return placing.in_place(Pieces([np.zeros((len(uv), 3))], [triangles]), uv, old)


def test_in_place_undoes_any_similarity():
    random = np.random.default_rng(1)
    uv, triangles = random.random((5, 2)), np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4)])
    moved = turned(uv, 2.0, 3.7, (5, -8))
    assert np.allclose(in_place(moved, triangles, uv[triangles]), uv)


def test_islands_are_put_in_place_together_as_alone():
    random = np.random.default_rng(1)
    one, other = (np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4)])[:count] for count in (3, 2))
    uvs_, olds = ([random.random((count, 2)) for count in (5, 4)] for _ in range(2))
    olds[1][3] = (90, 90)  # thrown elsewhere
    old = [its[triangles] for its, triangles in zip(olds, (one, other), strict=True)]
    both = Pieces([np.zeros((5, 3)), np.zeros((4, 3))], [one, other])
    found = both.of_each(placing.in_place(both, np.concatenate(uvs_), np.concatenate(old)))
    for together, uv, triangles, its in zip(found, uvs_, (one, other), old, strict=True):
        np.testing.assert_allclose(together, in_place(uv, triangles, its), rtol=1e-12)


def test_one_vertex_thrown_elsewhere_moves_nothing_else():
    obj = add_grid(12)
    values = uvs(obj)
    corner = np.array([loop.vertex_index for loop in obj.data.loops])
    thrown = values.copy()
    thrown[corner == 6 * 13 + 6] = (-5, -5)
    set_uvs(obj, thrown)
    bpy.ops.uv.qh_unwrap()
    assert np.abs(uvs(obj) - values).max() < 0.1


def test_a_map_with_flips_that_mostly_lies_in_one_place_keeps_its_size():
    points = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (3, 0), (2, 1), (3, 1)], dtype=float)
    triangles = np.array([(0, 1, 2), (0, 2, 3), (1, 4, 6), (1, 6, 2), (4, 5, 7), (4, 7, 6)])
    old = np.zeros((6, 3, 2))
    old[0], old[1] = points[triangles[0]], points[triangles[1]][::-1]  # the second one is flipped
    assert np.ptp(in_place(points, triangles, old), axis=0).min() > 0.1


def test_in_place_has_numbers_even_without_area():
    uv, triangles = np.zeros((3, 2)), np.array([(0, 1, 2)])
    assert np.isfinite(in_place(uv, triangles, np.array([[(0, 0), (1, 0), (0, 1)]]))).all()


def test_new_islands_are_packed_in_the_unit_square():
    one, other = add_grid(4, "One", uv=False), add_grid(4, "Other", uv=False, location=(3, 0, 0))
    other.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    bpy.ops.uv.qh_unwrap()
    both = [uvs(one), uvs(other)]
    assert min(uv.min() for uv in both) >= 0 and max(uv.max() for uv in both) <= 1
    assert not overlap(*both)
    (small, _), (large, _) = area_and_centre(one), area_and_centre(other)
    assert large / small == pytest.approx(4, rel=0.02), "the same texel density"


def test_reset_uvs_say_nothing_about_the_place():
    """A map as Blender's + button makes it: every face fills the square."""
    obj = add_grid(8, uv=False)
    obj.data.uv_layers.new(name="UVMap")
    bpy.ops.uv.qh_unwrap()
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1


def test_pack_moves_islands_with_uvs_too():
    one, other = add_grid(4, "One"), add_grid(4, "Other", location=(3, 0, 0))
    bpy.ops.uv.qh_unwrap(placement='ORIGINAL')
    assert overlap(uvs(one), uvs(other)), "both were in the same place"
    bpy.ops.uv.qh_unwrap(placement='PACK')
    assert not overlap(uvs(one), uvs(other))


def paint(obj, width, height):
    """Show an image of that size on the object."""
    material = bpy.data.materials.new("Paint")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Paint", width, height)
    obj.data.materials.append(material)


@pytest.mark.parametrize("new", [True, False])
@pytest.mark.parametrize("placement", ['ORIGINAL', 'PACK'])
@pytest.mark.parametrize("size", [(64, 16), (16, 64), (50, 30)])
def test_packed_for_an_image_that_is_not_square(size, placement, new):
    """All of the image is used, nothing is stretched, and texels are equally dense."""
    one, other = add_grid(4, "One", uv=not new), add_grid(4, "Other", uv=not new, location=(3, 0, 0))
    for obj in (one, other):
        for vertex in obj.data.vertices:
            vertex.co.z = 0
        paint(obj, *size)
    other.scale = (2, 2, 2)
    bpy.context.view_layer.update()
    bpy.ops.uv.qh_unwrap(placement=placement)
    if new or placement == 'PACK':
        both = [uvs(one), uvs(other)]
        assert min(uv.min() for uv in both) >= 0 and 0.95 < max(uv.max() for uv in both) <= 1
        assert not overlap(*both)
        (small, _), (large, _) = area_and_centre(one), area_and_centre(other)
        assert large / small == pytest.approx(4, rel=0.02)
    for obj in (one, other):
        width, height = np.ptp(uvs(obj), axis=0) * size
        assert width / height == pytest.approx(1, rel=0.01)


def test_packed_for_images_of_different_shapes():
    one, other = add_grid(4, "One"), add_grid(4, "Other", location=(3, 0, 0))
    for obj, size in ((one, (64, 16)), (other, (16, 64))):
        for vertex in obj.data.vertices:
            vertex.co.z = 0
        paint(obj, *size)
        obj["size"] = size
    bpy.ops.uv.qh_unwrap(placement='PACK')
    assert not overlap(uvs(one), uvs(other))
    for obj in (one, other):
        assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1
        width, height = np.ptp(uvs(obj), axis=0) * obj["size"]
        assert width / height == pytest.approx(1, rel=0.01)


@pytest.mark.parametrize("boundary", ['CIRCLE', 'RECTANGLE', 'OUTLINE'])
def test_unit_fills_the_square(boundary):
    one, other = add_grid(4, "One"), add_grid(6, "Other", location=(3, 0, 0))
    bpy.ops.uv.qh_unwrap(boundary=boundary, placement='UNIT')
    for obj in (one, other):
        assert np.ptp(uvs(obj), axis=0).max() == pytest.approx(1)
        assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1


@pytest.mark.parametrize(("method", "least"), [('SCALED', 0.004), ('ADD', 0.02), ('FRACTION', 0.045)])
def test_margin(method, least):
    """As Blender measures it: SCALED is a tenth of the islands' size."""
    one, other = add_grid(2, "One"), add_grid(3, "Other", location=(3, 0, 0))

    def margin_of(margin):
        bpy.ops.uv.qh_unwrap(placement='PACK', margin=margin, margin_method=method)
        return min(uvs(one).min(), uvs(other).min(), (1 - uvs(one)).min(), (1 - uvs(other)).min())

    assert least < margin_of(0.05) - margin_of(0) < 0.051


@pytest.mark.parametrize("method", ['SCALED', 'ADD', 'FRACTION'])
@pytest.mark.parametrize("aspect", [1.0, 2.0, 0.4])
def test_a_single_island_goes_where_blenders_packer_puts_it(monkeypatch, method, aspect):
    random = np.random.default_rng(7)
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    for margin in (0, 0.005, 0.1, 0.45):
        width, height = random.uniform(0.1, 10, 2)
        uv = np.array([(0, 0), (width, 0), (width, height), (0, height)]) + random.normal(size=2)
        island, options = Pieces([np.zeros((4, 3))], [triangles]), MeshOptions(margin_method=method, margin=margin)
        alone = packing.pack(island, uv, [aspect], options, False, bpy.context)
        by_blender = packing._packed(uv, triangles, np.full(2, aspect), options, False, bpy.context)
        np.testing.assert_allclose(alone, by_blender, atol=2e-5 * max(aspect, 1))


def height_gradient(obj):
    """Where in the layout the object's height grows."""
    heights = np.array([obj.data.vertices[loop.vertex_index].co.z for loop in obj.data.loops])
    uv = uvs(obj) - uvs(obj).mean(axis=0)
    return np.linalg.lstsq(uv, heights - heights.mean(), rcond=None)[0]


@pytest.mark.parametrize("rotation", [(0, 0, 0), (0.4, 1.2, 2.0)])
@pytest.mark.parametrize("boundary", ['FREE', 'CIRCLE'])
def test_first_unwrap_is_upright(boundary, rotation):
    """A wall that leans, whose own up axis counts however the object is turned."""
    obj = add_grid(6, uv=False)
    for vertex in obj.data.vertices:
        x, y, _ = vertex.co
        vertex.co = (2 * x + 0.5 * y, 0.3 * y + 0.2 * x * x, y)
    obj.rotation_euler = rotation
    bpy.context.view_layer.update()
    bpy.ops.uv.qh_unwrap(boundary=boundary)
    across, up = height_gradient(obj)
    assert up > 0 and abs(across) < 0.02 * up
    assert area_and_centre(obj)[0] > 0, "and not mirrored"


@pytest.mark.parametrize("boundary", ['FREE', 'CIRCLE', 'RECTANGLE'])
def test_first_unwrap_of_a_head_is_upright(boundary):
    """Most of what goes up on one side comes down on the other, and yet it has an upper end."""
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=False)
    obj = bpy.context.object
    for edge in obj.data.edges:
        one, other = (obj.data.vertices[index].co for index in edge.vertices)
        edge.use_seam = abs(one.x) + abs(other.x) < 1e-4 and one.y + other.y > -0.5
    bpy.ops.uv.qh_unwrap(boundary=boundary)
    head = max(operators.last_outcomes, key=lambda outcome: outcome.faces)
    assert head.faces == 436 and not head.error
    vertices = np.array([loop.vertex_index for loop in obj.data.loops])
    (top, *_), (chin, *_) = (uvs(obj)[vertices == vertex] for vertex in _forehead_and_chin(obj.data))
    _, up = (top - chin) / np.linalg.norm(top - chin)
    assert up > 0.95


def _forehead_and_chin(mesh):
    """Vertices in the middle of the face."""
    middle = [vertex for vertex in mesh.vertices if abs(vertex.co.x) < 1e-4 and vertex.co.y < -0.3]
    return (pick(middle, key=lambda vertex: vertex.co.z).index for pick in (max, min))


@pytest.mark.parametrize("rotate", [True, False])
def test_packing_turns_islands_only_when_told_to(rotate):
    """Of walls half of which are tall and half wide, which fit the square better if all are the same."""
    obj = add_grid(1, uv=False)
    walls = 6
    points = [(10 * k + x, 0, z) for k in range(walls) for z in (0, (1, 6)[k % 2]) for x in (0, (6, 1)[k % 2])]
    obj.data.clear_geometry()
    obj.data.from_pydata(points, [], [(4 * k, 4 * k + 1, 4 * k + 3, 4 * k + 2) for k in range(walls)])
    bpy.ops.uv.qh_unwrap(placement='PACK', rotate=rotate)
    upward = uvs(obj).reshape(walls, 4, 2)[:, 3] - uvs(obj).reshape(walls, 4, 2)[:, 0]
    upright = (upward[:, 1] > 0) & (np.abs(upward[:, 0]) < 1e-3)
    assert upright.all() != rotate


def test_first_unwrap_of_a_floor_lies_along_its_smallest_box():
    obj = add_grid(6, uv=False)
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    for vertex in obj.data.vertices:
        vertex.co = (*(turn @ (2.5 * vertex.co.x, vertex.co.y)), 0)
    bpy.ops.uv.qh_unwrap()
    width, height = np.ptp(uvs(obj), axis=0)
    assert width / height == pytest.approx(2.5, rel=0.03)


def test_mirrored_island_keeps_its_sign():
    obj = add_grid(4)
    set_uvs(obj, uvs(obj) * (-0.5, 0.5))
    old_area, old_centre = area_and_centre(obj)
    for options in ({}, {"placement": 'PACK'}, {"placement": 'UNIT'}, {"boundary": 'CIRCLE'}):
        bpy.ops.uv.qh_unwrap(**options)
        assert area_and_centre(obj)[0] < 0, options
        assert operators.last_outcomes[0].after.flips == 0
        if not options:
            area, centre = area_and_centre(obj)
            assert area == pytest.approx(old_area, rel=1e-4) and np.allclose(centre, old_centre, atol=0.02)


def two_panels():
    """A grid with a seam down the middle; the left half, faces 0 and 1 of four columns, is new."""
    obj = add_grid(4)
    for edge in obj.data.edges:
        edge.use_seam = all(abs(obj.data.vertices[index].co.x) < 1e-6 for index in edge.vertices)
    return obj


def test_new_island_goes_beside_what_is_there():
    obj = two_panels()
    left = np.repeat([polygon.center.x < 0 for polygon in obj.data.polygons], 4)
    values = uvs(obj)
    values[left] = 0
    set_uvs(obj, values)
    edit_mode(lambda _, face: left[4 * face])
    bpy.ops.uv.qh_unwrap()
    assert np.array_equal(uvs(obj)[~left], values[~left])
    new = uvs(obj)[left]
    assert new[:, 0].min() >= 1 and new[:, 0].max() <= 2 and new[:, 1].min() >= 0 and new[:, 1].max() <= 1
    assert not operators.last_outcomes[0].overlaps


def test_overlap_with_another_island_is_reported_and_named():
    obj = two_panels()
    for options, expected in (({"boundary": 'CIRCLE'}, True), ({}, False), ({"placement": 'PACK'}, False)):
        left = np.repeat([polygon.center.x < 0 for polygon in obj.data.polygons], 4)
        apart = np.where(left, -0.1, 0.1)[:, None] * (1, 0)
        set_uvs(obj, [(vertex.co.x / 2, vertex.co.y / 2) for vertex in corner_vertices(obj)] + apart)
        bpy.ops.uv.qh_unwrap(**options)
        one, other = operators.last_outcomes
        assert (one.overlaps, other.overlaps) == (((other.label,), (one.label,)) if expected else ((), ())), options
        told = [text for text in sentences(operators.last_outcomes) if "pack them together" in text]
        assert told == ([f"{one.label} lies on {other.label} now: pack them together"] if expected else []), "once"


def test_stacked_islands_stay_stacked_without_a_warning():
    obj = two_panels()
    set_uvs(obj, [(abs(vertex.co.x) / 2, vertex.co.y / 2) for vertex in corner_vertices(obj)])
    bpy.ops.uv.qh_unwrap(boundary='CIRCLE')
    assert [outcome.overlaps for outcome in operators.last_outcomes] == [(), ()]


@pytest.mark.parametrize("shift", [0, 4096, -4096])
@pytest.mark.parametrize("options", [{}, {"boundary": 'KEEP'}])
def test_certificate_counts_where_the_island_lies(options, shift):
    """A tongs whose arms almost touch: far from the origin, 32-bit floats only tell them apart if they give way."""
    expected = not shift or not options
    half_gaps = np.linspace(0.2, 2e-5, 6)
    points = [(u, 0.4 * row) for row, half in enumerate(half_gaps) for u in (0, 0.7 - half, 0.7 + half, 1.4)]
    faces = [(4 * row + k, 4 * row + k + 1, 4 * row + k + 5, 4 * row + k + 4) for row in range(5) for k in (0, 2)]
    faces.append((1, 2, 6, 5))
    obj = mesh_object("Tongs", [(u, v, 0) for u, v in points], faces)
    obj.data.uv_layers.new()
    set_uvs(obj, [(points[loop.vertex_index][0] + shift, points[loop.vertex_index][1]) for loop in obj.data.loops])
    bpy.ops.uv.qh_unwrap(**options)
    (outcome,) = operators.last_outcomes
    assert (outcome.after.flips, outcome.after.collapsed) == (0, 0)
    assert (outcome.injective, outcome.is_clean) == (expected, expected)
    told = list(sentences([outcome]))
    assert told == ([] if expected else ["Tongs (11 faces) overlaps itself"])
    assert summary([outcome]).endswith("no flips" if expected else "no flips; 1 on top of itself")


def corner_vertices(obj):
    return [obj.data.vertices[loop.vertex_index] for loop in obj.data.loops]


def test_packing_in_edit_mode_leaves_others_alone():
    obj = add_grid(4)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    assert bpy.ops.uv.qh_unwrap(placement='PACK') == {'FINISHED'}
    assert obj.mode == 'EDIT' and not bpy.context.scene.tool_settings.use_uv_select_sync
    assert uvs(obj).min() >= 0 and uvs(obj).max() <= 1
