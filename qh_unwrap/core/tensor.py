# SPDX-License-Identifier: GPL-3.0-or-later
"""The first fundamental form of a map and the tensors made from it.

NOTE: `jacobian` is the INVERSE of the paper's Jacobian J, and is called G here.  The paper's J leads from the plane to
the surface; G leads from the surface to the plane.  So a collapsed triangle has a G too: `G = E P^-1`, with the edges E
of a triangle in the plane and the edges P of the same triangle laid flat in its true shape.  The eigenvalues of
`G^T G`, on the surface, and of `G G^T`, in the plane, are the squared stretches; they are the inverses of the
eigenvalues of the paper's first fundamental form `I = J^T J = (G G^T)^-1` (eq. 4).

Fields of matrices keep the triangles in the last axis: (2, 2, m).  Symmetric tensors [[a, c], [c, b]] are the
three rows (a, b, c) of a (3, m) array, named as in the paper's appendix A.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from .triangles import by_parts, corners_of

if TYPE_CHECKING:
    from .chart import Chart

_SMALLEST = 1e-12  # least squared stretch, relative to the map's scale, and least ratio of two; the inverse is the most


def jacobian(chart: Chart, uv: np.ndarray) -> np.ndarray:
    """The derivative G of the map from the surface to the plane, (2, 2, m), triangles last: the inverse of the paper's
    J."""
    return jacobian_of(chart.triangles.T, chart.hats, uv)


def jacobian_of(corner_vertex: np.ndarray, hats: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The same of triangles given by the vertices at their corners, (3, m), and by `hats` like a chart's, (2, 2, m)."""
    uv = np.asfortranarray(uv)

    def derivative(corner_vertex, hats):
        x, y = corners_of(uv, corner_vertex.T).T
        (ax, bx), (ay, by) = x[1:] - x[0], y[1:] - y[0]
        (h1, h2), (k1, k2) = hats
        return np.array([[ax * h1 + bx * k1, ax * h2 + bx * k2], [ay * h1 + by * k1, ay * h2 + by * k2]])

    return by_parts(derivative, corner_vertex, hats)


def first_fundamental_form(chart: Chart, uv: np.ndarray) -> np.ndarray:
    """The paper's I = J^T J (eq. 4) in the triangles of the plane `uv`, (3, m); not finite where one is collapsed."""
    a, b, c = _products(*jacobian(chart, uv))  # of G G^T, the inverse
    return np.array([b, a, -c]) / (a * b - c * c)


def area_scale(chart: Chart, G: np.ndarray) -> np.ndarray:
    """The layout's area divided by the chart's, of every piece, (p,), from the map's `jacobian` G; never zero.

    Dividing squared stretches by it makes them free of scale.
    """
    (a, b), (c, d) = G
    scale = np.abs(chart.sums(chart.area * (a * d - b * c))) / chart.sums(chart.area)
    return np.maximum(scale, 1e-300)


def squared_stretches(
    chart: Chart,
    uv: np.ndarray,
    side: Literal["right", "left"] = "right",
    smallest: float = _SMALLEST,
    scale: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The squared singular values of the map, free of scale, and the direction of the larger one.

    Returns (larger, smaller, cos 2 theta, sin 2 theta), (m,) each, theta being the angle of that direction.  `side`
    "right" gives it on the surface (in `chart.rest`), "left" in the plane.  `scale` (p,) is the `area_scale` of the
    pieces, by default what the chart alone has.
    """
    G = jacobian(chart, uv)
    scale = (area_scale(chart, G) if scale is None else scale)[chart.piece]

    def stretches(G, scale):
        one, other = G.swapaxes(0, 1) if side == "right" else G  # its columns or its rows
        a, b, c = _products(one, other)
        half_difference, mean = (a - b) / 2, (a + b) / 2
        radius = np.hypot(half_difference, c)
        larger = mean + radius
        det = (one[0] * other[1] - one[1] * other[0]) ** 2
        tiny = np.finfo(float).tiny
        lesser = det / np.maximum(larger, tiny)  # not mean - radius, which cancels
        radius = np.maximum(radius, tiny)  # a multiple of the identity has no direction: any will do
        larger, lesser = (np.clip(value / scale, smallest, 1 / smallest) for value in (larger, lesser))
        return larger, np.maximum(lesser, smallest * larger), half_difference / radius, c / radius

    return by_parts(stretches, G, scale)


def surface_tensor(
    chart: Chart, uv: np.ndarray, balance: float, power: float = 1.0, scale: np.ndarray | None = None
) -> np.ndarray:
    """The quasi-harmonic operator's tensor M(t, q), carried to the surface's triangles, (3, m).

    `balance` is t: 1 conformal (the identity), 1/2 the paper's C^-1 (eq. 10), 0 authalic; `power` is q.  The stiffness
    matrix assembled with it on the surface equals that of M on the plane `uv`.
    """
    larger, smaller, cos, sin = squared_stretches(chart, uv, scale=scale)
    along, across = _powers(larger, smaller, balance, power)
    aspect = np.sqrt(smaller / larger)
    return _from_eigenvalues(along * aspect, across / aspect, cos, sin)


def plane_tensor(
    chart: Chart, uv: np.ndarray, balance: float, power: float = 1.0, scale: np.ndarray | None = None
) -> np.ndarray:
    """The same tensor M(t, q) on the triangles of the plane `uv`, (3, m)."""
    larger, smaller, cos, sin = squared_stretches(chart, uv, side="left", scale=scale)
    along, across = _powers(larger, smaller, balance, power)
    return _from_eigenvalues(along, across, cos, sin)


def scalar_tensor(
    chart: Chart, uv: np.ndarray, balance: float, power: float = 1.0, scale: np.ndarray | None = None
) -> np.ndarray:
    """The scalar kappa of eq. (15), the square root of det M(t, q), (m,)."""
    larger, smaller, *_ = squared_stretches(chart, uv, scale=scale)
    return (larger * smaller) ** (power * (1 - balance) / 2)


def _products(one, other):
    """The rows (a, b, c) of the matrix of the products of two vectors (2, m) with themselves and each other."""
    return one[0] ** 2 + one[1] ** 2, other[0] ** 2 + other[1] ** 2, one[0] * other[0] + one[1] * other[1]


def _powers(larger, smaller, t, q):
    """The eigenvalues, (m,) each, of ( det(I)^(t - 1/2) I^(-t) )^q, from those of the inverse of I."""
    common = (larger * smaller) ** (q * (1 - 2 * t) / 2)
    return common * larger ** (q * t), common * smaller ** (q * t)


def _from_eigenvalues(first, second, cos, sin):
    """The symmetric tensors (3, m) with these eigenvalues, from twice the angle of the first one's direction."""
    mean, half = (first + second) / 2, (first - second) / 2
    return np.array([mean + half * cos, mean - half * cos, half * sin])
