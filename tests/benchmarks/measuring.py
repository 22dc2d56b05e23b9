# SPDX-License-Identifier: GPL-3.0-or-later
"""How good maps are, of one surface and of all islands of a mesh; only `measures` asks the package.

Whether a map covers anything twice is decided here, apart from the package's own certificate.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from qh_unwrap.core import UnwrapError, distortion

MEASURES = {"energy": "symmetric_dirichlet", "l2_stretch": "l2_stretch", "angle": "angle", "area": "area"}


class Island(NamedTuple):
    """What hangs together in a map of a mesh."""

    vertices: np.ndarray  # (n, 3)
    triangles: np.ndarray  # (m, 3)
    uv: np.ndarray  # (n, 2)


def measures(vertices, triangles, uv):
    """Measures of a map of one piece, a dictionary; infinite where there is no map, or none that can be measured."""
    found = {**dict.fromkeys(MEASURES, np.inf), "flips": 0, "collapsed": 0}
    if uv is None:
        return found
    try:
        after = distortion(vertices, triangles, uv)
    except UnwrapError as error:
        print(f"cannot be measured: {error}")
        return found
    for name, own_name in MEASURES.items():
        value = getattr(after, own_name)
        found[name] = value if np.isfinite(value) else np.inf
    return {**found, "flips": after.flips, "collapsed": after.collapsed}


def judged(mesh, seconds, uv):
    """Time and measures of a map, and whether it is certified free of flips and overlaps."""
    certified = uv is not None and is_injective(mesh[1], uv)
    return {"seconds": seconds, **measures(*mesh, uv), "certified": certified}


# Islands


def judged_islands(islands):
    """Of all islands of a map: energies (i,), their mean by area and the worst, flips, and how many are certified."""
    maps = [judged(island[:2], 0, island.uv) for island in islands]
    energies = np.array([one["energy"] for one in maps])
    return {
        "energies": energies,
        "energy": float(np.average(energies, weights=[area_of(*island[:2]) for island in islands])),
        "worst": float(energies.max()),
        "flips": sum(one["flips"] for one in maps),
        "certified": sum(one["certified"] for one in maps),
    }


def islands_of(polygons, triangles, uv):
    """The islands of a map of the corners (c, 2), by their first triangles; `triangles` (t, 3) are of corners.

    Two triangles are in one island if they share an edge and have the same UVs at both of its ends.
    """
    place = np.unique(np.column_stack([polygons.corners, uv]), axis=0, return_inverse=True)[1].ravel()
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()  # of the sides
    backwards = place[start] > place[end]
    low, high = np.where(backwards, end, start), np.where(backwards, start, end)
    order = np.lexsort((place[high], place[low]))
    low, high = low[order], high[order]
    same = (place[low][1:] == place[low][:-1]) & (place[high][1:] == place[high][:-1])
    joined = [np.concatenate([side[:-1][same], side[1:][same]]).reshape(2, -1) for side in (low, high)]
    links = np.concatenate(joined, axis=1)
    corner_vertex = _components(links, len(uv))
    within = np.stack([triangles[:, :2], triangles[:, 1:]]).reshape(-1, 2).T
    island = _components(np.concatenate([links, within], axis=1), len(uv))[triangles[:, 0]]
    order = np.argsort(island, kind="stable")
    parts = np.split(triangles[order], np.flatnonzero(np.diff(island[order])) + 1)
    return [_island(polygons, part, corner_vertex, uv) for part in sorted(parts, key=lambda part: part[0, 0])]


def _components(links, count):
    """The component (count,) of each of so many things of which `links` (2, k) are linked."""
    return connected_components(coo_array((np.ones(links.shape[1]), links), shape=(count, count)), directed=False)[1]


def _island(polygons, triangles, corner_vertex, uv):
    _, first, numbered = np.unique(corner_vertex[triangles], return_index=True, return_inverse=True)
    corner = triangles.ravel()[first]
    return Island(polygons.vertices[polygons.corners[corner]], numbered.reshape(-1, 3), uv[corner])


def area_of(vertices, triangles):
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def outline(triangles):
    """The sides (k, 2) that only one triangle has, in the direction of its winding."""
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, edge, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    return sides[count[edge.ravel()] == 1]


# Whether anything is covered twice


def is_injective(triangles, uv):
    """Whether no two points of a piece share a place in the 32-bit floats that Blender stores; exact.

    If all triangles follow their winding, a place is covered as often as the outline winds around it: once or never, if
    its loops are simple and apart, and one of them, the outer, runs counter-clockwise.
    """
    stored = np.asarray(uv).astype(np.float32).astype(float)
    if (_turn(*stored[triangles].transpose(1, 0, 2)) <= 0).any():
        return False
    sides = outline(triangles)
    starts, ends = sides.T
    if len(np.unique(starts)) < len(starts):
        return False  # two loops meet
    loop = np.unique(_components(sides.T, len(uv))[starts], return_inverse=True)[1]
    (x, y), (next_x, next_y) = stored[starts].T, stored[ends].T
    # About a vertex of its own the area of every loop has the right sign.
    origin = stored[starts[np.unique(loop, return_index=True)[1]]][loop].T
    x, y, next_x, next_y = x - origin[0], y - origin[1], next_x - origin[0], next_y - origin[1]
    outer = np.bincount(loop, x * next_y - y * next_x) > 0
    return outer.sum() == 1 and not _meet(stored, sides)


def _meet(points, sides):
    """Whether any two of the sides (k, 2) cross, touch or overlap, but for where one ends and the next begins."""
    following = np.empty(len(points), int)
    following[sides[:, 0]] = sides[:, 1]
    a, b = points[sides.T]
    c = points[following[sides[:, 1]]]
    if ((_turn(a, b, c) == 0) & (((b - a) * (c - b)).sum(axis=1) <= 0)).any():
        return True  # one turns back on the side before
    low, high = np.minimum(a, b), np.maximum(a, b)
    axis = int(np.ptp(low, axis=0).argmax())
    order = np.argsort(low[:, axis])
    low, high, sides = low[order], high[order], sides[order]
    last = np.searchsorted(low[:, axis], high[:, axis], side="right")
    one = np.arange(len(sides))
    for step in range(1, len(sides)):  # each and the one so many places on, if that begins before it ends
        one = one[one + step < last[one]]
        if not len(one):
            return False
        other = one + step
        near = ((low[one] <= high[other]) & (low[other] <= high[one])).all(axis=1)
        near &= (sides[one] != sides[other][:, ::-1]).all(axis=1)  # no neighbours
        a, b = points[sides[one[near]].T]
        c, d = points[sides[other[near]].T]
        across, back = _turn(a, b, c) * _turn(a, b, d), _turn(c, d, a) * _turn(c, d, b)
        if ((across <= 0) & (back <= 0)).any():
            return True
    return False


def _turn(a, b, c):
    """1 where the points a, b, c (n, 2) turn left, -1 where they turn right, 0 where they lie on a line."""
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    first, second = bx * cy, by * cx
    turn = np.sign(first - second)
    for k in np.flatnonzero(np.abs(first - second) <= 1e-14 * (np.abs(first) + np.abs(second))):
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(value) for value in point[k].tolist()] for point in (a, b, c))
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        turn[k] = (det > 0) - (det < 0)
    return turn
