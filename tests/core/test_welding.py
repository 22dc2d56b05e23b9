# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices at the same place count as one, and what must not come of that."""

import numpy as np
import pytest

from qh_unwrap.core import unwrap
from qh_unwrap.core.islands import find_islands
from qh_unwrap.core.welding import find_welds


def arrays(faces):
    """The arrays of the corners and faces, and the number of edges, of faces given as lists of vertices."""
    corner_vertex = np.concatenate([np.array(face) for face in faces])
    start = np.cumsum([0] + [len(face) for face in faces])[:-1]
    edges = {}
    corner_edge = [
        edges.setdefault(frozenset(ends), len(edges))
        for face in faces
        for ends in zip(face, face[1:] + face[:1], strict=True)
    ]
    return corner_vertex, np.array(corner_edge), start, len(edges)


def welded(points, faces, *others):
    return find_welds([np.asarray(points, float), *others], *arrays(faces))


def islands(points, faces, *others, seams=()):
    """The islands of the welded faces; `seams` are edges by number."""
    corner_vertex, corner_edge, start, count = arrays(faces)
    welds = find_welds([np.asarray(points, float), *others], corner_vertex, corner_edge, start, count)
    seam = np.isin(welds.edge, welds.edge[list(seams)])
    triangles = [
        (at, at + k, at + k + 1) for at, face in zip(start, faces, strict=True) for k in range(1, len(face) - 1)
    ]
    everything = np.ones(len(faces), dtype=bool)
    corners = welds.vertex[corner_vertex], welds.edge[corner_edge], start
    return find_islands(*corners, seam, everything, np.array(triangles))


def grid(size=4):
    """Points and quads of a bumpy square."""
    x, y = np.meshgrid(np.linspace(0, 1, size + 1), np.linspace(0, 1, size + 1), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), (0.3 * np.sin(3 * x) * np.cos(2 * y + 0.4)).ravel()])
    corner = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    return points, np.column_stack([corner, corner + size + 1, corner + size + 2, corner + 1]).tolist()


def triangulated(faces, first=0):
    """Each quad as two triangles, cut from its `first` corner."""
    turned = [face[first:] + face[:first] for face in faces]
    return [triangle for a, b, c, d in turned for triangle in ([a, b, c], [a, c, d])]


def soup(points, faces):
    """The same with vertices of its own for every face."""
    ends = np.cumsum([len(face) for face in faces])
    apart = [list(range(end - len(face), end)) for end, face in zip(ends, faces, strict=True)]
    return np.asarray(points)[np.concatenate(faces)], apart


def stacked(*meshes):
    """Several meshes, each points and faces, as one."""
    first = np.cumsum([0] + [len(points) for points, _ in meshes])
    faces = [[v + at for v in face] for (_, its), at in zip(meshes, first, strict=False) for face in its]
    return np.vstack([points for points, _ in meshes]), faces


def reverse(faces):
    return [face[::-1] for face in faces]


def counts(welds):
    return len(np.unique(welds.vertex)), len(np.unique(welds.edge))


# What is welded


def test_nothing_changes_where_no_vertices_coincide():
    points, faces = grid()
    welds = welded(points, faces)
    assert np.array_equal(welds.vertex, np.arange(25)) and np.array_equal(welds.edge, np.arange(40))


def test_each_counts_as_the_first_of_them():
    welds = welded([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [[0, 1, 2], [3, 4, 5]])
    assert welds.vertex.tolist() == [0, 1, 2, 1, 4, 2]
    assert welds.edge.tolist() == [0, 1, 2, 3, 4, 1]


@pytest.mark.parametrize("origin", [0, 0.1, -7])
@pytest.mark.parametrize("size", [1e-18, 1, 1e30])
@pytest.mark.parametrize("gap", [0, 1e-7, 2.5e-7])
def test_a_soup_is_a_grid_wherever_it_lies(gap, size, origin):
    """Places are no cells: there is no border at which near vertices are parted."""
    points, faces = soup(*grid(9))
    points = points + origin + gap * np.random.default_rng(0).uniform(-1, 1, points.shape)
    assert counts(welded(size * points, faces)) == (100, 180)
    (island,) = islands(size * points, faces)
    assert len(island.vertices) == 100


def test_vertices_that_are_only_near_are_apart():
    points, faces = soup(*grid(9))
    points += 1e-4 * np.random.default_rng(0).uniform(-1, 1, points.shape)
    assert counts(welded(points, faces)) == (324, 324)


@pytest.mark.parametrize("gap", [0, 1e-7])
def test_what_is_tiny_beside_the_rest_is_welded_like_anything(gap):
    points, faces = soup(*grid(9))
    points += gap * np.random.default_rng(0).uniform(-1, 1, points.shape)
    large = 1e9 * np.eye(3)
    welds = welded(*stacked((points, faces), (large, [[0, 1, 2]])))
    assert counts(welds) == (103, 183)


def test_many_vertices_at_a_place():
    angles = np.linspace(0, 6, 2001)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(2001)])
    points = np.stack([np.zeros((2000, 3)), rim[:-1], rim[1:]], axis=1).reshape(-1, 3)
    points += 1e-7 * np.random.default_rng(0).uniform(-1, 1, points.shape)
    faces = np.arange(6000).reshape(-1, 3).tolist()
    assert counts(welded(points, faces)) == (2002, 4001)


