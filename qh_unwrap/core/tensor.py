# SPDX-License-Identifier: GPL-3.0-or-later
"""The first fundamental form of a map and the tensors made from it.

Fields of matrices keep the triangles in the last axis: (2, 2, m).  Symmetric tensors [[a, c], [c, b]] are the
three rows (a, b, c) of a (3, m) array, named as in the paper's appendix A.

The map runs from the surface to the plane: `G = E P^-1` with the edge matrices E of a triangle in the plane and P of
the same triangle laid isometrically in the plane, so that a collapsed triangle needs no inverse.  Its squared singular
values are the eigenvalues of `G^T G`; the paper's first fundamental form (eq. 4) has their inverses.
"""

import numpy as np

from .triangles import by_parts, corners_of

_SMALLEST = 1e-12  # squared stretches, and their ratios, are kept within this and its inverse


def jacobian(chart, uv):
    """Jacobian of the map from the surface to the plane in every triangle, (2, 2, m)."""
    return jacobian_of(chart.triangles.T, chart.hats, uv)


def jacobian_of(corners, hats, uv):
    """The same for triangles with the `corners` (3, m) and the `hats` that a surface has, (2, 2, m)."""
    uv = np.asfortranarray(uv)

    def derivative(corners, hats):
        x, y = corners_of(uv, corners.T).T
        (ax, bx), (ay, by) = x[1:] - x[0], y[1:] - y[0]
        (h1, h2), (k1, k2) = hats
        return np.array([[ax * h1 + bx * k1, ax * h2 + bx * k2], [ay * h1 + by * k1, ay * h2 + by * k2]])

    return by_parts(derivative, corners, hats)


def area_scale(chart, jacobian):
    """The layout's area by the chart's, of every piece, (p,); never zero.

    Dividing squared stretches by it makes them free of scale.
    """
    (a, b), (c, d) = jacobian
    scale = np.abs(chart.sums(chart.area * (a * d - b * c))) / chart.sums(chart.area)
    return np.maximum(scale, 1e-300)


def squared_stretches(chart, uv, side="right", smallest=_SMALLEST, scale=None):
    """Squared singular values of the map, free of scale, and twice the angle of the direction of the larger.

    `side` "right" gives directions on the surface (in `chart.rest`), "left" in the plane.
    `scale` (p,) is that of the pieces, by default what the chart alone has.
    Returns (larger, smaller, cos 2 theta, sin 2 theta), each (m,).
    """
    G = jacobian(chart, uv)
    scale = (area_scale(chart, G) if scale is None else scale)[chart.piece]

    def stretches(G, scale):
        (g11, g12), (g21, g22) = G if side == "right" else G.swapaxes(0, 1)
        a, b, c = g11**2 + g21**2, g12**2 + g22**2, g11 * g12 + g21 * g22
        half_difference, mean = (a - b) / 2, (a + b) / 2
        radius = np.hypot(half_difference, c)
        larger = mean + radius
        det = (g11 * g22 - g12 * g21) ** 2
        tiny = np.finfo(float).tiny
        lesser = det / np.maximum(larger, tiny)  # not mean - radius, which cancels
        radius = np.maximum(radius, tiny)  # a multiple of the identity has no direction: any will do
        larger, lesser = (np.clip(value / scale, smallest, 1 / smallest) for value in (larger, lesser))
        return larger, np.maximum(lesser, smallest * larger), half_difference / radius, c / radius

    return by_parts(stretches, G, scale)


def surface_tensor(chart, uv, balance, power=1.0, scale=None):
    """The quasi-harmonic operator's tensor M(t, q), carried to the surface's triangles, (3, m).

    `balance` is t: 1 conformal (the identity), 1/2 the paper's C^-1 (eq. 10), 0 authalic; `power` is q.  The stiffness
    matrix assembled with it on the surface equals that of M on the plane `uv`.
    """
    larger, smaller, cos, sin = squared_stretches(chart, uv, scale=scale)
    along, across = _powers(larger, smaller, balance, power)
    aspect = np.sqrt(smaller / larger)
    return _from_eigenvalues(along * aspect, across / aspect, cos, sin)


def plane_tensor(chart, uv, balance, power=1.0, scale=None):
    """The same tensor M(t, q) on the triangles of the plane `uv`, (3, m)."""
    larger, smaller, cos, sin = squared_stretches(chart, uv, side="left", scale=scale)
    return _from_eigenvalues(*_powers(larger, smaller, balance, power), cos, sin)


def scalar_tensor(chart, uv, balance, power=1.0, scale=None):
    """The scalar kappa of eq. (15), the square root of det M(t, q), (m,)."""
    larger, smaller, *_ = squared_stretches(chart, uv, scale=scale)
    return (larger * smaller) ** (power * (1 - balance) / 2)


def _powers(larger, smaller, t, q):
    # ( det(I)^(t - 1/2) I^(-t) )^q from the eigenvalues of the inverse of I
    common = (larger * smaller) ** (q * (1 - 2 * t) / 2)
    return common * larger ** (q * t), common * smaller ** (q * t)


def _from_eigenvalues(first, second, cos, sin):
    mean, half = (first + second) / 2, (first - second) / 2
    return np.array([mean + half * cos, mean - half * cos, half * sin])
