# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes straight in a map, and where it goes: loops of edges along U or V, and quads that become a rectangle."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .errors import BoundaryError, PinError, UVError
from .pieces import components

_GENTLE = 0.0  # cosine of the angle between two edges, below which one goes on as the other


class Polygons(NamedTuple):
    """The faces of an island, side by side: each side goes from one of its vertices to the next around a face."""

    start: np.ndarray  # (h,)
    end: np.ndarray  # (h,)
    face: np.ndarray  # (h,), the sides of a face follow each other


class Straight(NamedTuple):
    """What is to be held of a map's vertices so that it is straight."""

    held: np.ndarray  # (n, 2) bool
    values: np.ndarray  # (n, 2), where that is


def straight_lines(
    polygons: Polygons,
    vertices: np.ndarray,
    uv: np.ndarray,
    selected: np.ndarray,
    pinned: np.ndarray,
    along: str = "AUTO",
) -> Straight:
    """Loops of selected edges, each straight: level where it runs along U, upright where along V.

    Parameters
    ----------
    polygons : Polygons
    vertices : (n, 3)
    uv : (n, 2), the map as it is
    selected : (h,) bool, the sides along selected edges
    pinned : (n, 2) bool, what stays where it is: lines go through it
    along : "U", "V", or "AUTO": each along that axis which it runs along more

    Raises `UVError` where a loop is closed, and `PinError` where pins of a line are apart.
    """
    loops = _edge_loops(polygons, vertices, selected)
    held, values = np.zeros(uv.shape, bool), uv.copy()
    lines: dict[int, list[np.ndarray]] = {0: [], 1: []}
    for edges in loops:
        its, uses = np.unique(edges, return_counts=True)
        if (uses == 2).all():
            raise UVError("a loop of edges that is closed cannot become straight: deselect one of them")
        if along == "AUTO":
            first, last = uv[its[uses == 1]][:2]
            reach = np.abs(last - first)
            across = int(reach[0] >= reach[1])
        else:
            across = int(along == "U")
        lines[across].append(its)
    for axis, found in lines.items():
        for its in _merged(found, len(uv)):
            fixed = np.unique(uv[its[pinned[its, axis]], axis])
            if len(fixed) > 1:
                raise PinError("pins lie beside the line that its edges are to become: unpin some of them")
            held[its, axis] = True
            values[its, axis] = fixed[0] if len(fixed) else uv[its, axis].mean()
    return Straight(held, values)


def _merged(lines, n):
    """Lines along the same axis that share a vertex, as one."""
    if not lines:
        return
    first = np.concatenate([np.full(len(its) - 1, its[0]) for its in lines])
    part = components(n, first, np.concatenate([its[1:] for its in lines]))[1]
    everything = np.unique(np.concatenate(lines))
    for k in np.unique(part[everything]):
        yield everything[part[everything] == k]


def _edge_loops(polygons, vertices, selected):
    """The selected edges, (k, 2) vertices, of every loop: at a vertex it goes on with the straightest edge that no face
    has in common with the one it came by."""
    start, end, face = (each[selected] for each in polygons)
    key, number = np.unique(np.sort(np.column_stack([start, end]), axis=1), axis=0, return_inverse=True)
    number = number.ravel()
    faces = [set() for _ in key]
    for edge, its in zip(number.tolist(), face.tolist(), strict=True):
        faces[edge].add(its)
    at: dict[int, list[int]] = {}
    for edge, ends in enumerate(key.tolist()):
        for vertex in ends:
            at.setdefault(vertex, []).append(edge)
    pairs = []
    for vertex, edges in at.items():
        if len(edges) > 1:
            pairs += _gone_on(vertex, edges, key, faces, vertices)
    one, other = np.array(pairs, dtype=int).reshape(-1, 2).T
    loop = components(len(key), one, other)[1]
    return [key[loop == k] for k in range(loop.max(initial=-1) + 1)]


