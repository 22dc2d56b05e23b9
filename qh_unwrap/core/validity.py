# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles are flipped, and the weights that turn them back."""

from fractions import Fraction

import numpy as np

_FLOOR = 0.1
_ROUNDS = 8
_HALVINGS = 10


def orientation(uv, triangles):
    """1 for triangles that follow their winding, -1 for flipped, 0 for collapsed ones, (m,).

    Decided exactly, for the 32-bit floats that Blender stores.
    """
    with np.errstate(over="ignore"):
        a, b, c = (uv.astype(np.float32).astype(np.float64)[corner] for corner in triangles.T)
    first = (b - a)[:, 0] * (c - a)[:, 1]
    second = (b - a)[:, 1] * (c - a)[:, 0]
    result = np.sign(first - second).astype(np.int8)
    close = np.abs(first - second) <= 1e-15 * (np.abs(first) + np.abs(second))
    for t in np.flatnonzero(close & (first != 0) & (second != 0)):
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(value) for value in point[t].tolist()] for point in (a, b, c))
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        result[t] = (det > 0) - (det < 0)
    return result


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
