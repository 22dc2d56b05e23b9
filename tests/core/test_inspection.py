# SPDX-License-Identifier: GPL-3.0-or-later
"""Any UVs, whoever made them: their islands, their faults, and nothing that is none."""

import numpy as np
import pytest

from qh_unwrap.core import unwrap
from qh_unwrap.core.inspection import inspect
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.uv_islands import uv_islands

from . import shapes


class Mesh:
    """Polygons with UVs at their corners, and what is found in them."""

    def __init__(self, points, faces, uv=None):
        sizes = [len(face) for face in faces]
        self.face_start = np.cumsum([0, *sizes[:-1]])
        self.points, self.corner_vertex = np.asarray(points, float), np.concatenate(faces).astype(int)
        sides = [(face[k], face[(k + 1) % len(face)]) for face in faces for k in range(len(face))]
        keys, self.corner_edge = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        self.corner_edge, self.edge_count = self.corner_edge.ravel(), len(keys)
        fans = [
            (start, start + k, start + k + 1)
            for start, size in zip(self.face_start, sizes, strict=True)
            for k in range(1, size - 1)
        ]
        self.corner_triangles = np.array(fans)
        self.uv = np.array(self.points[self.corner_vertex, :2] if uv is None else uv, float)
        self.selected = np.ones(len(faces), bool)

    def corners(self, face):
        return slice(self.face_start[face], [*self.face_start[1:], len(self.uv)][face])

    def islands(self):
        its = self.corner_vertex, self.corner_edge, self.face_start, self.edge_count, self.corner_triangles
        return uv_islands(*its, self.uv, self.selected)

    def inspected(self, sheet=None, aspect=None):
        islands = self.islands()
        sheet = np.zeros(islands.count, int) if sheet is None else np.asarray(sheet)
        aspect = np.ones(islands.count) if aspect is None else aspect
        corners = self.points[self.corner_vertex]
        return finished(inspect(islands, corners, self.uv, aspect, sheet, self.face_start))


def quads(columns=4, rows=3):
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    start = np.add.outer(np.arange(rows) * (columns + 1), np.arange(columns)).ravel()
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return Mesh(points, np.column_stack([start, start + 1, start + columns + 2, start + columns + 1]))


def test_islands_are_where_uvs_agree():
    mesh = quads()
    assert mesh.islands().count == 1
    for face in (1, 5, 9):
        mesh.uv[mesh.corners(face)] += (5, 0)
    islands = mesh.islands()
    assert islands.count == 3 and islands.face_island.tolist() == [0, 1, 2, 2] * 3
    mesh.selected[[1, 5, 9]] = False
    islands = mesh.islands()
    assert islands.face_island.tolist() == [0, -1, 1, 1] * 3 and len(islands.island) == 18


def test_rounding_does_not_part_islands():
    mesh = quads()
    mesh.uv = (mesh.uv + 1e-7 * np.random.default_rng(0).random(mesh.uv.shape)).astype(np.float32).astype(float)
    found = mesh.inspected()
    assert mesh.islands().count == 1 and found.certified.all() and not found.covered.any()


def test_a_valid_map_is_certified_and_measured():
    vertices, triangles = shapes.bump(3)
    result = unwrap(vertices, triangles)
    mesh = Mesh(vertices, triangles, result.uv[triangles.ravel()])
    found = mesh.inspected()
    assert found.certified.tolist() == [True] == [result.report.injective]
    assert found.measured.islands[0].to_dict() == pytest.approx(result.report.after.to_dict(), rel=1e-5)
    assert found.measured.whole.l2_stretch == pytest.approx(found.measured.islands[0].l2_stretch)


@pytest.mark.parametrize("size", [2, 12])  # few triangles are compared pair by pair, many by their outlines first
def test_flips_overlaps_and_collapses_are_found(size):
    mesh = quads(size, size)
    valid = mesh.uv.copy()
    for what in ("flip", "fold", "collapse", "mirror"):
        mesh.uv = valid.copy()
        if what == "flip":
            mesh.uv[(valid == (1, 1)).all(axis=1)] += (1.3, 1.3)
        elif what == "fold":
            mesh.uv[:, 0] = np.abs(valid[:, 0] - size / 2)
        elif what == "collapse":
            mesh.uv[(valid[:, 0] == 0)] += (1, 0)
        else:
            mesh.uv[:, 0] *= -1
        found = mesh.inspected()
        its = found.measured.islands[0]
        assert (its.flips > 0) == (what in ("flip", "fold"))
        assert its.collapsed == (2 * size if what == "collapse" else 0)
        assert found.overlaps_itself[0] == found.covered.any() == (what in ("flip", "fold"))
        assert found.certified[0] == (what == "mirror") == found.measured.mirrored[0]


