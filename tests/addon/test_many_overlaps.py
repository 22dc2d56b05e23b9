# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies on what is found quickly, however many islands are stacked, and told in one line."""

from time import perf_counter

import bpy
import numpy as np
import pytest
from scenes import add_grid, mesh_object, uvs

from qh_unwrap import last_report
from qh_unwrap.addon import operators, selection, stacking, unwrapping
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.addon.outcome import Outcome, sentences
from qh_unwrap.core import Settings
from qh_unwrap.core.layouts import Layout
from qh_unwrap.core.overlaps import ENOUGH, new_overlaps, overlap, overlapping
from qh_unwrap.core.stepping import finished

_SQUARE = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], dtype=float)


def tiles(size):
    """A flat grid of size x size islands, each of two by two faces, side by side on the map."""
    obj = add_grid(2 * size, "Tiles")
    mesh = obj.data
    for vertex in mesh.vertices:
        vertex.co.z = 0
    for edge in mesh.edges:
        one, other = (np.array(mesh.vertices[index].co[:2]) for index in edge.vertices)
        across = (one + 1) * size
        edge.use_seam = any(
            abs(one[axis] - other[axis]) < 1e-6 and abs(across[axis] % 2 - 1) > 0.9 for axis in range(2)
        )
    return obj


def some(random, count, size):
    """Islands of a few triangles each, of very different sizes."""
    scale = size * random.random((count, 1, 1, 1)) ** 2
    return list(random.random((count, 1, 1, 2)) + scale * random.random((count, 3, 3, 2)))


def brute_force(now, before, sheet):
    found = [[] for _ in now]
    for i in range(len(now)):
        for j in range(i):
            if sheet[i] != sheet[j] or not overlap(now[i], now[j]):
                continue
            if before[i] is None or before[j] is None or not overlap(before[i], before[j]):
                found[i].append(j)
                found[j].append(i)
    return [sorted(each) for each in found]


@pytest.mark.parametrize("seed", range(6))
def test_new_overlaps_as_one_by_one(seed):
    random = np.random.default_rng(seed)
    count = 40
    before = some(random, count, 0.2)
    for stacked in random.integers(0, count, 10):
        before[stacked] = before[0]
    now = [its + 0.1 * random.random(2) for its in before]
    for nowhere in random.integers(0, count, 5):
        before[nowhere] = None
    sheet = random.integers(0, 2, count).tolist()
    assert finished(new_overlaps(now, before, sheet)) == brute_force(now, before, sheet)


@pytest.mark.parametrize("seed", range(4))
def test_islands_that_share_a_sample_share_area(seed):
    islands = some(np.random.default_rng(seed), 60, 0.5)
    layout = Layout(islands)
    one, other = np.triu_indices(60, 1)
    shared = layout.share_sample(one, other)
    pairs = set(overlapping(islands))
    assert shared.sum() > 20 and {*zip(one[shared].tolist(), other[shared].tolist(), strict=True)} <= pairs
    same = (layout.first_sample[one] == layout.first_sample[other]) & (layout.first_sample[one] >= 0)
    assert shared[same].all()


