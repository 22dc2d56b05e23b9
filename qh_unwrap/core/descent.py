# SPDX-License-Identifier: GPL-3.0-or-later
"""From a good map to the one of least distortion: projected Newton steps on an energy that no triangle can flip in.

The energy is the mean over the surface of `a^p b^r` with `a = (s1/s2 + s2/s1) / 2` (angle) and
`b = (s1 s2 + 1 / (s1 s2)) / 2` (area), s1 and s2 the stretches: symmetric Dirichlet for p = r = 1.  Its Hessian is
made positive in every triangle by its analytic eigenvalues (Smith, de Goes, Kim 2019).  Air takes part, with the shape
it has before a step as its rest shape (Jiang, Schaefer, Panozzo 2017), so that the outline cannot cross itself.
"""

import numpy as np

from .quasi_harmonic import exponents
from .surface import signed_areas
from .tensor import area_scale, edge_matrix
from .validity import invalid

_AIR = 0.1  # the air's part of the energy
_FLAT = 1e-2  # of its made-up area counts a triangle that has none, so that it cannot flip either
_SMALLEST = 1e-9  # eigenvalue of the Hessian's triangles
_LONGEST = 0.9  # of the step at which a triangle collapses
_ARMIJO = 1e-4
_HALVINGS = 20
_NEGLIGIBLE = 1e-3  # a decrease of the energy by this part of it is not worth a step


def descend(domain, balance, steps, uv):
    """Lower the energy of the map `uv` in at most so many Newton steps; yields each map and whether it was the last.

    `uv` holds the vertices of `domain`, a `Held` or an `Exterior`, whose air is renewed as needed.  The last step is
    the one that no longer paid.  Maps with flips are left as they are.
    """
    scale = np.sqrt(area_scale(domain.surface, uv))
    newton = None
    for _ in range(steps):
        uv = domain.renewed(uv)
        if newton is None or newton.surface is not domain.surface:
            newton = _Newton(domain)
        energy = _Energy(domain.surface, uv, balance, scale)
        start = energy.value(uv)
        if not np.isfinite(start):
            return
        gradient, direction = newton.direction(energy, uv)
        longest = energy.longest_step(uv, direction)
        length, slope = min(1.0, _LONGEST * longest), float((gradient * direction).sum())
        for _ in range(_HALVINGS):
            moved = uv + length * direction
            value = energy.value(moved)
            if value <= start + _ARMIJO * length * slope and not invalid(domain.surface, moved).any():
                break
            length /= 2
        else:
            return
        uv = moved
        done = start - value < _NEGLIGIBLE * start
        yield uv, done
        if done:
            return


