# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines that touch themselves where the surface is cut open, as the two sides of a closed slit do, and nowhere else.

Such an island covers no place twice though its outline is not simple: `certificate.are_injective` is stricter.
"""

from collections.abc import Sequence
from fractions import Fraction
from functools import cmp_to_key
from itertools import pairwise

import numpy as np

from .certificate import as_stored, near_boxes, turn
from .loops import followers
from .pieces import components


def touches_along_seams_only(uv: np.ndarray, loops: Sequence[np.ndarray], place: np.ndarray) -> bool:
    """Whether no two inner points of an island share a place in the map: exactly, in 32-bit floats.

    uv     (n, 2), in which every triangle that has some area follows its winding
    loops  its boundary loops, as vertices
    place  (n,) integers, the same where vertices are at the same place in space, as on the two sides of a seam

    The outline may touch itself in vertices that have the same place in space, and along whole sides between these.
    """
    # Where two sides lie on each other and run opposite ways, the outline winds as often around any place as without
    # them.  If what is left crosses itself nowhere, and in and out alternate around every point, then each of its parts
    # winds around a place either once or never, and where only one of them winds counter-clockwise, so do all together:
    # never less than 0, since no triangle is flipped.
    start = np.concatenate(loops)
    end = followers(loops)
    points, spot = np.unique(as_stored(uv[start]) + 0.0, axis=0, return_inverse=True)  # -0.0 is 0.0
    spot_of = np.empty(len(uv), dtype=np.intp)
    spot_of[start] = spot.ravel()
    place_there = np.empty(len(points), dtype=place.dtype)
    place_there[spot_of[start]] = place[start]
    if (place_there[spot_of[start]] != place[start]).any():
        return False
    start, end = _left_over(spot_of[start], spot_of[end])
    if not len(start) or (start == end).any() or _meet_between(points, start, end):
        return False
    shared = np.flatnonzero(np.bincount(start, minlength=len(points)) > 1)
    return all(_alternate(points, start, end, spot) for spot in shared) and _wind_once(points, start, end)


def _left_over(start, end):
    """The sides from `start` to `end`, (k,) each, without the pairs that run from one point to another and back."""
    ends, side = np.unique(np.sort(np.column_stack([start, end]), axis=1), axis=0, return_inverse=True)
    ways = np.bincount(side.ravel(), np.where(start < end, 1, -1)).astype(int)
    times = np.repeat(np.arange(len(ends)), np.abs(ways))
    return tuple(np.where(ways[times] > 0, ends[times].T, ends[times, ::-1].T))


def _meet_between(points, start, end):
    """Whether any two sides meet elsewhere than at a point where both end."""
    a, b = points[start], points[end]
    for one, other in near_boxes(np.minimum(a, b), np.maximum(a, b), np.zeros(len(start), dtype=int)):
        across = turn(a[one], b[one], a[other]) * turn(a[one], b[one], b[other])
        back = turn(a[other], b[other], a[one]) * turn(a[other], b[other], b[one])
        meet = (across <= 0) & (back <= 0)
        for its, far in ((start, b), (end, a)):
            for others, other_far in ((start, b), (end, a)):
                common = its[one] == others[other]
                apart = ~_same_way(points[its[one]], far[one], other_far[other])
                meet &= ~(common & apart)
        if meet.any():
            return True
    return False


def _same_way(origin, one, other):
    """Whether two points lie in the same direction from an origin, (k, 2) each, (k,) bool."""
    along = ((one - origin) * (other - origin)).sum(axis=1) > 0
    return along & (turn(origin, one, other) == 0)


def _alternate(points, start, end, spot):
    """Whether the sides around a point alternate between such as go out from there and such as come in."""
    ways = [(point, True) for point in end[start == spot]] + [(point, False) for point in start[end == spot]]
    x, y = (Fraction(value) for value in points[spot].tolist())

    def direction(way):
        to_x, to_y = (Fraction(value) for value in points[way[0]].tolist())
        return to_x - x, to_y - y

    def upper(way):
        return way[1] > 0 or (way[1] == 0 and way[0] > 0)

    def compare(one, other):
        first, second = direction(one), direction(other)
        if upper(first) != upper(second):
            return -1 if upper(first) else 1
        return (first[1] * second[0] > first[0] * second[1]) - (first[1] * second[0] < first[0] * second[1])

    around = sorted(ways, key=cmp_to_key(compare))
    return all(one[1] != other[1] for one, other in pairwise([*around, around[0]]))


def _wind_once(points, start, end):
    """Whether exactly one of the outline's parts, which hang together at points, runs counter-clockwise."""
    part = components(len(points), start, end)[1][start]
    (ax, ay), (bx, by) = (points[start] - points[start[0]]).T, (points[end] - points[start[0]]).T
    area = np.bincount(part, ax * by - ay * bx)
    return np.count_nonzero(area > 0) == 1
