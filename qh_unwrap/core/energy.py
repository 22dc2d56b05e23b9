# SPDX-License-Identifier: GPL-3.0-or-later
"""The energy of a map, its density, its values and its derivatives.

The density in a triangle with the stretches s1 and s2 is `a^p b^r`, where `a = (s1/s2 + s2/s1) / 2` measures the angles
and `b = (s1 s2 + 1 / (s1 s2)) / 2` the areas.  p = r = 1 (balance 0.25) is the symmetric Dirichlet energy.  The quasi-
harmonic iteration at a balance comes near the map of least energy at that balance, and the refinement goes there.
"""

from __future__ import annotations

import numpy as np

from .chart import Chart
from .domain import Domain
from .tensor import area_scale, jacobian, jacobian_of
from .triangles import by_parts, corners_of, hat_gradients, signed_areas

ISOMETRIC = 1 + 1e-6  # the energy of a map that nothing could better visibly
AIR = 0.25  # air weighs so many times the geometric mean of the energy and of what it lies above its least value,
_THIN = 1e-4  # or this where it lies hardly above that
_LIGHTER = 0.3  # times as much it weighs where all triangles are laid out at once
_FOLLOWING = [1, 2, 0]  # corners
_SMALLEST = 1e-9  # eigenvalue of the Hessian of a triangle of unit weight


def exponents(balance: float) -> tuple[float, float]:
    """The powers p and r of the density."""
    return min(max(4 * balance, 0.05), 1.0), min(1.0, 4 / 3 * (1 - balance)) ** 3


def density(squares: np.ndarray, det: np.ndarray, balance: float) -> np.ndarray:
    """`a^p b^r` of triangles with the sum of squared stretches `squares` and the product `det`, (m,)."""
    p, r = exponents(balance)
    return (squares / (2 * det)) ** p * ((det + 1 / det) / 2) ** r


def map_scale(chart: Chart, uv: np.ndarray) -> np.ndarray:
    """The scale of every piece's map, (p,): the root of the layout's area by the chart's; never zero."""
    return np.sqrt(area_scale(chart, jacobian(chart, uv)))


def energies(chart: Chart, uv: np.ndarray, balance: float) -> np.ndarray:
    """The energy of every piece's map, (p,), its mean density at equal areas of chart and layout.

    It is infinite where a triangle is flipped or collapsed; triangles without measure do not count.
    """
    G = jacobian(chart, uv)
    scale = area_scale(chart, G)[chart.piece]
    (a, b), (c, d) = G
    det = (a * d - b * c) / scale
    counts = chart.measure > 0
    flipped = counts & ~(det > 0)
    with np.errstate(over="ignore", invalid="ignore"):
        value = density((a * a + b * b + c * c + d * d) / scale, np.where(det > 0, det, 1.0), balance)
        value = np.where(counts, chart.measure * value, 0)
    return chart.sums(np.where(flipped, np.inf, value)) / chart.sums(chart.measure)