@pytest.mark.parametrize("seed", range(8))
def test_a_mesh_split_anywhere_has_the_islands_of_the_whole(seed):
    rng = np.random.default_rng(seed)
    points, faces = grid(7)
    faces = [face[::-1] if rng.random() < 0.2 else face for face in faces]
    faces = [faces[k] for k in rng.permutation(len(faces)) if rng.random() < 0.9]
    label = rng.integers(1 + seed, size=len(faces))
    number, apart = {}, []
    for face, its in zip(faces, label, strict=True):
        apart.append([number.setdefault((v, its), len(number)) for v in face])
    split = points[[v for v, _ in number]] + 1e-7 * rng.uniform(-1, 1, (len(number), 3))
    corner_edge, count = arrays(faces)[1::2]
    seams = rng.choice(count, 12, replace=False)
    seam_there = np.unique(arrays(apart)[1][np.isin(corner_edge, seams)])
    whole, found = islands(points, faces, seams=seams), islands(split, apart, seams=seam_there)
    assert len(whole) == len(found)
    for one, other in zip(whole, found, strict=True):
        for name in ("faces", "corners", "corner_vertex", "triangles", "drawn_corners"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_a_seam_on_one_of_them_is_a_seam():
    points, faces = soup(*grid(1 + 1))
    edge = arrays(faces)[1]
    first = islands(points, faces)
    assert len(first) == 1
    across = [edge[1], edge[5]]  # of the first two quads, towards the others
    assert [list(island.faces) for island in islands(points, faces, seams=across)] == [[0, 1], [2, 3]]


# What is not


def test_what_parts_in_any_shape_is_two():
    points, faces = soup(*grid(2))
    opened = points.copy()
    opened[8:] += (1e-3, 0, 0)
    assert len(islands(points, faces, points, points)) == 1
    assert [list(island.faces) for island in islands(points, faces, points, opened)] == [[0, 1], [2, 3]]
    assert [list(island.faces) for island in islands(opened, faces, points)] == [[0, 1], [2, 3]]


def test_a_shape_in_which_all_is_at_one_place_parts_nothing():
    points, faces = soup(*grid(3))
    assert counts(welded(points, faces, 0 * points)) == (16, 24)
    assert counts(welded(0 * points, faces, points)) == (16, 24)
    assert counts(welded(0 * points, faces)) == (36, 36)


SIDES = [(0, 0), (0, 1), (0, 2), (1, 3)]  # the corners from which the quads of the front and the back are cut


@pytest.mark.parametrize("size", [1, 4])
@pytest.mark.parametrize(("front", "back"), SIDES)
@pytest.mark.parametrize("apart", [False, True])
def test_the_two_sides_of_a_card_stay_two(size, front, back, apart):
    points, faces = grid(size)
    points[:, 2] *= 0.02  # so that the triangles of both sides nearly lie on each other, however they are cut
    sides = [(points, triangulated(faces, front)), (points, triangulated(reverse(faces), back))]
    points, faces = stacked(*(soup(*side) if apart else side for side in sides))
    its = islands(points, faces)
    assert [len(island.faces) for island in its] == [2 * size**2, 2 * size**2]
    assert all(island.doubled_faces == island.crowded_edges == 0 for island in its)


@pytest.mark.parametrize("apart", [False, True])
def test_the_faces_of_a_card_may_come_in_any_order(apart):
    points, faces = grid(4)
    points, faces = stacked((points, faces), (points, reverse(faces)))
    faces = [faces[k] for k in np.random.default_rng(0).permutation(len(faces))]
    its = islands(*(soup(points, faces) if apart else (points, faces)))
    assert [len(island.faces) for island in its] == [16, 16]


def test_a_card_in_a_larger_sheet_leaves_that_whole():
    points, faces = grid(5)
    inner = [faces[k] for k in (6, 7, 8, 11, 12, 13)]
    its = islands(*stacked(soup(points, faces), soup(points, reverse(inner))))
    assert [len(island.faces) for island in its] == [25, 6]


@pytest.mark.parametrize("apart", [False, True])
def test_a_mesh_and_its_copy_are_two(apart):
    mesh = soup(*grid(4)) if apart else grid(4)
    assert [len(island.faces) for island in islands(*stacked(mesh, mesh))] == [16, 16]


def test_doubled_faces_of_the_mesh_stay_doubled():
    points, faces = grid(4)
    (island,) = islands(points, faces + reverse(faces))
    assert island.doubled_faces == 16


def test_cubes_that_share_a_side_stay_apart():
    cube = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    its = islands(*stacked((cube, sides), (cube + (1, 0, 0), sides)))
    assert [len(island.faces) for island in its] == [6, 6]


def test_islands_end_where_more_than_two_faces_meet():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)], dtype=float)
    faces = [[0, 1, 2], [1, 0, 3], [0, 1, 4]]
    for its in (islands(points, faces), islands(*soup(points, faces))):
        assert [island.crowded_edges for island in its] == [1, 1, 1]


