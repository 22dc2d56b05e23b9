# SPDX-License-Identifier: GPL-3.0-or-later
"""The certificate: which triangles are flipped, and whether a map covers nothing twice, exactly.

It speaks of the 32-bit floats that Blender stores.  Whoever certifies what Blender draws passes Blender's triangles.
"""

from fractions import Fraction

import numpy as np

from .triangles import by_parts, corners_of

_PORTION = 1_000_000  # pairs at a time


def turn(a, b, c):
    """1 where the points a, b, c (n, 2) turn left, -1 where they turn right, 0 where they lie on a line: exactly."""
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    first, second = bx * cy, by * cx
    apart = first - second
    result = np.sign(apart).astype(np.int8)
    # Where the two nearly cancel, rounding decides (Shewchuk 1997 bounds the error): then look closer.
    close = np.abs(apart) <= 1e-15 * (np.abs(first) + np.abs(second))
    close = np.flatnonzero(close & (first != 0) & (second != 0))
    if len(close):
        result[close] = _exact_turn(a[close], b[close], c[close])
    return result


def _exact_turn(a, b, c):
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    first, second = bx * cy, by * cx
    # Rounding keeps the order of numbers: the exact products differ as the rounded ones do, or else as their errors.
    result = np.sign(np.where(first == second, _error(bx, cy) - _error(by, cx), first - second)).astype(np.int8)
    rounded = ((b - a) + a != b) | ((b - a) - b != -a) | ((c - a) + a != c) | ((c - a) - c != -a)
    for k in np.flatnonzero(rounded.any(axis=1)):  # the differences already are no longer exact: count in fractions
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(value) for value in point[k].tolist()] for point in (a, b, c))
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        result[k] = (det > 0) - (det < 0)
    return result


def _error(x, y):
    # What the product x * y loses by rounding, exactly (Dekker 1971).
    (x1, x2), (y1, y2) = (_halves(x), _halves(y))
    return x1 * y1 - x * y + x1 * y2 + x2 * y1 + x2 * y2


def _halves(x):
    # The upper and the lower half of the digits.
    scaled = 134217729 * x  # 2^27 + 1
    upper = scaled - (scaled - x)
    return upper, x - upper


def as_stored(uv):
    """`uv` rounded to the 32-bit floats that Blender keeps."""
    with np.errstate(over="ignore"):
        return np.asarray(uv).astype(np.float32).astype(np.float64)


def orientation(uv, triangles):
    """1 for triangles that follow their winding, -1 for flipped, 0 for collapsed ones, (m,), in 32-bit floats."""
    stored = np.asfortranarray(as_stored(uv))
    return by_parts(lambda corner: turn(*corners_of(stored, corner.T).swapaxes(0, 1)), triangles.T)


def is_injective(uv, triangles, loops):
    """Whether no two points of the surface share a place in 32-bit floats: a certificate, not an estimate.

    If every triangle follows its winding, a place is covered as often as the boundary `loops` wind around it; and that
    is once or never, where the loops are simple, meet nowhere, and the holes' lie within the outer one.
    """
    return bool(are_injective(uv, triangles, np.zeros(len(triangles), int), loops, np.zeros(len(loops), int))[0])


def are_injective(uv, triangles, piece, loops, loop_piece):
    """The same for several pieces, (p,) bool; `piece` (m,) and `loop_piece` (l,) say whose a triangle or loop is."""
    wrong = np.zeros(loop_piece.max() + 1, bool)
    wrong[piece[orientation(uv, triangles) <= 0]] = True
    if wrong.all():
        return ~wrong
    stored = as_stored(uv)
    polygons = [stored[loop] for loop in loops]
    # Triangles of positive area leave the outer loop counter-clockwise and the others clockwise, if all are simple.
    wrong |= np.bincount(loop_piece, enclosed_areas(polygons) > 0) != 1
    return ~wrong & (crossings(polygons, loop_piece, touching=True) == 0)