class Barrier:
    """The energy of maps as a sum over triangles, of which none may flip: the island's, and others' beside it.

    Parameters
    ----------
    domain : whose charts count; those of air have the shape at rest that they have in `uv`, and the less weight the
        nearer the map is to an isometry, so that air does not hold it back there
    uv : (n, 2), the map that is to be improved
    balance : as in `Settings`
    size : (p,), the scale of each piece's map that the energy aims at

    Fields are those of all charts' triangles, one chart after the other.
    """

    _own: tuple[np.ndarray, ...] = ()
    """What the density needs to know of every triangle, (m,) each."""

    def __init__(self, domain: Domain, uv: np.ndarray, balance: float, size: np.ndarray):
        self._domain, self._balance = domain, balance
        self.triangles = everything = domain.triangles
        self.corners, self._single = everything.corners, len(size) == 1
        self._hats, self._weight = np.empty((2, 2, self.corners.shape[1])), np.empty(self.corners.shape[1])
        self._solid = [(chart, part) for chart, part in everything if not chart.is_air]
        self._air = [(chart, part) for chart, part in everything if chart.is_air]
        self._total = sum(chart.sums(chart.barrier) for chart, _ in self._solid)
        for chart, part in self._solid:
            np.divide(chart.hats, self._at(size, chart), out=self._hats[..., part])
            np.divide(chart.barrier, self._at(self._total, chart), out=self._weight[part])
        self.rest(uv)

    def rest(self, uv: np.ndarray) -> None:
        """Take the shape that the air has in the map `uv` (n, 2), which is to be improved, for that at rest.

        The map's derivative and value are kept in `resting` and `resting_value`, the least possible value, where every
        triangle keeps its shape, in `least`, (p,).
        """
        # A face without area in space that lies folded over bars nothing: nothing could be done about it.
        self._void = None
        for chart, part in self._solid:
            if not chart.has_void:
                continue
            folded = (chart.measure == 0) & ~(signed_areas(corners_of(uv, chart.triangles)) > 0)
            self._void = np.zeros(len(self._weight), bool) if self._void is None else self._void
            self._void[part] = folded
            self._weight[part] = np.where(folded, 0, chart.barrier / self._at(self._total, chart))
        if self._void is not None and not self._void.any():
            self._void = None
        for chart, part in self._air:
            self._hats[..., part] = hat_gradients(chart.shapes(uv))
            self._weight[part] = 1
        self.least = sum(chart.sums(self._weight[its]) for chart, its in self._solid)
        self.resting = self.jacobian(uv)
        self.resting_value = value = self.value(self.resting)
        if self._air:
            value = np.where(np.isfinite(value), value, 1.0)  # else the map is given up anyway
            weight = AIR * np.sqrt(value * np.maximum(value - self.least, _THIN))
            counts = sum(chart.sums(chart.barrier) for chart, _ in self._air)
            for chart, part in self._air:
                self._weight[part] = chart.barrier * self._at(weight / np.maximum(counts, 1), chart)

    @property
    def in_air(self) -> np.ndarray:
        """Beside which pieces there is air, (p,) bool."""
        result = np.zeros(len(self._total), bool)
        for chart, _ in self._air:
            result[chart.piece] = True
        return result

    def _at(self, values, chart):
        """The values (p,) of the pieces at a chart's triangles, (m,), or the one that there is."""
        return values[0] if self._single else values[chart.piece]

    def jacobian(self, uv: np.ndarray) -> np.ndarray:
        """The map's derivative in every triangle, (2, 2, m)."""
        return jacobian_of(self.corners, self._hats, uv)

    def value(self, jacobian: np.ndarray) -> np.ndarray:
        """Of each piece without its air, (p,), infinite where a triangle is flipped, in the air as well."""
        (a, b), (c, d) = jacobian
        det = a * d - b * c
        flipped = ~(det > 0)
        some = flipped.any()
        if some:
            det[flipped] = 1
        total = np.zeros(())
        with np.errstate(over="ignore"):
            for chart, its in self._solid:
                squares = a[its] ** 2 + b[its] ** 2 + c[its] ** 2 + d[its] ** 2
                total = total + chart.sums(self._weight[its] * density(squares, det[its], self._balance))
        if some:
            barred = self._domain.triangles.largest(flipped & (self._weight > 0))
            total = np.where(barred, np.inf, total)
        return total

    def longest_step(self, jacobian: np.ndarray, change: np.ndarray) -> np.ndarray:
        """The smallest positive step of each piece at which a triangle collapses, (p,), or some 1e300."""
        (a, b), (c, d) = jacobian
        (e, f), (g, h) = change
        d0, d1, d2 = a * d - b * c, a * h + d * e - b * g - c * f, e * h - f * g
        # d0 + d1 t + d2 t^2 = 0; d0 is positive.  In 1 / t the smallest positive t is the largest root.
        discriminant = d1 * d1 - 4 * d0 * d2
        root = np.sqrt(np.maximum(discriminant, 0))
        root -= d1
        if self._void is not None:
            d0 = np.where(self._void, 1.0, d0)
            discriminant[self._void] = -1
        root /= 2 * d0
        root[discriminant < 0] = 0
        return 1 / np.maximum(self._domain.triangles.largest(root), 1e-300)

    def derivatives(self, jacobian: np.ndarray) -> tuple[np.ndarray, ...]:
        """The gradient by the corners' u and v, and the Hessian's blocks of the corners c and c + 1: (3, m) each.

        Four parts (mean, difference, symmetric, antisymmetric) make up the blocks [[m + d, s - a], [s + a, m - d]].
        Every triangle's part is made positive by its analytic eigenvalues (Smith, de Goes, Kim 2019).
        """
        return by_parts(
            lambda jacobian, hats, weight, *own: _derivatives(
                jacobian, hats, weight, lambda s1, s2: self._density(s1, s2, *own)
            ),
            self._at_voids(jacobian),
            self._hats,
            self._weight,
            *self._own,
        )

    def gradient(self, jacobian: np.ndarray) -> tuple[np.ndarray, ...]:
        """What `derivatives` returns first, without the Hessian: it needs no singular values."""
        return by_parts(
            lambda jacobian, hats, weight: _gradient(jacobian, hats, weight, self._balance),
            self._at_voids(jacobian),
            self._hats,
            self._weight,
        )

    def _at_voids(self, jacobian):
        """The map's derivative, with some number where triangles bar nothing and weigh nothing."""
        return jacobian if self._void is None else np.where(self._void, np.eye(2)[:, :, None], jacobian)

    def pull(self, jacobian: np.ndarray) -> tuple[np.ndarray, ...]:
        """What pulls every triangle to its shape at rest, turned as in the map: the gradient of half its squared
        distance from that (Liu et al. 2008) by the corners' u and v, and that energy's Hessian, the same in u and v, of
        the corners c and c + 1: (3, m) each.  Air weighs less here, so that outlines get farther.
        """
        weight = self._weight.copy()
        for _, part in self._air:
            weight[part] *= _LIGHTER
        return by_parts(_pull, jacobian, self._hats, weight)

    def _density(self, s1, s2):
        """The density of triangles with the stretches s1 and s2, (m,), and its first and second derivatives by s1 and
        s2, divided by the density itself."""
        p, r = exponents(self._balance)
        det = s1 * s2
        size, square = s1 * s1 + s2 * s2, det * det
        beta, gamma = (square - 1) / (square + 1), 4 * square / (square + 1) ** 2
        g1 = p * (2 * s1 / size - 1 / s1) + r * beta / s1
        g2 = p * (2 * s2 / size - 1 / s2) + r * beta / s2
        f11 = g1 * g1 + p * (2 / size - 4 * (s1 / size) ** 2 + 1 / s1**2) + r * (gamma - beta) / s1**2
        f22 = g2 * g2 + p * (2 / size - 4 * (s2 / size) ** 2 + 1 / s2**2) + r * (gamma - beta) / s2**2
        f12 = g1 * g2 - 4 * p * det / size**2 + r * gamma / det
        return density(size, det, self._balance), g1, g2, f11, f12, f22


