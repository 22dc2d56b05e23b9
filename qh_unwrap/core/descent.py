# SPDX-License-Identifier: GPL-3.0-or-later
"""From a good map to the one of least distortion: projected Newton steps on an energy that no triangle can flip in.

The energy is the mean over the surface of `a^p b^r` with `a = (s1/s2 + s2/s1) / 2` (angle) and
`b = (s1 s2 + 1 / (s1 s2)) / 2` (area), s1 and s2 the stretches: symmetric Dirichlet for p = r = 1.  Its Hessian is
made positive in every triangle by its analytic eigenvalues (Smith, de Goes, Kim 2019).  Air takes part, with the shape
it has before a step as its rest shape (Jiang, Schaefer, Panozzo 2017), so that the outline cannot cross itself.
"""

import numpy as np

from .quasi_harmonic import density, exponents
from .tensor import area_scale, jacobian, jacobian_of
from .triangles import by_parts, corners_of, hat_gradients

_AIR = 0.1  # the air's part of the energy
_FLAT = 1e-2  # of its made-up area counts a triangle that has none, so that it cannot flip either
_SMALLEST = 1e-9  # eigenvalue of the Hessian's triangles
_LONGEST = 0.9  # of the step at which a triangle collapses
_ARMIJO = 1e-4
_HALVINGS = 20
_NEGLIGIBLE = 1e-3  # a decrease of the energy by this part of it is not worth a step,
_LITTLE = 1e-2  # nor one by this part of what it lies above its least value, 1
_INVISIBLE = 1e-6  # a decrease that nobody could see
_RESIDUAL = 0.03  # of Newton's equations, by the gradient


def descend(domain, balance, steps, uv):
    """Lower the energy of the map `uv` in at most so many Newton steps; yields each map and which pieces are done.

    `uv` holds the vertices of `domain`, a `Held` or an `Exterior`, whose air is renewed as needed.  The last step of a
    piece is the one that no longer paid; the last of all ends it.  Maps with flips are left as they are.
    """
    size = _size(domain.surface, uv)
    for _ in range(steps):
        uv = domain.renewed(uv)
        surface = domain.surface
        energy = _Energy(surface, uv, balance, size)
        before = energy.jacobian(uv)
        start = energy.value(before)
        if not np.isfinite(start).all():
            return
        gradient, direction = _newton_direction(domain, energy, before)
        change = energy.jacobian(direction)
        length = np.minimum(1.0, _LONGEST * energy.longest_step(before, change))
        slope = np.add.reduceat((gradient * direction).sum(axis=1), surface.vertex_starts)
        for _ in range(_HALVINGS):
            value = energy.value(before + length[energy.piece] * change)
            steep = ~(value <= start + _ARMIJO * length * slope)
            if not steep.any():
                break
            length[steep] /= 2
        else:
            length[steep] = 0
            if steep.all():
                return
        uv = uv + length[surface.vertex_piece, None] * direction
        worth = np.minimum(_NEGLIGIBLE * start, np.maximum(_LITTLE * (start - energy.least), _INVISIBLE))
        done = (length == 0) | (start - value < worth)
        yield uv, done
        if done.all():
            return


def energies(surface, uv, balance):
    """The energy of every piece's map, at equal areas of surface and layout, (p,); infinite where one is flipped."""
    energy = _Energy(surface, uv, balance, _size(surface, uv))
    return energy.value(energy.jacobian(uv))


def _size(surface, uv):
    """The scale of every piece's map, (p,)."""
    return np.sqrt(area_scale(surface, jacobian(surface, uv)))[surface.triangle_starts]


