# SPDX-License-Identifier: GPL-3.0-or-later
"""The certificate: which triangles are flipped, and whether a map covers nothing twice, exactly.

It speaks of the 32-bit floats that Blender stores.  Whoever certifies what Blender draws passes Blender's triangles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .pieces import starts_of
from .triangles import by_parts, corners_of

if TYPE_CHECKING:
    from .chart import Chart, Surface

ROUNDING = 1e-15  # largest rounding error of a difference of two products, relative to these (Shewchuk 1997)
_CROWDED = 30  # pairs that lie side by side for each box, from which on strips pay
_MOST = 1_000_000  # strips of all groups, that rounding can tell apart
_PORTION = 100_000  # pairs of boxes that are looked at together, about: it bounds the memory


class Outlines(NamedTuple):
    """Closed polygons, one after another."""

    points: np.ndarray
    """(n, 2)"""
    first: np.ndarray
    """(k,), where each polygon begins."""

    @classmethod
    def of(cls, polygons: Polygons) -> Outlines:
        """These polygons, which may have that form already."""
        return polygons if isinstance(polygons, cls) else cls(np.concatenate(polygons), starts_of(polygons))

    @property
    def following(self) -> np.ndarray:
        """(n,), the number of the side that follows each; sides are numbered by the points where they start."""
        result = np.arange(1, len(self.points) + 1)
        result[np.append(self.first[1:], len(self.points)) - 1] = self.first
        return result

    def at_sides(self, values: np.ndarray) -> np.ndarray:
        """The polygons' values (k, ...) at their sides, (n, ...)."""
        return np.repeat(values, np.diff(self.first, append=len(self.points)), axis=0)


Polygons = Sequence[np.ndarray] | Outlines
"""Closed polygons, the points (n, 2) of each."""


def turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """1 where the way over the points a, b, c (n, 2) turns left, -1 where right, 0 where they lie on a line: exactly,
    (n,)."""
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    first, second = bx * cy, by * cx
    apart, error = first - second, ROUNDING * (np.abs(first) + np.abs(second))
    result = (apart > error).astype(np.int8)
    result -= apart < -error
    if not result.all():
        # Where the two products nearly cancel, rounding decides: then look closer.
        zero = np.flatnonzero(result == 0)
        first, second, apart, error = (each[zero] for each in (first, second, apart, error))
        result[zero] = np.sign(apart)
        close = zero[(np.abs(apart) <= error) & (first != 0) & (second != 0)]
        if len(close):
            result[close] = _exact_turn(a[close], b[close], c[close])
    return result


def _exact_turn(a, b, c):
    """As `turn`, which calls it for the few points where ordinary arithmetic does not suffice."""
    (bx, by), (cx, cy) = (b - a).T, (c - a).T
    first, second = bx * cy, by * cx
    # Rounding keeps the order of numbers: the exact products differ as the rounded ones do, or else as their errors.
    result = np.sign(np.where(first == second, _error(bx, cy) - _error(by, cx), first - second)).astype(np.int8)
    # Where two of the points are one, they lie on a line whatever was rounded.
    alike = (a == b).all(axis=1) | (b == c).all(axis=1) | (a == c).all(axis=1)
    rounded = ((b - a) + a != b) | ((b - a) - b != -a) | ((c - a) + a != c) | ((c - a) - c != -a)
    for k in np.flatnonzero(rounded.any(axis=1) & ~alike):
        result[k] = turn_of_whole_numbers(a[k].tolist(), b[k].tolist(), c[k].tolist())
    result[alike] = 0
    return result