def certified_pieces(surface, uv):
    """Whether the map `uv` (n, 2) of every piece of a surface is certified, (p,) bool.

    Triangles without area on the surface count only if they are flipped.
    """
    counts = surface.measure > 0
    if counts.all():
        triangles, piece = surface.triangles, surface.piece
    else:
        sign = orientation(uv, surface.triangles)
        solid = counts | (sign != 0)
        triangles, piece = surface.triangles[solid], surface.piece[solid]
    return are_injective(uv, triangles, piece, surface.loops, surface.loop_piece)


def enclosed_area(points):
    """Signed area within the closed polygon (n, 2), positive counter-clockwise."""
    return enclosed_areas([points])[0]


def enclosed_areas(polygons):
    """The same of every polygon, (k,)."""
    start, following, first = _sides(polygons)
    origin = np.repeat(start[first], np.diff(first, append=len(start)), axis=0)
    (x, y), (next_x, next_y) = (start - origin).T, (start[following] - origin).T
    return 0.5 * np.add.reduceat(x * next_y - y * next_x, first)


def _sides(polygons):
    """Where the closed polygons' sides start (n, 2), the numbers of those that follow, and of each polygon's first."""
    size = np.array([len(points) for points in polygons])
    first = np.cumsum(size) - size
    following = np.arange(1, size.sum() + 1)
    following[first + size - 1] = first
    return np.concatenate(polygons), following, first


def count_crossings(polygons, touching=False):
    """How many pairs of sides of the closed polygons, each (n, 2), properly cross, or also touch, exactly."""
    return int(crossings(polygons, np.zeros(len(polygons), int), touching)[0])


def crossings(polygons, group, touching=False):
    """The same within every group of polygons; `group` (k,) numbers that of each polygon."""
    start, following, first = _sides(polygons)
    end = start[following]
    group = np.repeat(group, np.diff(first, append=len(start)))

    found = np.zeros(group.max() + 1, int)
    for one, other in near_boxes(np.minimum(start, end), np.maximum(start, end), group):
        a, b, c, d = start[one], end[one], start[other], end[other]
        across, back = turn(a, b, c) * turn(a, b, d), turn(c, d, a) * turn(c, d, b)
        if touching:
            neighbours = (following[one] == other) | (following[other] == one)
            crossing = (across <= 0) & (back <= 0) & ~neighbours
        else:
            crossing = (across < 0) & (back < 0)
        found += np.bincount(group[one[crossing]], minlength=len(found))
    if touching:  # and sides that turn back on the one before
        back = end - start, end[following] - end
        on_a_line = turn(start, end, end[following]) == 0
        found += np.bincount(group[on_a_line & ((back[0] * back[1]).sum(axis=1) <= 0)], minlength=len(found))
    return found


def near_boxes(low, high, group):
    """The pairs (k,), (k,) of boxes `low` to `high` (n, 2), both of one group, that meet or touch; some at a time."""
    axis = int(np.argmax(np.ptp(low, axis=0)))
    # Laid end to end, the groups lie apart by more than rounding can close.
    apart = 2 * (np.ptp(np.vstack([low, high])[:, axis]) + 1e-30)
    begin, close = low[:, axis] + apart * group, high[:, axis] + apart * (group + 1e-9)
    order = np.argsort(begin, kind="stable")
    # Sorted by where they begin, each is near its followers as long as those begin before it ends.
    count = np.searchsorted(begin[order], close[order], side="right") - np.arange(len(order)) - 1
    for part in np.array_split(np.arange(len(order)), 1 + count.sum() // _PORTION):
        total = np.cumsum(count[part])
        one = np.repeat(part, count[part])
        other = one + 1 + np.arange(len(one)) - np.repeat(total - count[part], count[part])
        one, other = order[one], order[other]
        near = (low[one] <= high[other]).all(axis=1) & (low[other] <= high[one]).all(axis=1)
        yield one[near], other[near]


def wrong_triangles(chart, uv):
    """The triangles of a chart that are not positive though they could be, (m,) bool, in 32-bit floats."""
    return (orientation(uv, chart.triangles) <= 0) & (chart.measure > 0)


def wrong_pieces(charts, uv):
    """The pieces of which a triangle, in any of the charts, is not positive though it could be, (p,) bool."""
    wrong = np.zeros(charts[0].piece_count, bool)
    for chart in charts:
        wrong[chart.piece[wrong_triangles(chart, uv)]] = True
    return wrong