# Faces without area


def test_a_collapsed_face_keeps_its_vertices_and_does_not_part_the_others():
    points, faces = soup(*grid(4))
    inner = grid(4)[0][12]
    points = np.vstack([points, inner, inner, grid(4)[0][13]])
    welds = welded(points, [*faces, [64, 65, 66]])
    assert len(np.unique(welds.vertex[[64, 65, 66]])) == 3
    assert counts(welds) == (28, 43)
    whole, collapsed = islands(points, [*faces, [64, 65, 66]])
    assert len(whole.faces) == 16 and len(whole.vertices) == 25 and list(collapsed.faces) == [16]


@pytest.mark.parametrize("apart", [False, True])
def test_quads_that_end_in_a_pole_keep_their_sides(apart):
    """As a sphere of longitudes and latitudes has them; remove one, so that it has an outline."""
    angle = np.arange(12) * np.pi / 6
    rings = [
        np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(12, height)])
        for r, height in ((0, 1), (0.5, 0.9), (1, 0))
    ]
    faces = [
        [12 * i + k, 12 * i + (k + 1) % 12, 12 * i + 12 + (k + 1) % 12, 12 * i + 12 + k]
        for i in (0, 1)
        for k in range(12)
    ]
    points = np.vstack(rings)
    (island,) = islands(*(soup(points, faces) if apart else (points, faces)))
    assert len(island.faces) == 24 and len(island.vertices) == 36


def test_a_face_is_kept_apart_where_the_others_close_around_it():
    """All but one of the triangles around a point end there; a quad has two corners in its place."""
    angle = np.arange(6) * np.pi / 3
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6)])
    points = np.vstack([rim, np.zeros((2, 3))])
    faces = [[k, (k + 1) % 6, 6] for k in range(5)] + [[5, 0, 6, 7]]
    points, faces = soup(points, faces)
    welds = welded(points, faces)
    assert len(np.unique(welds.vertex[faces[-1]])) == 4
    assert [list(island.faces) for island in islands(points, faces)] == [[0, 1, 2, 3, 4], [5]]


def test_vertices_that_are_nowhere_do_not_matter():
    points, faces = soup(*grid(3))
    points[5] = np.nan
    points[17] = np.inf
    assert len(islands(points, faces)) == 1
    assert counts(welded(np.full((8, 3), np.nan), [[0, 1, 2, 3], [4, 5, 6, 7]])) == (8, 8)
    assert len(find_welds([np.zeros((3, 3))], *(np.zeros(0, int),) * 3, 0).vertex) == 3


def test_a_welded_soup_is_unwrapped_like_the_whole():
    points, faces = grid(20)
    faces = triangulated(faces)
    (island,) = islands(*soup(points, faces))
    split = soup(points, faces)[0]
    result = unwrap(split[island.vertices], island.triangles)
    expected = unwrap(points, np.array(faces))
    assert result.report.injective
    assert np.abs(result.uv[island.corner_vertex] - expected.uv[np.concatenate(faces)]).max() < 1e-5
