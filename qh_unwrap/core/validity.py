# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles are flipped, whether a map covers nothing twice, and the weights that turn triangles back."""

from fractions import Fraction

import numpy as np

_FLOOR = 0.1
_ROUNDS = 8
_HALVINGS = 10


def turn(a, b, c):
    """1 where the points a, b, c (n, 2) turn left, -1 where they turn right, 0 where they lie on a line: exactly."""
    first = (b - a)[:, 0] * (c - a)[:, 1]
    second = (b - a)[:, 1] * (c - a)[:, 0]
    result = np.sign(first - second).astype(np.int8)
    # Where the two nearly cancel, rounding decides; then count in fractions (Shewchuk 1997 bounds the error).
    close = np.abs(first - second) <= 1e-15 * (np.abs(first) + np.abs(second))
    for k in np.flatnonzero(close & (first != 0) & (second != 0)):
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(value) for value in point[k].tolist()] for point in (a, b, c))
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        result[k] = (det > 0) - (det < 0)
    return result


def as_stored(uv):
    """`uv` rounded to the 32-bit floats that Blender keeps."""
    with np.errstate(over="ignore"):
        return np.asarray(uv).astype(np.float32).astype(np.float64)


def orientation(uv, triangles):
    """1 for triangles that follow their winding, -1 for flipped, 0 for collapsed ones, (m,), in 32-bit floats."""
    a, b, c = (as_stored(uv)[corner] for corner in triangles.T)
    return turn(a, b, c)


def is_injective(uv, triangles, loops):
    """Whether no two points of the surface share a place in 32-bit floats: a certificate, not an estimate.

    If every triangle follows its winding, a place is covered as often as the boundary `loops` wind around it; and that
    is once or never, where the loops are simple, meet nowhere, and the holes' lie within the outer one.
    """
    if (orientation(uv, triangles) <= 0).any():
        return False
    polygons = [as_stored(uv)[loop] for loop in loops]
    # Triangles of positive area leave the outer loop counter-clockwise and the others clockwise, if all are simple.
    turns_left = [enclosed_area(polygon) > 0 for polygon in polygons]
    return sum(turns_left) == 1 and count_crossings(polygons, touching=True) == 0


def enclosed_area(points):
    """Signed area within the closed polygon (n, 2), positive counter-clockwise."""
    (x, y), (next_x, next_y) = (points - points[0]).T, (np.roll(points, -1, axis=0) - points[0]).T
    return 0.5 * (x * next_y - y * next_x).sum()


def count_crossings(polygons, touching=False):
    """How many pairs of sides of the closed polygons, each (n, 2), properly cross, or also touch, exactly."""
    start = np.concatenate(polygons)
    end = np.concatenate([np.roll(points, -1, axis=0) for points in polygons])
    first_side = np.repeat(np.cumsum([0, *map(len, polygons[:-1])]), [len(points) for points in polygons])
    last_side = first_side + np.repeat([len(points) - 1 for points in polygons], [len(points) for points in polygons])
    number = np.arange(len(start))
    following = np.where(number == last_side, first_side, number + 1)

    axis = int(np.argmax(np.ptp(start, axis=0)))
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.argsort(low[:, axis], kind="stable")
    crossings = 0
    # Sides sorted by where they begin: compare each with its followers as long as those begin before it ends.
    place = np.arange(len(order))
    for ahead in range(1, len(order)):
        place = place[place + ahead < len(order)]
        place = place[low[order[place + ahead], axis] <= high[order[place], axis]]
        if not len(place):
            break
        one, other = order[place], order[place + ahead]
        near = (low[one] <= high[other]).all(axis=1) & (low[other] <= high[one]).all(axis=1)
        one, other = one[near], other[near]
        a, b, c, d = start[one], end[one], start[other], end[other]
        across, back = turn(a, b, c) * turn(a, b, d), turn(c, d, a) * turn(c, d, b)
        if not touching:
            crossings += int(np.sum((across < 0) & (back < 0)))
            continue
        neighbours = (following[one] == other) | (following[other] == one)
        crossings += int(np.sum((across <= 0) & (back <= 0) & ~neighbours))
    if touching:  # and sides that turn back on the one before
        back = start[following] - start, end[following] - start[following]
        on_a_line = turn(start, end, end[following]) == 0
        crossings += int(np.sum(on_a_line & ((back[0] * back[1]).sum(axis=1) <= 0)))
    return crossings


class Repair:
    """Turns flipped triangles back by flooring the weights around them."""

    def __init__(self, surface, dirichlet, remember):
        self.surface = surface
        self.dirichlet = dirichlet
        self.remember = remember
        self.active = False  # whether any repair was ever needed
        self._marked = np.zeros(len(surface.vertices), bool)

    def invalid(self, uv):
        """The triangles that are not positive though they could be, (m,) bool."""
        return (orientation(uv, self.surface.triangles) <= 0) & ~(self.surface.degenerate | self.surface.air)

    def solve(self, weights, previous):
        """Solve with symmetric `weights` (2, k); where the result flips, again with raised weights.

        If that does not help, go only part of the way from the `previous` map, where that one is valid.
        """
        if not self.remember:
            self._marked[:] = False
        for _ in range(_ROUNDS + 1):
            uv = self.dirichlet.solve(self._floored(weights))
            wrong = self.invalid(uv)
            if not wrong.any():
                return uv
            self.active = True
            self._mark(wrong)
        if not self.invalid(previous).any():
            for halving in range(1, _HALVINGS + 1):
                shorter = previous + (uv - previous) / 2**halving
                if not self.invalid(shorter).any():
                    return shorter
            return previous
        return uv

    def _mark(self, wrong):
        # Every vertex of a wrong triangle, and the two rings around it
        self._marked[self.surface.triangles[wrong]] = True
        edges = self.surface.edges
        for _ in range(2):
            self._marked[edges[self._marked[edges].any(axis=1)]] = True

    def _floored(self, weights):
        edges = self.surface.edges
        near = self._marked[edges].any(axis=1)
        if not near.any():
            return weights
        diagonal = np.abs(self.dirichlet.diagonal(weights))
        i, j = edges[near].T
        floored = weights.copy()
        floored[:, near] = np.maximum(weights[:, near], _FLOOR / 6 * np.sqrt(diagonal[i] * diagonal[j]))
        return floored