def _derivatives(jacobian, hats, weight, density):
    (a, b), (c, d) = jacobian
    # The map's derivative is the sum of a similarity and a mirrored one.  Half the sum and the difference of their
    # lengths are the singular values, the second one negative where flipped, and their directions give the vectors.
    turn, same = _direction(a + d, c - b)
    shear, mirrored = _direction(a - d, c + b)
    s1 = (same + mirrored) / 2
    s1 = np.maximum(s1, np.finfo(float).tiny)
    s2 = (a * d - b * c) / s1
    double = turn[0] * shear[0] - turn[1] * shear[1], turn[0] * shear[1] + turn[1] * shear[0]
    left = _half(*double)
    right = turn[0] * left[0] + turn[1] * left[1], turn[1] * left[0] - turn[0] * left[1]
    value, g1, g2, f11, f12, f22 = density(s1, s2)
    value = weight * value
    gap, both = s1 - s2, s1 + s2
    flip = np.where(gap > 1e-6 * s1, (g1 - g2) / np.where(gap > 0, gap, 1), f11 - f12)
    twist = np.where(both > 1e-6 * s1, (g1 + g2) / np.where(both > 0, both, 1), f11 + f12)
    f11, f12, f22 = _positive(f11, f12, f22)
    flip, twist = np.maximum(flip, _SMALLEST), np.maximum(twist, _SMALLEST)
    both, skew = (flip + twist) / 2, (flip - twist) / 2

    # The hats' gradients along the right singular vectors: h of the corners, k of the next ones
    cos, sin = right
    x, y = hats[:, 0], hats[:, 1]
    h1, h2 = _with_first(x * cos - y * sin), _with_first(x * sin + y * cos)
    k1, k2 = h1[_FOLLOWING], h2[_FOLLOWING]
    cos, sin = left
    along, across = value * g1 * h1, value * g2 * h2
    gradient = cos * along - sin * across, sin * along + cos * across

    # The blocks in the frame of the left singular vectors; turned, only the second and third row change
    long, short = value / 2 * h1 * k1, value / 2 * h2 * k2
    one, other = value / 2 * h1 * k2, value / 2 * h2 * k1
    difference = (f11 - both) * long - (f22 - both) * short
    symmetric = (f12 + skew) * (one + other)
    cos, sin = double
    return (
        *gradient,
        (f11 + both) * long + (f22 + both) * short,
        difference * cos - symmetric * sin,
        difference * sin + symmetric * cos,
        (f12 - skew) * (other - one),
    )