class _Energy:
    """The energy of maps of a surface with air, as a weighted sum over those of each piece's triangles that can flip.

    `size` (p,) is the scale of each piece's map that the energy aims at.
    """

    def __init__(self, surface, uv, balance, size):
        counts = ~(surface.air & surface.degenerate)
        if counts.all():
            counts = slice(None)
        self.piece = surface.piece[counts]
        self._starts = surface.triangle_starts
        self.corners = surface.triangles[counts].T.copy()
        self.edges = surface.triangle_edges[counts].T.ravel()
        self._balance = balance
        air = surface.air[counts]
        self._hats = surface.hats[..., counts] / size[self.piece]
        self._hats[..., air] = hat_gradients(corners_of(uv, self.corners[:, air].T))
        weight = np.where(air, 0, np.where(surface.degenerate[counts], _FLAT, 1) * surface.area[counts])
        self._weight = weight / np.add.reduceat(weight, self._starts)[self.piece]
        if air.any():  # there is one piece
            self._weight[air] = _AIR * self.value(self.jacobian(uv)) / air.sum()

    @property
    def least(self):
        """Its least possible value, where every triangle keeps its shape, (p,)."""
        return np.add.reduceat(self._weight, self._starts)

    def jacobian(self, uv):
        """The map's derivative in every triangle, (2, 2, m)."""
        return jacobian_of(self.corners, self._hats, uv)

    def value(self, jacobian):
        """Of each piece, (p,), infinite where a triangle is flipped."""
        (a, b), (c, d) = jacobian
        det = a * d - b * c
        flipped = ~(det > 0)
        det = np.where(flipped, 1.0, det)
        value = self._weight * density(a * a + b * b + c * c + d * d, det, self._balance)
        return np.add.reduceat(np.where(flipped, np.inf, value), self._starts)

    def longest_step(self, jacobian, change):
        """The smallest positive step of each piece at which a triangle collapses, (p,), or infinity."""
        (a, b), (c, d) = jacobian
        (e, f), (g, h) = change
        d0, d1, d2 = a * d - b * c, a * h + d * e - b * g - c * f, e * h - f * g
        # d0 + d1 t + d2 t^2 = 0; d0 is positive.  In 1 / t the smallest positive t is the largest root.
        discriminant = d1 * d1 - 4 * d0 * d2
        root = (-d1 + np.sqrt(np.maximum(discriminant, 0))) / (2 * d0)
        largest = np.maximum.reduceat(np.where(discriminant >= 0, root, 0), self._starts)
        return 1 / np.maximum(largest, 1e-300)

    def derivatives(self, jacobian):
        """The gradient by the corners' u and v, and the Hessian's blocks of the corners c and c + 1: (3, m) each.

        Four parts (mean, difference, symmetric, antisymmetric) make up the blocks [[m + d, s - a], [s + a, m - d]].
        """
        return by_parts(self._derivatives, jacobian, self._hats, self._weight)

    def _derivatives(self, jacobian, hats, weight):
        p, r = exponents(self._balance)
        (a, b), (c, d) = jacobian
        # Singular values in closed form, and the angles of the singular vectors
        turn, shear = np.arctan2(c - b, a + d), np.arctan2(c + b, a - d)
        left, right = (turn + shear) / 2, (turn - shear) / 2
        s1 = (np.hypot(a + d, c - b) + np.hypot(a - d, c + b)) / 2
        det = a * d - b * c
        s2 = det / s1
        size, square = s1 * s1 + s2 * s2, det * det
        beta, gamma = (square - 1) / (square + 1), 4 * square / (square + 1) ** 2

        value = weight * density(size, det, self._balance)
        g1 = p * (2 * s1 / size - 1 / s1) + r * beta / s1  # logarithmic derivatives
        g2 = p * (2 * s2 / size - 1 / s2) + r * beta / s2
        f11 = g1 * g1 + p * (2 / size - 4 * (s1 / size) ** 2 + 1 / s1**2) + r * (gamma - beta) / s1**2
        f22 = g2 * g2 + p * (2 / size - 4 * (s2 / size) ** 2 + 1 / s2**2) + r * (gamma - beta) / s2**2
        f12 = g1 * g2 - 4 * p * det / size**2 + r * gamma / det
        gap = s1 - s2
        flip = np.where(gap > 1e-6 * s1, (g1 - g2) / np.where(gap > 0, gap, 1), f11 - f12)
        twist = (g1 + g2) / (s1 + s2)
        f11, f12, f22 = _positive(f11, f12, f22)
        flip, twist = np.maximum(flip, _SMALLEST), np.maximum(twist, _SMALLEST)
        both, skew = (flip + twist) / 2, (flip - twist) / 2

        # The hats' gradients along the right singular vectors: h of the corners, k of the next ones
        cos, sin = np.cos(right), np.sin(right)
        x, y = hats[:, 0], hats[:, 1]
        h1, h2 = _with_first(x * cos - y * sin), _with_first(x * sin + y * cos)
        k1, k2 = np.roll(h1, -1, axis=0), np.roll(h2, -1, axis=0)
        cos, sin = np.cos(left), np.sin(left)
        along, across = value * g1 * h1, value * g2 * h2
        gradient = cos * along - sin * across, sin * along + cos * across

        # The blocks in the frame of the left singular vectors; turned, only the second and third row change
        long, short = value / 2 * h1 * k1, value / 2 * h2 * k2
        one, other = value / 2 * h1 * k2, value / 2 * h2 * k1
        difference = (f11 - both) * long - (f22 - both) * short
        symmetric = (f12 + skew) * (one + other)
        cos, sin = np.cos(2 * left), np.sin(2 * left)
        return (
            *gradient,
            (f11 + both) * long + (f22 + both) * short,
            difference * cos - symmetric * sin,
            difference * sin + symmetric * cos,
            (f12 - skew) * (other - one),
        )