def turn_of_whole_numbers(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> int:
    """As `turn`, of three points given as pairs of floats, for differences that floats do not tell exactly.

    All are whole numbers of the smallest unit among them, a power of two.
    """
    ratios = [value.as_integer_ratio() for value in (*a, *b, *c)]
    unit = max(denominator for _, denominator in ratios)
    ax, ay, bx, by, cx, cy = (numerator * (unit // denominator) for numerator, denominator in ratios)
    det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (det > 0) - (det < 0)


def _error(x, y):
    """What the product x * y loses by rounding, exactly (Dekker 1971)."""
    (x1, x2), (y1, y2) = (_halves(x), _halves(y))
    return x1 * y1 - x * y + x1 * y2 + x2 * y1 + x2 * y2


def _halves(x):
    """Two numbers with half the digits each, whose sum is x."""
    scaled = 134217729 * x  # 2^27 + 1
    upper = scaled - (scaled - x)
    return upper, x - upper


def as_stored(uv: np.ndarray) -> np.ndarray:
    """`uv` rounded to the 32-bit floats that Blender keeps."""
    with np.errstate(over="ignore"):
        return np.asarray(uv).astype(np.float32).astype(np.float64)


def orientation(uv: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """1 for triangles that follow their winding, -1 for flipped, 0 for collapsed ones, (m,), in 32-bit floats."""
    stored = np.asfortranarray(as_stored(uv))
    return by_parts(lambda part: turn(*corners_of(stored, part.T).swapaxes(0, 1)), triangles.T)


def is_injective(uv: np.ndarray, triangles: np.ndarray, loops: Sequence[np.ndarray]) -> bool:
    """Whether no two points of the surface share a place in 32-bit floats: a certificate, not an estimate.

    If every triangle follows its winding, a place is covered as often as the boundary `loops` wind around it; and that
    is once or never, where the loops are simple, meet nowhere, and the holes' lie within the outer one.
    """
    return bool(are_injective(uv, triangles, np.zeros(len(triangles), int), loops, np.zeros(len(loops), int))[0])


def are_injective(
    uv: np.ndarray, triangles: np.ndarray, piece: np.ndarray, loops: Sequence[np.ndarray], loop_piece: np.ndarray
) -> np.ndarray:
    """The same for each of several pieces, (p,) bool; `piece` (m,) and `loop_piece` (l,) say whose a triangle or loop
    is.  No piece is compared with another."""
    wrong = np.zeros(loop_piece.max() + 1, bool)
    wrong[piece[orientation(uv, triangles) <= 0]] = True
    if wrong.all():
        return ~wrong
    polygons = Outlines(as_stored(uv)[np.concatenate(loops)], starts_of(loops))
    # Triangles of positive area leave the outer loop counter-clockwise and the others clockwise, if all are simple.
    wrong |= np.bincount(loop_piece, enclosed_areas(polygons) > 0) != 1
    return ~are_crossed(polygons, loop_piece, wrong)


def certified_pieces(surface: Surface, uv: np.ndarray) -> np.ndarray:
    """Whether the map `uv` (n, 2) is certified as injective, for every piece of a surface, (p,) bool.

    Triangles without area on the surface are left out where they have none in the map either.
    """
    counts = surface.measure > 0
    if counts.all():
        triangles, piece = surface.triangles, surface.piece
    else:
        sign = orientation(uv, surface.triangles)
        solid = counts | (sign != 0)
        triangles, piece = surface.triangles[solid], surface.piece[solid]
    return are_injective(uv, triangles, piece, surface.loops, surface.loop_piece)


def enclosed_area(points: np.ndarray) -> float:
    """Signed area within the closed polygon (n, 2), positive counter-clockwise."""
    return enclosed_areas([points])[0]


def enclosed_areas(polygons: Polygons) -> np.ndarray:
    """The same of every polygon, (k,)."""
    outlines = Outlines.of(polygons)
    points, first = outlines
    local = points - outlines.at_sides(points[first])
    (x, y), (next_x, next_y) = local.T, local[outlines.following].T
    return 0.5 * np.add.reduceat(x * next_y - y * next_x, first)


def count_crossings(polygons: Polygons, touching: bool = False) -> int:
    """How many pairs of sides of the closed polygons, each (n, 2), properly cross, or also touch, exactly."""
    return int(crossings(polygons, np.zeros(len(polygons), int), touching)[0])


def crossings(polygons: Polygons, group: np.ndarray, touching: bool = False) -> np.ndarray:
    """The same for every group of polygons, (g,); `group` (k,) is the number of each polygon's group."""
    outlines, found = Outlines.of(polygons), np.zeros(group.max() + 1, int)
    of = outlines.at_sides(group)
    for sides in crossing_sides(outlines, group, touching):
        found += np.bincount(of[sides[0]], minlength=len(found))
    return found


def are_crossed(polygons: Polygons, group: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """In which groups of polygons sides cross or touch, exactly, (g,) bool; `known` (g,) bool are some that count as
    such anyway."""
    found = np.zeros(group.max() + 1, bool) if known is None else known.copy()
    outlines = Outlines.of(polygons)
    of = outlines.at_sides(group)
    for sides in crossing_sides(outlines, group, touching=True):
        found[of[sides[0]]] = True
        if found.all():  # thousands of sides may lie one over the other
            break
    return found


def crossing_sides(
    polygons: Polygons, group: np.ndarray, touching: bool = False
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pairs of sides, of polygons of one group, that properly cross, or also touch, exactly, as two arrays of
    numbers (k,), some at a time.  Sides are numbered polygon after polygon."""
    outlines = Outlines.of(polygons)
    start, following, group = outlines.points, outlines.following, outlines.at_sides(group)
    end = start[following]
    if touching:  # sides that run back over the one before
        back = end - start, end[following] - end
        on_a_line = turn(start, end, end[following]) == 0
        side = np.flatnonzero(on_a_line & ((back[0] * back[1]).sum(axis=1) <= 0))
        yield side, following[side]
    for one, other in near_boxes(np.minimum(start, end), np.maximum(start, end), group):
        # Most are neighbours, which touch in the vertex between them and cross nowhere.
        apart = (following[one] != other) & (following[other] != one)
        one, other = one[apart], other[apart]
        a, b, c, d = start[one], end[one], start[other], end[other]
        across = turn(a, b, c) * turn(a, b, d)
        meet = across <= 0 if touching else across < 0
        if not meet.any():
            continue
        one, other, (a, b, c, d) = one[meet], other[meet], (each[meet] for each in (a, b, c, d))
        back = turn(c, d, a) * turn(c, d, b)
        meet = back <= 0 if touching else back < 0
        yield one[meet], other[meet]


def near_boxes(low: np.ndarray, high: np.ndarray, group: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pairs of boxes that meet or touch and are of one group, as two arrays of numbers (k,), some at a time.

    Boxes reach from `low` to `high`, (n, 2) each, and belong to the groups `group` (n,).  Where too many lie side by
    side, the plane is cut into strips, and each strip has its part of a box.
    """
    axis = int(np.argmax(np.ptp(low, axis=0)))
    (left, lower), (right, upper) = ((each[:, axis], each[:, 1 - axis]) for each in (low, high))
    order, count = _swept(left, right, group)
    cut = None
    if count.sum() > _CROWDED * len(left):
        box, strip, _ = cut = _strips(lower, upper, _MOST // (group.max() + 1))
        group = group[box] * (strip.max() + 1) + strip
        order, count = _swept(left[box], right[box], group)
    for part in np.array_split(np.arange(len(order)), 1 + count.sum() // _PORTION):
        total = np.cumsum(count[part])
        one = np.repeat(part, count[part])
        other = one + 1 + np.arange(len(one)) - np.repeat(total - count[part], count[part])
        one, other = order[one], order[other]
        own = np.ones(len(one), bool)
        if cut is not None:
            box, strip, first = cut
            its, one, other = strip[one], box[one], box[other]
            own = its == np.maximum(first[one], first[other])  # of all strips that two share, the first
        near = own & (left[other] <= right[one]) & (lower[one] <= upper[other]) & (lower[other] <= upper[one])
        yield one[near], other[near]


def _swept(low, high, group):
    """The intervals from `low` to `high`, (n,) each, in the order in which they begin, group by group; and how many
    after each begin before it ends, (n,).  To sort all groups at once, each is moved so far that none reaches the next.
    """
    apart = 2 * (high.max() - low.min() + 1e-30)
    begin, end = low + apart * group, high + apart * (group + 1e-9)  # more than rounding takes
    order = np.argsort(begin, kind="stable")
    return order, np.searchsorted(begin[order], end[order], side="right") - np.arange(len(order)) - 1


def _strips(low, high, most):
    """Parts of intervals from `low` to `high`, (n,) each, in strips twice as wide as these, at `most` about so many:
    the number of the interval and that of the strip for every part, and the first strip of every interval."""
    width = max(2 * float((high - low).mean()), float(np.ptp(low)) / max(most, 1), np.finfo(float).tiny)
    first, last = (np.floor((each - low.min()) / width).astype(np.int64) for each in (low, high))
    count = last - first + 1
    whose = np.repeat(np.arange(len(low)), count)
    return whose, first[whose] + np.arange(len(whose)) - np.repeat(np.cumsum(count) - count, count), first


def wrong_triangles(chart: Chart, uv: np.ndarray) -> np.ndarray:
    """The triangles of a chart that are not positive though they could be, (m,) bool, in 32-bit floats."""
    return (orientation(uv, chart.triangles) <= 0) & (chart.measure > 0)


def wrong_pieces(charts: Sequence[Chart], uv: np.ndarray) -> np.ndarray:
    """The pieces of which a triangle, in any of the charts, is not positive though it could be, (p,) bool."""
    wrong = np.zeros(charts[0].piece_count, bool)
    for chart in charts:
        wrong[chart.piece[wrong_triangles(chart, uv)]] = True
    return wrong
