# SPDX-License-Identifier: GPL-3.0-or-later
"""Constrained Delaunay triangulation in double precision, by Qhull and exact predicates.

Qhull triangulates the points, and then sides that are missing are put in one after the other.  What comes back has been
checked without rounding: it is the whole convex hull, covered once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay, QhullError

from .certificate import ROUNDING, turn, turn_of_whole_numbers
from .pieces import among

_JOGGLE = 1e-11  # how far Qhull's points are moved, relative to their extent: many on one circle would take it longer
_CIRCLE_ROUNDING = 1.2e-15  # largest rounding error of `_in_circle`, relative to its terms


def triangulate(points: ArrayLike, sides: ArrayLike) -> np.ndarray | None:
    """The constrained Delaunay triangulation of the points (p, 2), which contains all `sides` (s, 2), pairs of points.

    Returns triangles (t, 3) that fill the convex hull of exactly these points, all counter-clockwise in exact
    arithmetic.  Returns None where there are none such: points coincide or all lie on a line, sides cross, or a point
    lies on a side.  How near the triangles are to Delaunay's is up to rounding.
    """
    scaled, sides = _scaled(np.asarray(points, dtype=float)), np.asarray(sides, dtype=np.int64).reshape(-1, 2)
    if scaled is None:
        return None
    triangles, edges = _triangulated(scaled)
    if triangles is None:
        return None
    missing = ~edges.contain(sides)
    if not missing.any():
        return triangles
    mesh = _Mesh(scaled, triangles, edges)
    mesh.fix(sides[~missing])
    if not all(mesh.put_in(a, b) for a, b in sides[missing].tolist()):
        return None
    mesh.make_delaunay()
    triangles = mesh.triangles()
    edges = _Edges(triangles, len(scaled))
    return triangles if edges.fill_the_hull(scaled) and edges.contain(sides).all() else None


def _triangulated(points):
    """Triangles (t, 3) that fill the convex hull of the points, and their edges; None and None if there are none."""
    for method in (_by_qhull, _one_by_one):
        triangles = method(points)
        if triangles is not None:
            edges = _Edges(triangles, len(points))
            if edges.fill_the_hull(points):
                return triangles, edges
    return None, None


def _scaled(points):
    """The points divided by a power of two, which rounds nothing, so that no coordinate exceeds 1; None if they are too
    few, not finite or all zero."""
    largest = np.abs(points).max(initial=0)
    if len(points) < 3 or not 0 < largest < np.inf:
        return None
    return np.ldexp(points, -np.frexp(largest)[1])


def _by_qhull(points):
    """Qhull's triangles (t, 3) of points that are moved a little, or None if it leaves out points.

    They may be flat or turned over where points lie all but on a line or all but in one place.
    """
    x, y = points.T
    low, high = np.array([[x.min(), y.min()], [x.max(), y.max()]])
    noise = np.sin(1e6 * np.arange(points.size)).reshape(-1, 2)  # random enough
    try:
        delaunay = Delaunay(points - (low + high) / 2 + _JOGGLE * (high - low).max() * noise)
    except QhullError:
        return None
    return None if len(delaunay.coplanar) else delaunay.simplices.astype(np.int64)


def _one_by_one(points):
    """Triangles (t, 3) by putting in one point after the other, or None if points coincide or all lie on a line.

    It is meant for points that lie too near to each other, or to a line, for Qhull.
    """
    n = len(points)
    if len(np.unique(points @ [1, 1j])) < n:
        return None
    order = _by_rounds(points)
    a, b = order[:2]
    side = turn(*(np.broadcast_to(points[k], points.shape) for k in (a, b)), points)
    if not side.any():
        return None
    c = order[np.argmax(side[order] != 0)]
    first = np.array([[a, b, c] if side[c] > 0 else [b, a, c]])
    mesh = _Mesh(points, first, _Edges(first, n))
    mesh.reserve(2 * n)
    if not all(mesh.insert(k) for k in order.tolist() if k not in (a, b, c)):
        return None
    return mesh.triangles()


def _by_rounds(points):
    """An order of the points (n, 2) in which putting them in takes few steps and few flips, (n,).

    Random points make rounds, each twice as large as the last one: so few flips are expected.  Within a round the order
    goes by neighbourhood: so the next point is near (Amenta, Choi and Rote 2003).
    """
    n = len(points)
    rounds = np.frexp(1 + np.random.default_rng(0).permutation(n))[1]
    rank = np.empty(n, dtype=np.int64)
    rank[np.argsort(points[:, 0])] = np.arange(n)
    strip = (rank / n * 2 ** (rounds / 2)).astype(np.int64)
    return np.lexsort((np.where(strip % 2, -1, 1) * points[:, 1], strip, rounds))  # up one strip, down the next


class _Edges:
    """The half-edges of triangles (t, 3) of n points: the k-th of a triangle leads from its k-th corner to the next.

    `twin` (3 t,) is the same edge in the triangle beyond, or -1; `wrong` tells whether three triangles share an edge
    or two do that are wound against each other.
    """

    def __init__(self, triangles: np.ndarray, n: int):
        self.triangles = triangles
        self.n = n
        self.start, self.end = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
        edge = self._numbers(self.start, self.end)
        order = np.argsort(edge)
        self._sorted = edge[order]
        same = self._sorted[1:] == self._sorted[:-1]
        one, other = order[:-1][same], order[1:][same]
        self.twin = np.full(len(edge), -1)
        self.twin[one], self.twin[other] = other, one
        self.wrong = (same[1:] & same[:-1]).any() or (self.start[one] != self.end[other]).any()

    def _numbers(self, start, end):
        return np.minimum(start, end) * self.n + np.maximum(start, end)

    def contain(self, sides: np.ndarray) -> np.ndarray:
        """Which of the sides (s, 2) are edges, (s,) bool."""
        return among(self._numbers(*sides.T), self._sorted)

    def fill_the_hull(self, points: np.ndarray) -> bool:
        """Whether the triangles are positive, and cover the convex hull of all points once: exactly.

        Positive triangles cover a place as often as their boundary winds around it.  That is once, if the boundary
        turns left all the way, and once in all.
        """
        rim = np.flatnonzero(self.twin < 0)
        if self.wrong or len(self.triangles) != 2 * self.n - 2 - len(rim):
            return False
        following = np.full(self.n, -1)
        following[self.start[rim]] = self.end[rim]
        if np.count_nonzero(following >= 0) < len(rim):  # it touches itself
            return False
        corners = np.array([self.start[rim], self.end[rim], following[self.end[rim]]])
        turns = turn(*points[np.hstack([corners, self.triangles.T])])
        if (turns[: len(rim)] < 0).any() or (turns[len(rim) :] <= 0).any():
            return False
        x, y = points.T
        (x, next_x), (y, next_y) = np.diff(x[corners], axis=0), np.diff(y[corners], axis=0)
        angle = np.arctan2(np.abs(x * next_y - y * next_x), x * next_x + y * next_y)
        return bool(angle.sum() < 3 * np.pi)


class _Mesh:
    """Triangles that change one at a time, as Python lists, which are faster than arrays then.

    Half-edges are numbered as in `_Edges`; beyond the hull's edges lie triangles to a point at infinity, number n.  The
    lists have an entry for every half-edge: `origin`, the point where it starts; `twin`; `fixed`, whether it must stay;
    `after` and `before`, the next and the previous one in its triangle.  `leaving` has one that starts at each point.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, edges: _Edges):
        n, count = len(points), 3 * len(triangles)
        rim = np.flatnonzero(edges.twin < 0)
        beyond = count + 3 * np.arange(len(rim))
        outer = np.column_stack([edges.end[rim], edges.start[rim], np.full(len(rim), n)])
        origin = np.concatenate([edges.start, outer.ravel()])
        twin = np.concatenate([edges.twin, np.empty(3 * len(rim), dtype=np.int64)])
        twin[rim], twin[beyond] = beyond, rim
        before = np.empty(n, dtype=np.int64)  # what comes from infinity to each point
        before[edges.end[rim]] = beyond + 2
        twin[beyond + 1] = before[edges.start[rim]]
        twin[twin[beyond + 1]] = beyond + 1
        leaving = np.empty(n + 1, dtype=np.int64)
        leaving[origin] = np.arange(len(origin))

        self.n = n
        self.x, self.y = points.T.tolist()
        self.origin, self.twin, self.leaving = origin.tolist(), twin.tolist(), leaving.tolist()
        self.fixed = [False] * len(origin)
        self.after: list[int] = []
        self.before: list[int] = []
        self.reserve(len(origin) // 3)

    def reserve(self, count: int) -> None:
        """Make `after` and `before` long enough for so many triangles."""
        half_edge = np.arange(3 * count).reshape(-1, 3)
        self.after, self.before = half_edge[:, [1, 2, 0]].ravel().tolist(), half_edge[:, [2, 0, 1]].ravel().tolist()

    def triangles(self) -> np.ndarray:
        """The triangles (t, 3) without those to infinity."""
        triangles = np.array(self.origin, dtype=np.int64).reshape(-1, 3)
        return triangles[(triangles < self.n).all(axis=1)]

    def fix(self, sides: np.ndarray) -> None:
        """Keep from now on the edges between the points `sides` (s, 2), all of which there are."""
        start = np.array(self.origin, dtype=np.int64)
        end = start[self.after]
        number = np.where((start < self.n) & (end < self.n), start * self.n + end, -1)
        self.fixed = np.isin(number, np.concatenate([sides @ [self.n, 1], sides @ [1, self.n]])).tolist()

    def turn(self, a: int, b: int, c: int) -> float:
        """Positive where the way over the points a, b, c turns left, negative where right, 0 on a line: exactly."""
        x, y = self.x, self.y
        ax, ay = x[a], y[a]
        first = (x[b] - ax) * (y[c] - ay)
        second = (y[b] - ay) * (x[c] - ax)
        apart = first - second
        # Differences of numbers are 0 only if these are equal; so there rounding decides nothing.
        if abs(apart) > ROUNDING * (abs(first) + abs(second)) or first == 0 or second == 0:
            return apart
        return turn_of_whole_numbers((ax, ay), (x[b], y[b]), (x[c], y[c]))

    def put_in(self, a: int, b: int) -> bool:
        """Make the side from a to b an edge; False if a point or another side is in the way.

        The triangles that it crosses are taken out, and the two polygons that are left filled anew.
        """
        crossed = self._crossed(a, b)
        if not crossed:
            return crossed is not None
        right, left = self._banks(crossed)
        sides = right + left
        corners = [self.origin[h] for h in sides]
        beyond, fixed = [self.twin[h] for h in sides], [self.fixed[h] for h in sides]
        free = [3 * (h // 3) for h in (*crossed, self.twin[crossed[-1]])]
        now = [None] * len(sides)
        one = self._filled([*corners[: len(right)], b], 0, free, now)
        other = self._filled([*corners[len(right) :], a], len(right), free, now)
        if one is None or other is None:
            return False
        renamed = dict(zip(sides, now, strict=True))  # a side may have its polygon on both sides
        for h, g, keep in zip(now, beyond, fixed, strict=True):
            self._join(h, renamed.get(g, g), keep)
        self._join(one, other, True)
        return True

    def _join(self, one, other, fixed):
        """Make two half-edges the two sides of one edge."""
        self.twin[one], self.twin[other] = other, one
        self.fixed[one] = self.fixed[other] = fixed

    def _crossed(self, a, b):
        """The half-edges that the side from a to b crosses from right to left; None where a point or side is met."""
        origin, twin, after, before, n = self.origin, self.twin, self.after, self.before, self.n
        first = out = self.leaving[a]
        while True:
            h = after[out]
            p, q = origin[h], origin[before[out]]
            if p == b or q == b:
                edge = out if p == b else before[out]
                self.fixed[edge] = self.fixed[twin[edge]] = True
                return []
            if p != n and q != n and self.turn(a, b, q) >= 0 >= self.turn(a, b, p):
                break
            out = twin[before[out]]
            if out == first:
                return None
        crossed = []
        while True:
            p, q = origin[h], origin[twin[h]]
            if 0 in (self.turn(a, b, p), self.turn(a, b, q)) or self.fixed[h]:
                return None
            crossed.append(h)
            g = twin[h]
            c = origin[before[g]]
            if c == b:
                return crossed
            if c == n:
                return None
            h = after[g] if self.turn(a, b, c) > 0 else before[g]

    def _banks(self, crossed):
        """The half-edges around the triangles of the `crossed` ones: a list of those on the right, one for the left."""
        twin, after, before = self.twin, self.after, self.before
        inner = {*crossed, *(twin[h] for h in crossed)}
        right, left = [before[crossed[0]]], [after[crossed[0]]]
        for h in crossed:
            g = twin[h]
            if after[g] not in inner:
                right.append(after[g])
            if before[g] not in inner:
                left.append(before[g])
        return right, left[::-1]

    def _filled(self, corners, number, free, now):
        """Fill a polygon with triangles; returns the half-edge that its last side becomes, or None if that fails.

        The polygon is given by its points `corners`, counter-clockwise, and every place in it sees its last side: then
        it suffices to cut off corners that turn left (Toussaint and Avis 1982).  The triangles' half-edges get the
        numbers from `free`.  The other sides count from `number`: `now` is told which half-edges they become.
        """
        origin, leaving = self.origin, self.leaving
        kept, sides = [corners[0]], []  # the sides between the kept corners: half-edges, or ~ the number of one given
        for side, v in enumerate(corners[1:], number):
            side = ~side
            while sides and self.turn(kept[-2], kept[-1], v) > 0:
                w = kept.pop()
                u = kept[-1]
                t = free.pop()
                origin[t], origin[t + 1], origin[t + 2] = u, w, v
                leaving[u], leaving[w], leaving[v] = t, t + 1, t + 2
                for h, each in ((t, sides.pop()), (t + 1, side)):
                    if each < 0:
                        now[~each] = h
                    else:
                        self._join(h, each, False)
                side = t + 2
            kept.append(v)
            sides.append(side)
        return sides[0] if len(sides) == 1 and sides[0] >= 0 else None

    def insert(self, p: int) -> bool:
        """Put in the point number p, beyond the hull as well; False if another one is in its place."""
        h = self._located(p)
        if h is None:
            return False
        origin, twin, after, before = self.origin, self.twin, self.after, self.before
        g, f = after[h], before[h]
        a, b, c = origin[h], origin[g], origin[f]
        second = len(origin)
        third = second + 3
        origin += [b, c, p, c, a, p]
        self.fixed += [False] * 6
        twin += [twin[g], third + 2, g, twin[f], f, second + 1]
        twin[twin[g]], twin[twin[f]] = second, third
        origin[f] = p
        twin[g], twin[f] = second + 2, third + 1
        leaving = self.leaving
        leaving[a], leaving[b], leaving[c], leaving[p] = h, second, third, f
        around = [h, second, third]
        if self.n not in (a, b, c):
            for each in around[:]:
                if self.turn(origin[each], origin[after[each]], p) == 0:  # p lies on it
                    around += self._flip(each)
        self._flip_to_delaunay(around)
        return True

    def _located(self, p):
        """A half-edge of the triangle that contains the point number p, or None if p coincides with a corner."""
        origin, twin, after, before, n = self.origin, self.twin, self.after, self.before, self.n
        h = len(origin) - 1
        while n in (origin[h], origin[after[h]], origin[before[h]]):
            h = after[h] if n in (origin[h], origin[after[h]]) else twin[h]
        for step in range(len(origin)):  # among Delaunay triangles the way does not lead in circles
            on_edges = 0
            for each in (after[h], before[h], h) if step % 2 else (before[h], after[h], h):
                side = self.turn(origin[each], origin[after[each]], p)
                if side < 0:
                    break
                on_edges += side == 0
            else:
                return h if on_edges < 2 else None
            h = twin[each]
            if origin[before[h]] == n:
                return h
        return None

    def make_delaunay(self) -> None:
        """Flip edges that are not fixed until all are Delaunay."""
        origin, twin = np.array(self.origin), np.array(self.twin)
        one = np.arange(len(origin))
        corners = origin[[one, twin, self.before[: len(one)], np.array(self.before)[twin]]]
        one = one[(one < twin) & (corners < self.n).all(axis=0) & ~np.array(self.fixed)]
        corners = corners[:, one]
        x, y = np.array(self.x), np.array(self.y)
        wrong = _in_circle(*(coordinate[corner] for corner in corners for coordinate in (x, y)))
        self._flip_to_delaunay(one[wrong].tolist())

    def _flip(self, h):
        """Replace the edge of the half-edge h by its quadrilateral's other diagonal; returns the sides' half-edges."""
        origin, twin, fixed, after, before = self.origin, self.twin, self.fixed, self.after, self.before
        g = twin[h]
        ahead, behind = before[h], before[g]
        a, b, c, d = origin[h], origin[g], origin[ahead], origin[behind]
        origin[h], origin[g] = d, c
        for each, outer in ((h, behind), (g, ahead)):
            other = twin[outer]
            twin[each], twin[other], fixed[each] = other, each, fixed[outer]
        twin[ahead], twin[behind] = behind, ahead
        fixed[ahead] = fixed[behind] = False
        self.leaving[a], self.leaving[b] = after[g], after[h]
        return [h, after[h], g, after[g]]

    def _flip_to_delaunay(self, waiting):
        """Flip edges until those of the half-edges `waiting`, a list, are Delaunay, and those that flips reach.

        Lawson 1977: lifted on a paraboloid, the triangles are a surface, which each flip lowers; so there is an end, as
        long as no edge is flipped for which rounding decides.
        """
        x, y = self.x, self.y
        origin, twin, fixed, before, n = self.origin, self.twin, self.fixed, self.before, self.n
        while waiting:
            h = waiting.pop()
            if fixed[h]:
                continue
            g = twin[h]
            a, b, c, d = origin[h], origin[g], origin[before[h]], origin[before[g]]
            if c == n or d == n:
                continue
            if a == n or b == n:  # where the hull is not convex yet
                flip = self.turn(d, b, c) > 0 if a == n else self.turn(c, a, d) > 0
            else:
                flip = _in_circle(x[a], y[a], x[b], y[b], x[c], y[c], x[d], y[d])
                flip = flip and self.turn(d, b, c) > 0 and self.turn(c, a, d) > 0
            if flip:
                waiting += self._flip(h)


def _in_circle(ax, ay, bx, by, cx, cy, dx, dy):
    """Whether the point d certainly lies within the circle of a, b, c, which are counter-clockwise; also for arrays."""
    ax, ay, bx, by, cx, cy = ax - dx, ay - dy, bx - dx, by - dy, cx - dx, cy - dy
    bc, cb, ca, ac, ab, ba = bx * cy, cx * by, cx * ay, ax * cy, ax * by, bx * ay
    a2, b2, c2 = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    terms = a2 * (abs(bc) + abs(cb)) + b2 * (abs(ca) + abs(ac)) + c2 * (abs(ab) + abs(ba))
    return a2 * (bc - cb) + b2 * (ca - ac) + c2 * (ab - ba) > _CIRCLE_ROUNDING * terms
