# SPDX-License-Identifier: GPL-3.0-or-later
"""Which vertices and edges of a mesh count as one since they are at the same place, as files like glTF split them.

It is edges that are welded, and vertices only as the ends of these: faces hang together across edges.  So what merely
meets in a point stays apart, and a face that is very thin keeps its vertices.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .pieces import around_faces, components, first_and_last

_NEAR = 1e-6  # of a mesh's size, up to which vertices are at the same place
_NEAR_OF_EDGE = 1e-2  # of the longest edge at a vertex, up to which they are, since parts of a mesh may be tiny
_NEIGHBOURS = (2, 8, 32)  # how many near ones are asked for, itself included, of a vertex that has as many
_FACES = 8  # at one place of an edge, up to which it is asked which of them lie on each other
_FLAT = 1 - 1e-3  # the cosine of the angle between two faces at an edge, from which on they lie on each other


@dataclass(frozen=True)
class Welds:
    """What counts as one: the number of the first of them, which for all that is alone is its own number."""

    vertex: np.ndarray  # (n,)
    edge: np.ndarray  # (e,)


def find_welds(
    shapes: Iterable[np.ndarray],
    corner_vertex: np.ndarray,
    corner_edge: np.ndarray,
    face_start: np.ndarray,
    edge_count: int,
) -> Welds:
    """Weld the edges of different faces whose ends are at the same places in all shapes.

    shapes                      the vertices' positions, (n, 3) each, of which there is at least one
    corner_vertex, corner_edge  (c,) vertex and edge of each corner
    face_start                  (f,) first corner of each face, ascending
    edge_count                  how many edges there are

    No face gets a vertex twice, and no two faces get the same vertices, unless they have them already.  Where faces lie
    on each other, as the two sides of a card do, an edge is welded only where it is clear which of them goes on as
    which.
    """
    shapes = iter(shapes)
    points = np.asarray(next(shapes), dtype=np.float64)
    vertex, edge = np.arange(len(points)), np.arange(edge_count)
    if not len(face_start):
        return Welds(vertex, edge)
    corner_face, following = around_faces(face_start, len(corner_vertex))
    start, end = corner_vertex.astype(np.intp), corner_vertex[following].astype(np.intp)
    place = _places(points, shapes, start, end)
    if place.max() + 1 < len(points):
        mesh = _Mesh(points, place, start, end, following, corner_edge, corner_face, face_start, edge_count)
        edges, group, vertex = _agreed(mesh, _paired(mesh, _groups(mesh)))
        new = np.append(True, group[1:] != group[:-1])[: len(group)]
        edge[edges] = edges[np.flatnonzero(new)[np.cumsum(new) - 1]]
    return Welds(vertex, edge)


class _Mesh:
    """The mesh, and what there is to know of its corners and edges."""

    def __init__(self, points, place, start, end, following, corner_edge, corner_face, face_start, edge_count):
        self.points, self.place = points, place  # (n, 3) and (n,), of its vertices
        self.start, self.end = start, end  # (c,) the vertices of each corner and of the one that follows
        self.edge, self.face, self.face_start = corner_edge, corner_face, face_start
        self.before = np.empty(len(start), dtype=np.intp)  # the corner before each
        self.before[following] = np.arange(len(start))
        self.uses = np.bincount(corner_edge, minlength=edge_count)
        self.ahead = place[start] < place[end]  # the corners from which the edge leads to the greater place
        self.low, self.high = np.zeros((2, edge_count), dtype=np.intp)  # the ends of edges, (e,) each
        self.low[corner_edge] = np.where(self.ahead, start, end)
        self.high[corner_edge] = np.where(self.ahead, end, start)


# Places


def _places(points, others, start, end):
    """A number for each vertex, (n,), the same where vertices are at the same place in all shapes."""
    place = _near(points, _reach(points, start, end))
    for other in others:
        other = np.asarray(other, dtype=np.float64)
        first = first_and_last(np.arange(len(place)), place, place.max(initial=-1) + 1)[0]
        elsewhere = (other != other[first[place]]).any(axis=1)
        doubtful = np.flatnonzero((np.bincount(place, elsewhere) > 0)[place])
        if len(doubtful):
            parted = _near(other[doubtful], _reach(other, start, end)[doubtful])
            place[doubtful] = len(place) + place[doubtful] * (parted.max() + 1) + parted
            place = np.unique(place, return_inverse=True)[1].ravel()
    return place


def _reach(points, start, end):
    """How far from each vertex, (n,), another one may lie that is at the same place; edges go from `start` to `end`."""
    real = points[np.isfinite(points).all(axis=1)]
    size = np.ptp(real, axis=0).max() if len(real) else 0.0
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.nan_to_num(np.linalg.norm(points[end] - points[start], axis=1), posinf=0.0)
    longest = np.zeros(len(points))
    for ends in (start, end):
        np.maximum.at(longest, ends, length)
    return np.minimum(_NEAR * size, _NEAR_OF_EDGE * longest)


def _near(points, reach):
    """A number for each point, (n,), the same for points that hang together by steps within the reach of both."""
    order = np.lexsort(points.T)
    new = np.ones(len(points), dtype=bool)
    new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    spot = np.empty(len(points), dtype=np.intp)
    spot[order] = np.cumsum(new) - 1  # what is at exactly the same place is one without any search
    its = points[order[new]]
    furthest = np.zeros(len(its))
    np.maximum.at(furthest, spot, reach)
    one, other = _neighbours(its, furthest)
    return components(len(its), one, other)[1][spot].astype(np.intp) if len(one) else spot


def _neighbours(points, reach):
    """The pairs, (k,) and (k,), of different points of which each is in the reach of the other.

    Of points that have many they are only the nearest, which hang together as well as all do.
    """
    asked = np.flatnonzero((reach > 0) & np.isfinite(points).all(axis=1))
    pairs = [np.zeros((2, 0), dtype=np.intp)]
    if len(asked) > 1:
        numbers, bound = asked, np.nextafter(reach.max(), np.inf)
        tree = cKDTree(points[numbers], compact_nodes=False, balanced_tree=False)
        for count in _NEIGHBOURS:
            distance, near = tree.query(points[asked], k=count, distance_upper_bound=bound)
            one, column = np.nonzero(distance <= reach[asked][:, None])
            one, other, apart = asked[one], numbers[near[one, column]], distance[one, column]
            both = (one != other) & (apart <= reach[other])
            pairs.append(np.stack([one[both], other[both]]))
            asked = asked[distance[:, -1] <= reach[asked]]
            if not len(asked):
                break
    return np.hstack(pairs)


# Edges


def _groups(mesh):
    """The number of the group of each edge, (e,): edges of one group have the same places at their ends.  It is -1 for
    those that are alone or without faces, and those that begin and end at one place."""
    low, high = mesh.place[mesh.low], mesh.place[mesh.high]
    edges = np.flatnonzero((mesh.uses > 0) & (low != high))
    key = low[edges] * np.int64(mesh.place.max() + 1) + high[edges]
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    several = count > 1
    number = np.where(several, np.cumsum(several) - 1, -1)
    group = np.full(len(mesh.uses), -1)
    group[edges] = number[inverse.ravel()]
    return group


def _paired(mesh, group):
    """The groups of edges, (e,), without those at which faces lie on each other: of these only pairs of edges are
    left that clearly belong together.

    That is where two faces run along the edge opposite ways, do not lie on each other, and have no other such
    neighbour.  Of several faces in one place, the first goes on as the first, and so on.
    """
    corners = np.flatnonzero(group[mesh.edge] >= 0)
    corners = corners[np.argsort(group[mesh.edge[corners]], kind="stable")]
    its = group[mesh.edge[corners]]
    crowd = np.bincount(its, minlength=group.max(initial=-1) + 1)
    flat = crowd > _FACES
    kept = ~flat[its]
    corners, its = corners[kept], its[kept]
    inward, ahead = _inward(mesh, corners), mesh.ahead[corners]
    rank = np.zeros(len(corners), dtype=np.intp)
    facing = []  # pairs of corners, as places in `corners`, of faces that may belong together
    for shift in range(1, _FACES):
        one = np.flatnonzero(its[:-shift] == its[shift:])
        other = one + shift
        lies_on = (inward[one] * inward[other]).sum(axis=1) > _FLAT
        opposite = ahead[one] != ahead[other]
        flat[its[one[lies_on]]] = True
        rank[other[lies_on & ~opposite]] += 1
        facing.append(np.stack([one, other])[:, ~lies_on & opposite])
    one, other = np.hstack(facing)
    open_one, open_other = (mesh.uses[mesh.edge[corners[each]]] == 1 for each in (one, other))
    chosen = flat[its[one]] & open_one & open_other & (rank[one] == rank[other])
    one, other = one[chosen], other[chosen]
    times = np.bincount(np.concatenate([one, other]), minlength=len(corners))
    clear = (times[one] == 1) & (times[other] == 1)
    group = np.where((group >= 0) & ~flat[group], group, -1) if len(flat) else group
    for each in (one[clear], other[clear]):
        group[mesh.edge[corners[each]]] = len(flat) + np.arange(len(each))
    return group


def _inward(mesh, corners):
    """The unit vectors, (k, 3), in the faces' planes and across the edges that begin at these corners, towards the
    inside of the faces; zero where a face has no area."""
    points, starts = mesh.points, mesh.points[mesh.start[mesh.face_start]]  # from which areas lose no digits
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        from_first = [points[ends] - starts[mesh.face] for ends in (mesh.start, mesh.end)]
        normal = np.add.reduceat(np.cross(*from_first), mesh.face_start)[mesh.face[corners]]
        inward = np.cross(normal, points[mesh.end[corners]] - points[mesh.start[corners]])
        return np.nan_to_num(inward / np.linalg.norm(inward, axis=1, keepdims=True))


def _agreed(mesh, group):
    """The edges to weld, (k,), sorted by their groups, (k,), and what counts as one of the vertices, (n,).

    Edges are taken out of their groups, (e,), until no face has a vertex twice and no two faces have the same vertices,
    unless they have them in the mesh.
    """
    edges = np.flatnonzero(group >= 0)
    edges = edges[np.argsort(group[edges], kind="stable")]
    # Vertices that count as one are at one place: so only faces that have a place twice, or the same places, matter.
    every, own = np.arange(len(mesh.start)), np.arange(len(mesh.place))
    narrow = np.flatnonzero(_among(mesh.face[_twice(mesh, every, mesh.place)], len(mesh.face_start))[mesh.face])
    stacked = np.flatnonzero(_alike(_digests(mesh, mesh.place), _digests(mesh, own)))
    while True:
        same = group[edges[1:]] == group[edges[:-1]]
        one, other = edges[:-1][same], edges[1:][same]
        links = (np.concatenate([mesh.low[each], mesh.high[each]]) for each in (one, other))
        count, part = components(len(own), *links)
        vertex = first_and_last(own, part, count)[0][part].astype(np.intp)
        wrong = _twice(mesh, narrow, vertex)
        if len(stacked):
            doubled = stacked[_alike(_digests(mesh, vertex)[stacked], _digests(mesh, own)[stacked])]
            wrong = np.concatenate([wrong, np.flatnonzero(_among(doubled, len(mesh.face_start))[mesh.face])])
        touched = _among(np.concatenate([mesh.edge[wrong], mesh.edge[mesh.before[wrong]]]), len(group))
        out = touched[edges]
        if not out.any():  # then it is other faces that bring them together
            joined = _among(vertex[mesh.start[wrong]], len(own))[vertex]
            out = joined[mesh.low[edges]] | joined[mesh.high[edges]]
        if not out.any():
            return edges, group[edges], vertex
        edges = edges[~out]


def _among(numbers, count):
    """Which of `count` things are among the numbers, (count,) bool."""
    found = np.zeros(count, dtype=bool)
    found[numbers] = True
    return found


def _twice(mesh, corners, number):
    """Those of the corners that have the number (n,) of their vertex in common with another one of their face which has
    another vertex."""
    key = mesh.face[corners] * np.int64(number.max(initial=0) + 1) + number[mesh.start[corners]]
    order = np.argsort(key, kind="stable")
    one, other = corners[order[:-1]], corners[order[1:]]
    twice = (key[order[1:]] == key[order[:-1]]) & (mesh.start[one] != mesh.start[other])
    return np.concatenate([one[twice], other[twice]])


def _alike(now, before):
    """What has the same digest as something else now, and did not before, (k,) bool."""
    _, number, count = np.unique(now, return_inverse=True, return_counts=True)
    number = number.ravel()
    first = first_and_last(before, number, len(count))[0]
    return (np.bincount(number, before != first[number]) > 0)[number]


def _digests(mesh, number):
    """Numbers of 64 bits, (f,), that are the same for faces that have the same numbers (n,) at their vertices in any
    order, and hardly ever for others."""
    mixed = np.arange(1, number.max(initial=0) + 2, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    mixed ^= mixed >> np.uint64(31)
    return np.add.reduceat(mixed[number[mesh.start]], mesh.face_start)
