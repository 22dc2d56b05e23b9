# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest

from qh_unwrap.core.islands import attached, cuts, find_islands
from qh_unwrap.core.topology import Topology


def mesh(faces, seams=()):
    """The arrays that `find_islands` takes, of faces given as lists of vertices; triangulated as fans."""
    corner_vertex = np.concatenate([np.array(face) for face in faces])
    start = np.cumsum([0] + [len(face) for face in faces])[:-1]
    edges, corner_edge, triangles = {}, [], []
    for face, first in zip(faces, start, strict=True):
        for one, other in zip(face, face[1:] + face[:1], strict=True):
            corner_edge.append(edges.setdefault(frozenset((one, other)), len(edges)))
        triangles += [(first, first + k, first + k + 1) for k in range(1, len(face) - 1)]
    seam = np.zeros(len(edges), dtype=bool)
    for pair in seams:
        seam[edges[frozenset(pair)]] = True
    return corner_vertex, np.array(corner_edge), start, seam, np.array(triangles)


def split(faces, seams=(), selected=None):
    corner_vertex, corner_edge, start, seam, triangles = mesh(faces, seams)
    chosen = np.ones(len(faces), dtype=bool) if selected is None else np.isin(np.arange(len(faces)), selected)
    return find_islands(corner_vertex, corner_edge, start, seam, chosen, triangles)


def grid(size):
    """Quads of a size x size grid; vertex i, j has number i * (size + 1) + j."""
    row = size + 1
    return [
        [i * row + j, (i + 1) * row + j, (i + 1) * row + j + 1, i * row + j + 1]
        for i in range(size)
        for j in range(size)
    ]


def test_one_island_keeps_every_vertex_once():
    (island,) = split(grid(3))
    assert sorted(island.vertices) == list(range(16))
    assert len(island.triangles) == 18
    assert np.array_equal(island.vertices[island.corner_vertex], mesh(grid(3))[0])


def test_triangles_follow_the_faces_winding():
    (island,) = split([[0, 1, 2, 3, 4]])
    assert np.array_equal(island.vertices[island.triangles], [(0, 1, 2), (0, 2, 3), (0, 3, 4)])


def test_seam_across_makes_two_islands():
    across = [(4, 5), (5, 6), (6, 7)]
    one, other = split(grid(3), across)
    assert list(one.faces) == [0, 1, 2]
    assert list(other.faces) == [3, 4, 5, 6, 7, 8]
    assert len(one.vertices) == 8 and len(other.vertices) == 12


def test_seam_inside_opens_the_island():
    row = 5
    inside = [(row * 1 + 2, row * 2 + 2), (row * 2 + 2, row * 3 + 2)]
    (island,) = split(grid(4), inside)
    vertices, counts = np.unique(island.vertices, return_counts=True)
    assert list(vertices[counts == 2]) == [row * 2 + 2], "the middle of the slit, and not its ends"


def test_seam_from_the_outline_opens_its_start():
    (island,) = split(grid(2), [(1, 4)])
    vertices, counts = np.unique(island.vertices, return_counts=True)
    assert list(vertices[counts == 2]) == [1]


def test_bow_tie_is_two_islands():
    one, other = split([[0, 1, 2], [0, 3, 4]])
    assert sorted(one.vertices) == [0, 1, 2] and sorted(other.vertices) == [0, 3, 4]


def test_pinched_island_splits_the_vertex():
    """A ring of faces that meets itself in one vertex only."""
    (island,) = split([[0, 1, 2], [1, 3, 2], [3, 4, 2], [3, 5, 4], [5, 0, 4]])
    assert list(island.vertices).count(0) == 2