def test_an_island_that_winds_over_itself_without_flips_overlaps_itself():
    angle = np.linspace(0, 2.5 * np.pi, 60)
    spiral = np.concatenate([radius * np.column_stack([np.cos(angle), np.sin(angle)]) for radius in (2, 1)])
    start = np.arange(59)
    mesh = Mesh(
        np.column_stack([spiral, np.repeat(angle, 2).reshape(2, -1).ravel()]),
        np.column_stack([start, start + 60, start + 61, start + 1])[:, ::-1],
    )
    found = mesh.inspected()
    assert not found.measured.islands[0].flips and found.overlaps_itself[0] and not found.certified[0]
    assert 10 < found.covered.sum() < 60


def test_islands_on_each_other_are_found_but_for_stacks_and_other_images():
    mesh = quads(6, 1)
    for face in range(6):
        mesh.uv[mesh.corners(face)] = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) + (3 * face, 0)
    assert not len(mesh.inspected().pairs) and mesh.inspected().certified.all()
    mesh.uv[mesh.corners(1)] = mesh.uv[mesh.corners(0)][[2, 1, 0, 3]]  # the same, mirrored
    mesh.uv[mesh.corners(2)] = mesh.uv[mesh.corners(3)] + (0.5, 0)
    found = mesh.inspected()
    assert found.pairs.tolist() == [[2, 3]]
    assert found.stack.tolist() == [0, 0, 2, 3, 4, 5]
    assert found.covered.sum() == 4
    assert not len(mesh.inspected(sheet=[0, 0, 1, 0, 0, 0]).pairs)


def test_islands_that_touch_but_for_rounding_are_told_apart():
    mesh = quads(3, 1)
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) / 3
    for shift, pairs, grazes in ((0, 0, 0), (-1e-7, 0, 2), (-1e-5, 1, 0)):
        mesh.uv = np.concatenate([square, square + 5, square + (1 / 3 + shift, 0)]).astype(np.float32).astype(float)
        found = mesh.inspected()
        assert (len(found.pairs), found.grazes.sum()) == (pairs, grazes)
        assert found.covered.any() == bool(pairs) and found.certified.all()


def test_any_mesh_can_be_inspected():
    vertices, triangles = shapes.torus()
    closed = Mesh(vertices, triangles).inspected()  # seen from above: it lies on itself
    assert closed.overlaps_itself.all() and not closed.certified.any()
    fins = Mesh(
        [(0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 0), (-1, 0, 0), (-1, 1, 0), (0, 0, 1), (0, 1, 1)],
        [[0, 2, 3, 1], [0, 1, 5, 4], [0, 6, 7, 1]],
    )
    fins.uv[8:] = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) + (3, 0)
    assert fins.islands().count == 3 and fins.inspected().certified.all()
    doubled = quads(2, 1)
    doubled = Mesh(doubled.points, [*doubled.corner_vertex.reshape(-1, 4), *doubled.corner_vertex.reshape(-1, 4)])
    assert doubled.islands().count == 2 and len(set(doubled.inspected().stack.tolist())) == 1
    doubled.uv[8:] += (0.5, 0)
    assert doubled.inspected().pairs.tolist() == [[0, 1]]


def test_a_face_that_is_inside_out_is_no_flip():
    mesh = quads(3, 3)
    faces = mesh.corner_vertex.reshape(-1, 4).copy()
    faces[4] = faces[4, ::-1]
    mesh = Mesh(mesh.points, faces)
    assert mesh.inspected().certified.all() and mesh.islands().turned_faces.sum() == 1


def test_lengths_are_those_of_the_image():
    mesh = quads()
    mesh.uv *= (0.5, 1)
    assert mesh.inspected().measured.whole.angle == pytest.approx(2)
    assert mesh.inspected(aspect=np.array([2.0])).measured.whole.angle == pytest.approx(1)
