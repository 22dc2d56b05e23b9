# SPDX-License-Identifier: GPL-3.0-or-later
"""Edge weights that discretise div(M grad f) = 0, and the schemes that make them from a map.

Weights are a (2, k) array over a chart's `edges` (i, j): row 0 is the weight of j in the equation of i, row 1 that of
i in the equation of j.  In all equations `sum_j w_ij (f_i - f_j) = 0` (eq. 2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .tensor import area_scale, jacobian, plane_tensor, scalar_tensor, squared_stretches, surface_tensor
from .triangles import by_parts, corners_of, signed_areas

if TYPE_CHECKING:
    from .chart import Chart
    from .settings import Settings


def uniform(chart: Chart) -> np.ndarray:
    """Tutte's weights: 1 for every edge."""
    return np.ones((2, len(chart.edges)))


def cotangent(chart: Chart, tensor: np.ndarray | None = None, corners: np.ndarray | None = None) -> np.ndarray:
    """Finite element weights, eq. (12), with a tensor (3, m) in every triangle; None, the identity, gives cotangents.

    The triangles have the shapes `corners` (m, 3, 2), by default those that the chart has at rest.
    """
    corners = chart.rest if corners is None else corners
    area = np.abs(signed_areas(corners))
    least = 1e-12 * area.max()

    def half_edge_weights(corners, area, *tensor):
        ex, ey = np.roll(corners, -1, axis=1) - corners  # edge c runs from corner c to c + 1
        fx, fy = np.roll(ex, -1, axis=0), np.roll(ey, -1, axis=0)
        gx, gy = np.roll(ex, -2, axis=0), np.roll(ey, -2, axis=0)
        if tensor:
            a, b, c = tensor[0]
            product = b * fx * gx - c * (fx * gy + fy * gx) + a * fy * gy
        else:
            product = fx * gx + fy * gy
        return product / (-4 * np.maximum(area, least))

    fields = (corners.T, area) if tensor is None else (corners.T, area, tensor)
    w = np.bincount(chart.triangle_edges.T.ravel(), by_parts(half_edge_weights, *fields).ravel(), len(chart.edges))
    return np.stack([w, w])


def mean_value(chart: Chart, tensor: np.ndarray | None = None, corners: np.ndarray | None = None) -> np.ndarray:
    """Mean value weights; always positive, if the tensors are positive definite.

    With tensors (3, m) they are those of the paper's appendix A, with scalars (m,) those with the kappa of eq. (15),
    with None those of Floater 2003.  The triangles have the shapes `corners` (m, 3, 2), by default those that the chart
    has at rest; flipped ones count by their absolute angles.
    """
    corners = chart.rest if corners is None else corners
    edge = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(edge, axis=2)
    shortest = max(1e-12 * length.max(), np.finfo(float).tiny)
    edge[length < shortest] = [shortest, 0]  # collapsed edges: any direction will do
    length = np.maximum(length, shortest).T
    ex, ey = edge[..., 0].T / length, edge[..., 1].T / length
    side = np.where(signed_areas(corners) < 0, -1.0, 1.0)
    # At corner c, between the edge to c + 1 and the edge back to c - 1
    cos = -(ex * np.roll(ex, 1, axis=0) + ey * np.roll(ey, 1, axis=0))
    sin = np.maximum(np.abs(ex * np.roll(ey, 1, axis=0) - ey * np.roll(ex, 1, axis=0)), 1e-12)
    tan_half = np.where(cos > 0, sin / (1 + np.abs(cos)), (1 + np.abs(cos)) / sin)
    at_start, at_end = (sin, tan_half), (np.roll(sin, -1, axis=0), np.roll(tan_half, -1, axis=0))
    if tensor is None:
        parts = [tan_half for _, tan_half in (at_start, at_end)]
    elif tensor.ndim == 1:
        parts = [tensor * tan_half for _, tan_half in (at_start, at_end)]
    else:
        a, b, c = _in_edge_frame(tensor, ex, ey, side)
        # Seen from the edge's end its direction turns by half a circle and the normal stays: c changes its sign.
        parts = [_appendix_a(a, b, c, *at_start), _appendix_a(a, b, -c, *at_end)]
    return _directed(chart, *(part / length for part in parts))