class _Energy:
    """The energy of maps of a surface with air, as a weighted sum over its triangles."""

    def __init__(self, surface, uv, balance, scale):
        self.triangles = surface.triangles
        self._powers = exponents(balance)
        rest = surface.shapes_in(uv)
        weight = np.where(surface.air, 0, np.where(surface.degenerate, _FLAT, 1) * surface.area)
        self.weight = weight / weight.sum()
        (a, b), (c, d) = edge_matrix(rest) * np.where(surface.air, 1.0, scale)
        det = a * d - b * c
        inverse = np.array([[d, -b], [-c, a]]) / np.where(det == 0, 1.0, det)
        self._hats = np.stack([-inverse.sum(axis=0), *inverse])  # gradients of the corners' hat functions, (3, 2, m)
        if surface.air.any():
            air = surface.air & ~surface.degenerate
            self.weight[air] = _AIR * self.value(uv) / air.sum()
        self._counts = self.weight > 0

    def jacobian(self, uv):
        """The map's derivative in every triangle, (2, 2, m)."""
        return np.einsum("tci,cjt->ijt", uv[self.triangles], self._hats)

    def value(self, uv):
        """Infinite where a triangle that counts is flipped."""
        (a, b), (c, d) = self.jacobian(uv)[..., self.weight > 0]
        det = a * d - b * c
        if (det <= 0).any():
            return np.inf
        p, r = self._powers
        angle, area = (a * a + b * b + c * c + d * d) / (2 * det), (det + 1 / det) / 2
        return float(self.weight[self.weight > 0] @ (angle**p * area**r))

    def derivatives(self, uv):
        """The gradient by the corners (3, 2, m), and the Hessian's blocks of corners c and c + 1 (3, 2, 2, m)."""
        p, r = self._powers
        (a, b), (c, d) = self.jacobian(uv)
        # Singular values and vectors in closed form
        turn, shear = np.arctan2(c - b, a + d), np.arctan2(c + b, a - d)
        left, right = (turn + shear) / 2, (turn - shear) / 2
        s1 = (np.hypot(a + d, c - b) + np.hypot(a - d, c + b)) / 2
        det = a * d - b * c
        det = np.where(self._counts, det, s1 * s1)  # triangles that do not count stay harmless
        s2 = det / s1
        size = s1 * s1 + s2 * s2
        beta, gamma = (det**2 - 1) / (det**2 + 1), 4 * det**2 / (det**2 + 1) ** 2

        density = self.weight * (size / (2 * det)) ** p * ((det + 1 / det) / 2) ** r
        g1 = p * (2 * s1 / size - 1 / s1) + r * beta / s1  # logarithmic derivatives
        g2 = p * (2 * s2 / size - 1 / s2) + r * beta / s2
        f11 = g1 * g1 + p * (2 / size - 4 * (s1 / size) ** 2 + 1 / s1**2) + r * (gamma - beta) / s1**2
        f22 = g2 * g2 + p * (2 / size - 4 * (s2 / size) ** 2 + 1 / s2**2) + r * (gamma - beta) / s2**2
        f12 = g1 * g2 - 4 * p * s1 * s2 / size**2 + r * gamma / det
        gap = s1 - s2
        flip = np.where(gap > 1e-6 * s1, (g1 - g2) / np.where(gap > 0, gap, 1), f11 - f12)
        twist = (g1 + g2) / (s1 + s2)

        f11, f12, f22 = _positive(f11, f12, f22)
        f11, f12, f22 = density * f11, density * f12, density * f22
        flip, twist = (density * np.maximum(each, _SMALLEST) for each in (flip, twist))
        both, skew = (flip + twist) / 2, (flip - twist) / 2

        # In the frame of the left singular vectors; h1 and h2 are the hats' gradients along the right ones
        u = np.array([[np.cos(left), -np.sin(left)], [np.sin(left), np.cos(left)]])
        cos, sin = np.cos(right), np.sin(right)
        h1, h2 = self._hats[:, 0] * cos - self._hats[:, 1] * sin, self._hats[:, 0] * sin + self._hats[:, 1] * cos
        gradient = np.einsum("ijt,jct->cit", u, np.array([density * g1 * h1, density * g2 * h2]))
        k1, k2 = np.roll(h1, -1, axis=0), np.roll(h2, -1, axis=0)
        blocks = np.array(
            [
                [f11 * h1 * k1 + both * h2 * k2, f12 * h1 * k2 + skew * h2 * k1],
                [f12 * h2 * k1 + skew * h1 * k2, f22 * h2 * k2 + both * h1 * k1],
            ]
        )
        return gradient, np.einsum("iat,abct,jbt->cijt", u, blocks, u)

    def longest_step(self, uv, direction):
        """The smallest positive step at which a triangle that counts collapses, or infinity."""
        corners = self.triangles[self._counts]
        d0, d2 = 2 * signed_areas(uv[corners]), 2 * signed_areas(direction[corners])
        d1 = 2 * signed_areas((uv + direction)[corners]) - d0 - d2
        # d0 + d1 t + d2 t^2 = 0; d0 is positive.  In 1 / t the smallest positive t is the largest root.
        discriminant = d1 * d1 - 4 * d0 * d2
        largest = (-d1 + np.sqrt(np.maximum(discriminant, 0))) / (2 * d0)
        largest = largest[(discriminant >= 0) & (largest > 0)]
        return 1 / largest.max() if len(largest) else np.inf


def _positive(a, b, c):
    """The symmetric matrices [[a, b], [b, c]] with their eigenvalues raised to the least one."""
    mean, half = (a + c) / 2, (a - c) / 2
    radius = np.hypot(half, b)
    high, low = np.maximum(mean + radius, _SMALLEST), np.maximum(mean - radius, _SMALLEST)
    radius = np.maximum(radius, np.finfo(float).tiny)
    middle, spread = (high + low) / 2, (high - low) / 2
    return middle + spread * half / radius, spread * b / radius, middle - spread * half / radius


class _Newton:
    """Newton directions of a domain's free vertices, both coordinates together."""

    def __init__(self, domain):
        self.surface = domain.surface
        self._free, self._inner = domain.dirichlet.free, domain.dirichlet.inner
        self._system = domain.dirichlet.system(width=2)

    def direction(self, energy, uv):
        """The gradient and the direction of descent, (n, 2) each, zero where held."""
        surface, free = self.surface, self._free
        n, k = len(uv), len(surface.edges)
        gradient, blocks = energy.derivatives(uv)
        corners = surface.triangles.T.ravel()
        total = np.column_stack([np.bincount(corners, gradient[:, i].ravel(), n) for i in range(2)])

        start, end = surface.half_edges
        edge = surface.half_edge_edges
        backward = (start > end).reshape(3, -1)
        blocks = np.where(backward[:, None, None], blocks.swapaxes(1, 2), blocks)  # as seen from the smaller vertex
        sums = np.empty((k, 2, 2))
        for i in range(2):
            for j in range(2):
                sums[:, i, j] = np.bincount(edge, blocks[:, i, j].ravel(), k)
        diagonal = np.empty((n, 2, 2))
        one, other = surface.edges.T
        for i in range(2):
            for j in range(2):  # moving all vertices together changes nothing
                diagonal[:, i, j] = -np.bincount(one, sums[:, i, j], n) - np.bincount(other, sums[:, j, i], n)
        inner = sums[self._inner]
        solve = self._system.factor(inner, inner.swapaxes(1, 2), diagonal[free])
        direction = np.zeros_like(uv)
        direction[free] = -solve(total[free].ravel()).reshape(-1, 2)
        gradient = np.zeros_like(uv)
        gradient[free] = total[free]
        return gradient, direction