def test_edge_of_three_faces_bounds_islands():
    islands = split([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert [list(island.faces) for island in islands] == [[0], [1], [2]]
    assert [island.crowded_edges for island in islands] == [1, 1, 1]


def test_third_face_not_selected_does_not_matter():
    (island,) = split([[0, 1, 2], [1, 0, 3], [0, 1, 4]], selected=[0, 1])
    assert list(island.faces) == [0, 1]


def run_against_each_other(triangles):
    """How many edges have two triangles that run along them the same way."""
    halves = np.vstack([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    return len(halves) - len(np.unique(halves, axis=0))


@pytest.mark.parametrize("flipped", [[4], [0], [0, 1, 2, 5], range(0, 25, 2), range(5, 25)])
def test_the_fewer_faces_are_turned(flipped):
    faces = grid(5)
    turned = [face[::-1] if k in flipped else face for k, face in enumerate(faces)]
    (island,) = split(turned)
    assert sorted(island.vertices) == list(range(36))
    assert run_against_each_other(island.triangles) == 0
    assert island.turned_faces == min(len(flipped), 25 - len(flipped)) and not island.one_sided_edges
    corner_vertex, *_, given = mesh(turned)
    assert np.array_equal(island.vertices[island.triangles], corner_vertex[island.triangle_corners])
    as_given = (island.triangle_corners == given).all(axis=1)
    other_way = (island.triangle_corners == given[:, [0, 2, 1]]).all(axis=1)
    assert (as_given ^ other_way).all() and other_way.sum() == 2 * island.turned_faces


def test_of_as_many_faces_those_unlike_the_first_are_turned():
    (island,) = split([[1, 0, 2], [1, 0, 3]])
    assert island.turned_faces == 1
    assert np.array_equal(island.vertices[island.triangles], [(1, 0, 2), (1, 3, 0)])


def test_islands_are_turned_each_for_itself():
    turned = [[0, 1, 2], [0, 3, 1], [10, 11, 12], [10, 11, 13], [11, 14, 12]]
    one, other = split(turned)
    assert (one.turned_faces, other.turned_faces) == (0, 1)
    assert run_against_each_other(other.triangles) == 0


def moebius(around, across):
    """Quads of a band that is joined to itself turned over."""
    row = across + 1

    def vertex(i, j):
        return i * row + j if i < around else across - j

    return [
        [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]
        for i in range(around)
        for j in range(across)
    ]


def klein(around, across):
    """Quads of a tube that is joined to itself turned over."""

    def vertex(i, j):
        return i * across + j % across if i < around else -j % across

    return [
        [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]
        for i in range(around)
        for j in range(across)
    ]


def projective():
    """Ten triangles that make a projective plane."""
    near = [[0, 1, 4], [0, 1, 5], [0, 2, 3], [0, 2, 5], [0, 3, 4]]
    return near + [[1, 2, 3], [1, 2, 4], [1, 3, 5], [2, 4, 5], [3, 4, 5]]


@pytest.mark.parametrize("faces", [moebius(12, 3), moebius(40, 3), moebius(5, 1), klein(12, 8), projective()])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_one_sided_is_cut(faces, seed):
    random = np.random.default_rng(seed)
    if seed:
        faces = [faces[k] for k in random.permutation(len(faces))]
        faces = [face[::-1] if random.random() < 0.5 else face for face in faces]
    (island,) = split(faces)
    topology = Topology(island.triangles, len(island.vertices))
    assert run_against_each_other(island.triangles) == 0
    assert topology.component_counts == 1 and not topology.pinched.any() and topology.loop_counts > 0
    uses = np.bincount(mesh(faces)[1])
    assert 0 < island.one_sided_edges <= 0.2 * len(uses) + 3
    assert (topology.edge_uses == 1).sum() == (uses == 1).sum() + 2 * island.one_sided_edges, "only cuts open it"


def test_a_seam_across_a_moebius_band_needs_no_cut():
    (island,) = split(moebius(12, 3), [(0, 1), (1, 2), (2, 3)])
    assert island.one_sided_edges == 0 and island.turned_faces == 0
    assert Topology(island.triangles, len(island.vertices)).faults() == {}


def test_one_sided_and_two_sided_islands_side_by_side():
    band = [[vertex + 100 for vertex in face] for face in moebius(12, 3)]
    sheet = grid(4)
    sheet[7] = sheet[7][::-1]
    one, other, third = split([[300, 301, 302], *sheet, *band])
    assert (one.turned_faces, other.turned_faces) == (0, 1)
    assert (one.one_sided_edges, other.one_sided_edges) == (0, 0) and third.one_sided_edges > 0


@pytest.mark.parametrize("size", [3, 4, 6])
@pytest.mark.parametrize("turns", range(3))
@pytest.mark.parametrize("way", [1, -1])
def test_a_doubled_face_takes_the_vertices_of_its_twin(size, turns, way):
    face = [5, 2, 8, 1, 9, 4][:size]
    (island,) = split([face, np.roll(face[::way], turns).tolist()])
    assert list(island.faces) == [0, 1] and island.doubled_faces == 1 and not island.turned_faces
    assert island.own_corners == size and len(island.vertices) == size and len(island.triangles) == size - 2
    corner_vertex = mesh([face, np.roll(face[::way], turns).tolist()])[0]
    assert np.array_equal(island.vertices[island.corner_vertex], corner_vertex[island.corners])
    assert np.array_equal(island.corners, range(2 * size))
    assert len(island.doubled_corners) == size - 2
    number = np.empty(2 * size, int)
    number[island.corners] = island.corner_vertex
    all_triangles = np.vstack([island.triangles, number[island.doubled_corners][:, ::-1]])
    closed = Topology(all_triangles, size)
    assert closed.is_closed and (size > 3 or not closed.misaligned.any()), "they are wound like their twins"


@pytest.mark.parametrize("again", [[(12, 1)], [(12, -1)], [(0, 1)], [(0, -1)], [(3, 1), (3, -1), (4, 1)]])
def test_doubled_faces_do_not_part_a_grid(again):
    faces = grid(5)
    (island,) = split(faces + [faces[k][::way] for k, way in again])
    (alone,) = split(faces)
    assert island.doubled_faces == len(again) and len(island.faces) == 25 + len(again)
    for name in ("vertices", "triangles", "triangle_corners", "drawn_corners"):
        assert np.array_equal(getattr(island, name), getattr(alone, name))
    assert (island.crowded_edges, island.turned_faces) == (0, 0)


def test_a_double_sided_sheet_is_one_island():
    faces = grid(5)
    random = np.random.default_rng(0)
    backs = [np.roll(face[::-1], random.integers(4)).tolist() for face in faces]
    both = [(faces + backs)[k] for k in random.permutation(50)]
    (island,) = split(both)
    assert island.doubled_faces == 25 and len(island.triangles) == 50 and sorted(island.vertices) == list(range(36))
    assert run_against_each_other(island.triangles) == 0
    front, back = split(both[:1] + both), split(both)
    assert front[0].doubled_faces == 26 and len(back) == 1


def test_faces_with_the_same_vertices_in_another_order_are_not_doubled():
    assert all(island.doubled_faces == 0 for island in split([[0, 1, 2, 3], [0, 2, 1, 3]]))


def test_only_selected_faces_count_as_doubled():
    faces = grid(3)
    both = [face[::-1] for face in faces] + faces
    (island,) = split(both, selected=range(9, 18))
    assert island.doubled_faces == 0 and list(island.faces) == list(range(9, 18))


def test_a_pillow_is_opened_by_its_seams():
    pillow = [[0, 1, 2, 3], [3, 2, 1, 0]]
    (opened,) = split(pillow, [(0, 1), (1, 2), (2, 3)])
    assert opened.doubled_faces == 0 and len(opened.triangles) == 4 and len(opened.vertices) == 6
    assert len(split(pillow, [(0, 1), (1, 2), (2, 3), (3, 0)])) == 2
    (doubled,) = split(pillow)
    assert doubled.doubled_faces == 1


def test_the_rest_of_a_double_sided_sheet_holds_nothing():
    faces = grid(3)
    corner_vertex, corner_edge, start, seam, _ = mesh(faces + [face[::-1] for face in faces])
    uv = np.array([(i, j) for i in range(4) for j in range(4)], dtype=float)[corner_vertex]
    for selected in (np.arange(18) < 9, np.arange(18) >= 9):
        assert not attached(corner_vertex, corner_edge, start, seam, selected, uv).any()
    column = np.arange(18) < 3
    found = attached(corner_vertex, corner_edge, start, seam, column, uv)
    assert set(corner_vertex[found]) == {4, 5, 6, 7}


def test_attached_corners():
    """The left column of a grid of 3 x 3 quads is selected."""
    faces = grid(3)
    corner_vertex, corner_edge, start, seam, _ = mesh(faces)
    points = np.array([(i, j) for i in range(4) for j in range(4)], dtype=float)
    selected = np.arange(9) < 3
    arguments = corner_vertex, corner_edge, start
    shared = np.isin(corner_vertex, [4, 5, 6, 7]) & (np.arange(36) < 12)
    uv = points[corner_vertex]
    assert np.array_equal(attached(*arguments, seam, selected, uv), shared)
    assert not attached(*arguments, seam, np.ones(9, dtype=bool), uv).any()
    moved = uv.copy()
    moved[:12] += 5
    assert not attached(*arguments, seam, selected, moved).any(), "the UVs part them"
    seam[corner_edge[[1, 5, 9]]] = True
    assert not attached(*arguments, seam, selected, uv).any(), "seams part them"


def test_attached_at_one_vertex_only():
    """Faces that touch in a corner hang together there when others join them."""
    faces = grid(2)
    corner_vertex, corner_edge, start, seam, _ = mesh(faces)
    uv = np.array([(i, j) for i in range(3) for j in range(3)], dtype=float)[corner_vertex]
    found = attached(corner_vertex, corner_edge, start, seam, np.array([True, True, True, False]), uv)
    assert set(corner_vertex[found]) == {4, 5, 7} and found[:4].sum() == 1


def test_only_selected_faces():
    islands = split(grid(3), selected=[0, 2, 8])
    assert [list(island.faces) for island in islands] == [[0], [2], [8]]
    assert split(grid(3), selected=[]) == []


@pytest.mark.parametrize(
    "faces",
    [
        [[0, 1, 2, 3], [2, 1, 0, 4]],  # both cut from 0 to 2
        [[0, 1, 2, 3, 4, 5], [3, 2, 1, 0, 6, 7]],  # three edges in a row
        [[0, 1, 2, 3], [2, 1, 0, 4], [0, 3, 5], [3, 2, 5], [2, 4, 6], [4, 0, 6]],
    ],
)
def test_faces_that_share_several_edges(faces):
    """The triangles beside the shared edges must not lie on top of each other."""
    (island,) = split(faces)
    triangles = np.sort(island.triangles, axis=1)
    assert len(np.unique(triangles, axis=0)) == len(triangles) == sum(len(face) - 2 for face in faces)
    edges = np.sort(np.vstack([island.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    assert np.unique(edges, axis=0, return_counts=True)[1].max() == 2
    directed = np.vstack([island.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    assert len(np.unique(directed, axis=0)) == len(directed), "all are wound alike"


@pytest.mark.parametrize("seed", range(5))
def test_every_selected_corner_is_in_one_island(seed):
    random = np.random.default_rng(seed)
    faces = grid(6)
    edges = [(face[k], face[k - 1]) for face in faces for k in range(4)]
    seams = [edges[k] for k in random.choice(len(edges), 25)]
    selected = np.flatnonzero(random.random(len(faces)) < 0.7)
    islands = split(faces, seams, selected)
    corners = np.concatenate([island.corners for island in islands])
    assert np.array_equal(np.sort(corners), np.flatnonzero(np.isin(np.repeat(range(36), 4), selected)))
    for island in islands:
        assert np.array_equal(np.unique(island.triangles), np.arange(len(island.vertices)))
        assert len(island.triangles) == 2 * len(island.faces)


@pytest.mark.parametrize("scale", [1e-6, 1e-5, 1e-3, 1, 1e4])
@pytest.mark.parametrize("tile", [0, 1, 9, 100])
def test_cuts_and_attachments_do_not_depend_on_scale_and_tile(scale, tile):
    if tile and scale < 1e-3:
        pytest.skip("32-bit floats there are too coarse")
    corner_vertex, corner_edge, start, seam, _ = mesh(grid(3))
    points = np.array([(i, j) for i in range(4) for j in range(4)], dtype=float) / 3
    uv = points[corner_vertex]
    selected = np.arange(9) < 3

    def stored(uv):
        return (uv * scale + [tile, 0]).astype(np.float32).astype(float)

    assert not cuts(corner_vertex, corner_edge, start, len(seam), stored(uv)).any()
    assert attached(corner_vertex, corner_edge, start, seam, selected, stored(uv)).sum() == 6
    for gap in (0.5, 0.05):
        parted = uv.copy()
        parted[12:] += gap
        assert cuts(corner_vertex, corner_edge, start, len(seam), stored(parted)).sum() == 3
        assert not attached(corner_vertex, corner_edge, start, seam, selected, stored(parted)).any()
    nearly = np.nextafter(stored(uv).astype(np.float32), np.float32(1e9)).astype(float)
    nearly[12:] = stored(uv)[12:]
    assert not cuts(corner_vertex, corner_edge, start, len(seam), nearly).any()
    assert attached(corner_vertex, corner_edge, start, seam, selected, nearly).sum() == 6


def test_cuts_are_where_uvs_part():
    corner_vertex, corner_edge, start, seam, _ = mesh(grid(2))
    points = np.array([(i, j) for i in range(3) for j in range(3)], dtype=float)
    uv = points[corner_vertex]
    assert not cuts(corner_vertex, corner_edge, start, len(seam), uv).any()
    uv[4:8] += 5
    cut = cuts(corner_vertex, corner_edge, start, len(seam), uv)
    inner = {edge for edge in corner_edge[4:8] if np.sum(corner_edge == edge) == 2}
    assert set(np.flatnonzero(cut)) == inner and len(inner) == 2