def _gradient(jacobian, hats, weight, balance):
    (a, b), (c, d) = jacobian
    p, r = exponents(balance)
    size, det = a * a + b * b + c * c + d * d, a * d - b * c
    square = det * det
    value = weight * density(size, det, balance)
    by_size = 2 * p * value / size
    by_det = value / det * (r * (square - 1) / (square + 1) - p)
    h1, h2 = _with_first(hats[:, 0]), _with_first(hats[:, 1])
    return (
        (by_size * a + by_det * d) * h1 + (by_size * b - by_det * c) * h2,
        (by_size * c - by_det * b) * h1 + (by_size * d + by_det * a) * h2,
    )


def _pull(jacobian, hats, weight):
    (a, b), (c, d) = jacobian
    (cos, sin), _ = _direction(a + d, c - b)
    h1, h2 = _with_first(hats[:, 0]), _with_first(hats[:, 1])
    along, across = weight * h1, weight * h2
    return (
        (a - cos) * along + (b + sin) * across,
        (c - sin) * along + (d - cos) * across,
        along * h1[_FOLLOWING] + across * h2[_FOLLOWING],
    )


def _direction(x, y):
    """The unit vectors along (x, y), any where that is zero, and the lengths."""
    length = np.sqrt(x * x + y * y)
    somewhere = length > 0
    if somewhere.all():
        return (x / length, y / length), length
    by = np.where(somewhere, length, 1)
    return (np.where(somewhere, x / by, 1), np.where(somewhere, y / by, 0)), length


def _half(cos, sin):
    """Cosine and sine of half an angle that has these, up to the same sign of both."""
    large = np.sqrt((1 + np.abs(cos)) / 2)
    small = sin / (2 * large)
    ahead = cos >= 0
    return np.where(ahead, large, small), np.where(ahead, small, large)


def _with_first(hats):
    # The gradients (2, m) of the second and third corners' hats, and before them the first's: all three sum to zero.
    return np.array([-hats[0] - hats[1], *hats])


def _positive(a, b, c):
    """The symmetric matrices [[a, b], [b, c]] with their eigenvalues raised to the least one."""
    mean, half = (a + c) / 2, (a - c) / 2
    radius = np.sqrt(half * half + b * b)
    high, low = np.maximum(mean + radius, _SMALLEST), np.maximum(mean - radius, _SMALLEST)
    radius = np.maximum(radius, np.finfo(float).tiny)
    middle, spread = (high + low) / 2, (high - low) / 2
    return middle + spread * half / radius, spread * b / radius, middle - spread * half / radius