def _with_first(hats):
    # The gradients (2, m) of the second and third corners' hats, and before them the first's: all three sum to zero.
    return np.array([-hats[0] - hats[1], *hats])


def _positive(a, b, c):
    """The symmetric matrices [[a, b], [b, c]] with their eigenvalues raised to the least one."""
    mean, half = (a + c) / 2, (a - c) / 2
    radius = np.hypot(half, b)
    high, low = np.maximum(mean + radius, _SMALLEST), np.maximum(mean - radius, _SMALLEST)
    radius = np.maximum(radius, np.finfo(float).tiny)
    middle, spread = (high + low) / 2, (high - low) / 2
    return middle + spread * half / radius, spread * b / radius, middle - spread * half / radius


def _newton_direction(domain, energy, jacobian):
    """The gradient and the direction of descent, (n, 2) each, zero where held."""
    gradient, hessian = _newton_system(domain, energy, jacobian)
    free = domain.dirichlet.free
    direction = np.zeros_like(gradient)
    direction[free] = -domain.dirichlet.system.solve_blocks(hessian, gradient[free], _RESIDUAL)
    return gradient, direction


def _newton_system(domain, energy, jacobian):
    """The gradient (n, 2), zero where held, and the Hessian's matrix of what is free."""
    surface, dirichlet = domain.surface, domain.dirichlet
    n, k, free = len(surface.vertices), len(surface.edges), dirichlet.free
    *by_corner, mean, difference, symmetric, anti = energy.derivatives(jacobian)
    gradient = np.zeros((n, 2))
    for total, values in zip(gradient.T, by_corner, strict=True):
        total[free] = np.bincount(energy.corners.ravel(), values.ravel(), n)[free]

    for c, block in enumerate(anti):  # transposed where seen from the larger vertex
        np.negative(block, out=block, where=energy.corners[c] > energy.corners[(c + 1) % 3])
    beside = [np.bincount(energy.edges, part.ravel(), k) for part in (mean, difference, symmetric, anti)]
    one, other = surface.edges.T
    # Moving all vertices together changes nothing.
    own = [-np.bincount(one, part, n) - np.bincount(other, part, n) for part in beside[:3]]
    return gradient, dirichlet.system.block_matrix(beside, own)