def _gone_on(vertex, edges, key, faces, vertices):
    """Yield the pairs of edges at a vertex of which each goes on as the other."""
    others = key[edges].sum(axis=1) - vertex
    way = vertices[others] - vertices[vertex]
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), np.finfo(float).tiny)
    cosine = way @ way.T
    free = set(range(len(edges)))
    for place in np.argsort(cosine, axis=None).tolist():
        i, j = divmod(place, len(edges))
        if cosine[i, j] >= _GENTLE:
            return
        if i < j and {i, j} <= free and not faces[edges[i]] & faces[edges[j]]:
            free -= {i, j}
            yield edges[i], edges[j]


def rectangle(
    polygons: Polygons,
    vertices: np.ndarray,
    uv: np.ndarray,
    selected: np.ndarray,
    pinned: np.ndarray,
) -> Straight:
    """The selected faces as an upright rectangle with the proportions that they have in space.

    Parameters are those of `straight_lines`; `selected` (h,) bool has all sides of the selected faces.  Of a grid of
    quads all rows and columns are straight, of anything else the border alone.  The corners are the pinned vertices of
    the border, if these are four, else those where a single face is.

    Raises `BoundaryError` where the border is no single loop or has no corners, and `PinError` where pins are in the
    way.
    """
    start, end, face = (each[selected] for each in polygons)
    border = _border(start, end, len(uv))
    corners = _corners(border, start, pinned)
    loop = np.roll(border, -corners[0])
    corners = [(corner - corners[0]) % len(border) for corner in corners]
    grid = _grid(start, end, face, loop, corners)
    inner = loop if grid is None else grid.ravel()
    place = np.full((len(uv), 2), np.nan)
    if grid is None:
        place[loop] = _along_sides(vertices[loop], corners)
    else:
        place[grid] = _spaced(vertices[grid])
    held, values = np.zeros(uv.shape, bool), uv.copy()
    held[inner] = True
    values[inner] = _laid(place, uv, inner, loop, pinned)
    if (pinned[inner] & (values[inner] != uv[inner])).any():
        raise PinError("pinned vertices of it do not lie on the upright rectangle: unpin them, or move them there")
    return Straight(held, values)


def _border(start, end, n):
    """The vertices around some faces, given by their sides, in order, (k,)."""
    key = np.minimum(start, end) * np.int64(n) + np.maximum(start, end)
    _, number, uses = np.unique(key, return_inverse=True, return_counts=True)
    rim = uses[number.ravel()] == 1
    following = dict(zip(start[rim].tolist(), end[rim].tolist(), strict=True))
    if not following:
        raise BoundaryError("what is selected is closed: select quads up to a seam")
    loop = [int(start[rim][0])]
    while (then := following.get(loop[-1])) is not None and then != loop[0]:
        if len(loop) > len(following):
            break
        loop.append(then)
    if len(loop) != rim.sum():
        raise BoundaryError("a rectangle needs faces in one piece without holes: select such")
    return np.array(loop)


def _corners(border, start, pinned):
    """The places of the four corners in the border, ascending."""
    pins = np.flatnonzero(pinned[border].all(axis=1))
    if len(pins) == 4:
        return pins.tolist()
    around = np.bincount(start, minlength=border.max() + 1)[border]  # faces at each vertex
    single = np.flatnonzero(around == 1)
    if len(single) != 4:
        raise BoundaryError(f"it has {len(single)} corners, and a rectangle has four: pin the four that are meant")
    return single.tolist()