def _in_edge_frame(tensor, ex, ey, side):
    """The tensor's a, b, c, (3, m) each, in the frame of each edge, whose second axis points into the triangle."""
    a, b, c = tensor
    nx, ny = -ey * side, ex * side
    return (
        a * ex * ex + 2 * c * ex * ey + b * ey * ey,
        a * nx * nx + 2 * c * nx * ny + b * ny * ny,
        a * ex * nx + c * (ex * ny + ey * nx) + b * ey * ny,
    )


def _appendix_a(a, b, c, sin, tan_half):
    """The part of an edge's weight, before division by its length, that a triangle has; all are (3, m)."""
    return ((a + 2 * b + 2 * c * sin) * tan_half + (a - b) * sin) / 3


def _directed(chart, at_start, at_end):
    """The weights (2, k), from what every half-edge (3, m) adds in the equations of its start and of its end."""
    start, end = chart.half_edges
    edge, k = chart.half_edge_edges, len(chart.edges)
    forward = start < end
    at_start, at_end = at_start.ravel(), at_end.ravel()
    return np.stack(
        [
            np.bincount(edge, np.where(forward, at_start, at_end), k),
            np.bincount(edge, np.where(forward, at_end, at_start), k),
        ]
    )


class Stretch:
    """The weights of Yoshizawa, Belyaev, Seidel 2004: mean value weights at first; after every solve, each w_ij is
    divided by the stretch at j, and stays so.
    """

    def __init__(self) -> None:
        self._weights: dict[Chart, np.ndarray] = {}

    def __call__(self, chart: Chart, uv: np.ndarray, scale: np.ndarray | None = None) -> np.ndarray:
        """The next weights (2, k) after the chart's map `uv` (n, 2), of which the pieces have the `scale` (p,)."""
        weights = self._weights.get(chart)
        if weights is None:
            weights = mean_value(chart)
        larger, smaller, *_ = squared_stretches(chart, uv, scale=scale)
        area = np.repeat(chart.area, 3)
        corner = chart.triangles.ravel()
        squared = np.repeat((1 / larger + 1 / smaller) / 2, 3)
        total = np.maximum(np.bincount(corner, area), np.finfo(float).tiny)
        stretch = np.sqrt(np.bincount(corner, area * squared) / total)
        i, j = chart.edges.T
        self._weights[chart] = weights / np.stack([stretch[j], stretch[i]])
        return self._weights[chart]


def scheme(settings: Settings) -> Callable[[Sequence[Chart], np.ndarray], list[np.ndarray]]:
    """The function that the settings choose: from charts and their map `uv` (n, 2) to the next weights of each chart.

    Air has its rest shape as it lies in the map, and so no distortion: its tensor is the identity.
    """
    t, q = settings.balance, settings.tensor_power
    stretch = Stretch()

    def of(chart, uv, scale):
        if settings.weights == "COTANGENT":
            tensor = None if chart.is_air else surface_tensor(chart, uv, t, q, scale)
            return cotangent(chart, tensor, chart.shapes(uv))
        if chart.is_air:
            return mean_value(chart, None, chart.shapes(uv))
        if settings.weights == "STRETCH":
            return stretch(chart, uv, scale)
        make_tensor = plane_tensor if settings.weights == "MEAN_VALUE" else scalar_tensor
        return mean_value(chart, make_tensor(chart, uv, t, q, scale), corners_of(uv, chart.triangles))

    def of_all(charts, uv):
        island, *others = charts
        # Charts beside the island, unless they are air, count with the island's scale and not with their own.
        scale = None if all(chart.is_air for chart in others) else area_scale(island, jacobian(island, uv))
        return [of(chart, uv, scale) for chart in charts]

    return of_all