def test_dense_islands_that_interlock_are_compared_in_parts():
    """Two combs of thousands of triangles whose boxes are the same, and which do not touch."""
    x, y = np.meshgrid(np.arange(200), np.arange(40))
    cells = np.column_stack([x.ravel(), y.ravel()])[:, None] * (1.0, 1.0)
    squares = np.concatenate([cells + half for half in _SQUARE])
    comb = (squares[:, 0, 0] // 4 % 2) == 0
    begin = perf_counter()
    assert not overlap(squares[comb], squares[~comb])
    assert overlap(squares[comb], squares[~comb] + (0, 0.5)) is False
    assert overlap(squares[comb], squares[~comb] + (0.5, 0))
    assert perf_counter() - begin < 3


def test_fans_around_one_point_come_to_an_end():
    """All triangles meet in every box around that point, however often it is halved."""
    angle = np.linspace(0, np.pi, 2001)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    fan = np.stack([np.zeros((2000, 2)), rim[:-1], rim[1:]], axis=1)
    assert not overlap(fan, -fan) and overlap(fan, fan * (1, -1) + (0, 0.1))


def test_no_more_are_looked_for_than_enough():
    count = 3 * ENOUGH
    now = [_SQUARE + 0.001 * k for k in range(count)]
    found = finished(new_overlaps(now, [None] * count, [0] * count))
    assert all(len(each) == ENOUGH for each in found)


def stack(count, jitter=0.0):
    """That many squares, each an island of its own, on the same place of the map."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
    points = np.concatenate([corners + (2 * k, 0, 0) for k in range(count)])
    obj = mesh_object("Stack", points.tolist(), np.arange(4 * count).reshape(-1, 4).tolist())
    obj.data.uv_layers.new()
    values = 0.9 * np.tile(corners[:, :2], (count, 1))
    values += jitter * np.random.default_rng(0).random(values.shape)
    obj.data.uv_layers[0].uv.foreach_set("vector", values.astype(np.float32).ravel())
    return obj


@pytest.mark.parametrize("jitter", [0.0, 0.01])
def test_thousands_of_stacked_islands_are_quick(jitter):
    stack(3000, jitter)
    begin = perf_counter()
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert perf_counter() - begin < 10, "it takes about 1 s"
    assert len(operators.last_outcomes) == 3000 and not any(outcome.overlaps for outcome in operators.last_outcomes)


@pytest.mark.parametrize("shared", [False, True])
def test_many_objects_that_fill_the_square_are_quick(shared):
    material = bpy.data.materials.new("Paint")
    objects = [add_grid(6, f"Grid {k}") for k in range(1)]
    for k in range(1, 150):
        mesh = objects[0].data.copy()
        for vertex in mesh.vertices:
            vertex.co.z *= 1 + k / 150
        objects.append(bpy.data.objects.new(f"Grid {k}", mesh))
        bpy.context.collection.objects.link(objects[-1])
        objects[-1].select_set(True)
    if shared:
        for obj in objects:
            obj.data.materials.append(material)
    begin = perf_counter()
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert perf_counter() - begin < 10, "it takes less than 1 s"
    assert not any(outcome.overlaps for outcome in operators.last_outcomes)


def test_cancelled_while_it_looks_what_lies_on_what():
    """The work ends wherever it is, and nothing is written."""
    obj = tiles(6)
    old = uvs(obj)
    targets = selection.targets(bpy.context)
    steps = unwrapping.unwrap_targets(targets, Settings(boundary="CIRCLE"), MeshOptions(), bpy.context)
    shares = []
    for share in steps:
        shares.append(share)
        if 0.9 < share < 1:
            break
    assert shares == sorted(shares) and 0.9 < shares[-1] < 1
    steps.close()
    assert np.array_equal(uvs(obj), old)


def test_many_islands_that_lie_on_others_are_told_in_one_line(monkeypatch):
    monkeypatch.setattr(stacking, "_NAMED", 2)
    tiles(6)
    bpy.ops.uv.qh_unwrap(boundary='CIRCLE')
    assert list(sentences(operators.last_outcomes)) == [
        "36 islands lie on others now (first: Tiles, island 1 on Tiles, island 2 (4 faces)): pack them together"
    ]
    first = last_report()[0]
    neighbours = ["Tiles, island 2 (4 faces)", "Tiles, island 7 (4 faces)"]
    assert (first["overlaps"], first["more_overlaps"]) == (neighbours, 0)
    inner = last_report()[7]
    assert len(inner["overlaps"]) == 2 and inner["more_overlaps"] == 2
    assert f"it lies on {inner['overlaps'][0]} and 3 more now: pack them together" in inner["warnings"]


def test_not_all_are_counted():
    outcome = Outcome("Cube", 1, np.arange(4), overlaps=("A", "B"), more_overlaps=ENOUGH - 2, overlap_cure="pack")
    assert outcome.overlap == f"it lies on A and at least {ENOUGH - 1} more now: pack"


def paint(obj, name, with_image):
    """A material of that name, with an image of that name."""
    material = bpy.data.materials.new(name)
    obj.data.materials.append(material)
    if with_image:
        material.use_nodes = True
        image = bpy.data.images.get(name.split(".")[0]) or bpy.data.images.new(name, 64, 64)
        material.node_tree.nodes.new("ShaderNodeTexImage").image = image


@pytest.mark.parametrize(
    ("materials", "with_image", "expected"),
    [
        (None, False, False),  # objects without a material
        (("One", "Other"), True, False),
        (("One", "One"), True, True),  # two materials with the same image
        (("One", "Other"), False, False),
    ],
)
def test_only_what_shares_an_image_overlaps(materials, with_image, expected):
    one, other = add_grid(4, "One"), add_grid(4, "Other", location=(3, 0, 0))
    for obj, shift in ((one, 0), (other, 1)):
        obj.data.uv_layers[0].uv.foreach_set("vector", (uvs(obj) + (shift, 0)).astype(np.float32).ravel())
    for obj, name in zip((one, other), materials or (), strict=False):
        paint(obj, name, with_image)
    bpy.ops.uv.qh_unwrap(boundary='CIRCLE')
    assert [bool(outcome.overlaps) for outcome in operators.last_outcomes] == [expected] * 2