def _grid(start, end, face, loop, corners):
    """The vertices in rows, (r, c), from the first corner along the border, if the faces are a grid of quads, else
    None."""
    count = np.bincount(np.unique(face, return_inverse=True)[1].ravel())
    columns, rows = corners[1] + 1, corners[2] - corners[1] + 1
    if (count != 4).any() or corners[3] - corners[2] + 1 != columns or len(count) != (columns - 1) * (rows - 1):
        return None
    ahead = {(a, b): k for k, (a, b) in enumerate(zip(start.tolist(), end.tolist(), strict=True))}
    by_face = end.reshape(-1, 4)  # the sides of a face follow each other
    if len(ahead) != len(start):
        return None
    row = loop[:columns].tolist()
    found = [row]
    for _ in range(rows - 1):
        above = []
        for a, b in pairwise(row):
            k = ahead.get((a, b))
            if k is None:
                return None
            ends = by_face[k // 4]
            c, d = ends[(k % 4 + 1) % 4], ends[(k % 4 + 2) % 4]
            if above and above[-1] != d:
                return None
            above += [int(c)] if above else [int(d), int(c)]
        row = above
        found.append(row)
    grid = np.array(found)
    is_whole = len(np.unique(grid)) == grid.size and np.array_equal(grid[0], loop[:columns])
    return grid if is_whole and np.array_equal(grid[-1], loop[corners[2] : corners[3] + 1][::-1]) else None


def _spaced(points):
    """Where the points of a grid (r, c, 3) go so that its rows and columns are as wide as they are on the average."""
    widths, heights = (np.linalg.norm(np.diff(points, axis=axis), axis=2).mean(axis=1 - axis) for axis in (1, 0))
    x, y = (np.concatenate([[0.0], np.cumsum(_positive(each))]) for each in (widths, heights))
    return np.stack(np.meshgrid(x, y), axis=2)


def _positive(lengths):
    return np.maximum(lengths, 1e-3 * max(lengths.mean(), np.finfo(float).tiny))


def _along_sides(points, corners):
    """Where the points of a closed polygon (k, 3) go, whose sides between the corners become those of a rectangle."""
    length = _positive(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))
    sides = [length[first:last] for first, last in zip(corners, [*corners[1:], len(points)], strict=True)]
    width, height = (float(one.sum() + other.sum()) / 2 for one, other in (sides[::2], sides[1::2]))
    from_to = np.array([[0, 0], [width, 0], [width, height], [0, height], [0, 0]])
    places = []
    for side, first, last in zip(sides, from_to, from_to[1:], strict=False):
        part = np.concatenate([[0.0], np.cumsum(side)[:-1]]) / side.sum()
        places.append(first + part[:, None] * (last - first))
    return np.concatenate(places)


def _laid(place, uv, inner, loop, pinned):
    """The places of the `inner` vertices, (k, 2), turned by right angles, mirrored, scaled and moved to where these are
    in the map, with the same area within the `loop`; between pinned corners, if there are four."""
    place, old, rim = place[inner], uv[inner], place[loop]
    area, before = (_enclosed(each) for each in (rim, uv[loop]))
    if before < 0:
        place, rim = place * (-1, 1), rim * (-1, 1)
    size = np.sqrt(abs(before) / abs(area)) if before else 1.0
    middle, centre = (place.min(axis=0) + place.max(axis=0)) / 2, old.mean(axis=0)
    turned = [size * (place - middle) @ np.array(turn).T for turn in _TURNS]
    best = min(turned, key=lambda each: ((each - each.mean(axis=0) - (old - centre)) ** 2).sum())
    best = best - best.mean(axis=0) + centre
    corners = pinned[inner].all(axis=1)
    if corners.sum() >= 2:  # between pins
        low, high = best[corners].min(axis=0), best[corners].max(axis=0)
        wanted_low, wanted_high = old[corners].min(axis=0), old[corners].max(axis=0)
        if ((high > low) & (wanted_high > wanted_low)).all():
            best = wanted_low + (best - low) / (high - low) * (wanted_high - wanted_low)
            for axis in range(2):  # to the last bit
                for value in (wanted_low[axis], wanted_high[axis]):
                    near = np.abs(best[:, axis] - value) <= 1e-9 * (wanted_high - wanted_low)[axis]
                    best[near, axis] = value
    return _levelled(best)


_TURNS = ([[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]])


def _enclosed(points):
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2


def _levelled(points):
    """The points (k, 2) with coordinates that differ by rounding alone made the same."""
    result = points.copy()
    for axis in range(2):
        order = np.argsort(points[:, axis], kind="stable")
        along = points[order, axis]
        near = 1e-12 * max(np.abs(along).max(), np.ptp(along))
        group = np.concatenate([[0], np.cumsum(np.diff(along) > near)])
        first = np.flatnonzero(np.diff(group, prepend=-1))
        result[order, axis] = along[first][group]
    return result
