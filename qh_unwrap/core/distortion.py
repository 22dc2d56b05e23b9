# SPDX-License-Identifier: GPL-3.0-or-later
"""How a map distorts a surface, area-weighted on the surface and independent of the map's overall scale."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .certificate import orientation
from .chart import Chart, Surface
from .errors import ShapeError, UVError
from .pieces import starts_of_numbers
from .tensor import squared_stretches
from .triangles import areas_of, by_parts, laid_flat, signed_areas

_PER_TRIANGLE = {"per_triangle": True}  # marks the fields that are arrays (m,)


@dataclass(frozen=True, eq=False)
class Distortion:
    """Measures of one map.  The arrays (m,) hold one value for every triangle; ideal 1, for `triangle_log_area` 0."""

    l2_stretch: float
    """Root mean square stretch from the plane to the surface (Sander et al. 2001); ideal 1."""
    symmetric_dirichlet: float
    """Mean of (s1^2 + s2^2 + s1^-2 + s2^-2) / 4, s1 and s2 being the stretches at equal total areas; ideal 1."""
    angle: float
    """Mean ratio of the larger to the smaller stretch; ideal 1."""
    area: float
    """Root mean square of the logarithm of the relative area; ideal 0."""
    flips: int
    """Triangles that lie against their winding in 32-bit floats."""
    collapsed: int
    """Triangles without area in 32-bit floats, those without area on the surface not counted."""
    triangle_stretch: np.ndarray = field(repr=False, metadata=_PER_TRIANGLE)
    triangle_angle: np.ndarray = field(repr=False, metadata=_PER_TRIANGLE)
    triangle_log_area: np.ndarray = field(repr=False, metadata=_PER_TRIANGLE)
    triangle_orientation: np.ndarray = field(repr=False, metadata=_PER_TRIANGLE)

    def to_dict(self) -> dict[str, float]:
        """The measures by their names, without the arrays."""
        names = ("l2_stretch", "symmetric_dirichlet", "angle", "area", "flips", "collapsed")
        return {name: getattr(self, name) for name in names}


def measure(surface: Surface, uv: np.ndarray) -> Distortion:
    """The `Distortion` of the map `uv` (n, 2) of a `Surface` of one piece."""
    return measure_pieces(surface, uv)[0]


def measure_pieces(chart: Chart, uv: np.ndarray) -> list[Distortion]:
    """The `Distortion` of every piece's map."""
    larger, smaller, *_ = squared_stretches(chart, uv, smallest=1e-100)
    total = chart.sums(chart.measure)
    share = chart.measure / np.where(total > 0, total, 1)[chart.piece]
    squared, dirichlet, angle, log_area = by_parts(_measures, larger, smaller)
    sign = orientation(uv, chart.triangles)
    sign[(sign == 0) & (chart.measure == 0)] = 1
    numbers = (
        np.sqrt(chart.sums(share * squared)).tolist(),
        chart.sums(share * dirichlet).tolist(),
        chart.sums(share * angle).tolist(),
        np.sqrt(chart.sums(share * log_area**2)).tolist(),
        chart.sums((sign < 0).astype(int)).tolist(),
        chart.sums((sign == 0).astype(int)).tolist(),
    )
    ends = [*starts_of_numbers(chart.piece, chart.piece_count).tolist(), len(sign)]
    fields = np.sqrt(squared), angle, log_area, sign
    arrays = ([field[start:end] for start, end in pairwise(ends)] for field in fields)
    return [Distortion(*values) for values in zip(*numbers, *arrays, strict=True)]


def measure_corners(
    points: np.ndarray, uv: np.ndarray, island: np.ndarray | None = None
) -> tuple[list[Distortion], np.ndarray]:
    """The `Distortion` of every island of any UVs, valid or not, and which islands are mirrored, (k,) bool.

    points  (m, 3, 3), the corners of triangles in space, any unit
    uv      (m, 3, 2), those in the map; triangles need not hang together, and each may have UVs of its own
    island  (m,), the island of each triangle, ascending from 0 without gaps; by default all are one

    A triangle is flipped if it lies against most of the area of its island.  Raises `UVError` for UVs that are no
    numbers, `ShapeError` for arrays that do not fit.
    """
    points, uv = np.asarray(points, dtype=np.float64), np.asarray(uv, dtype=np.float64)
    if not len(uv) or points.shape != (len(uv), 3, 3) or uv.shape[1:] != (3, 2):
        raise ShapeError(f"there must be corners (m, 3, 3) and UVs (m, 3, 2), not {points.shape} and {uv.shape}")
    checked_uv(3 * len(uv), uv.reshape(-1, 2))
    chart = loose_triangles(points, np.zeros(len(uv), dtype=int) if island is None else np.asarray(island))
    mirrored = chart.sums(signed_areas(uv)) < 0
    seen = np.where(mirrored[chart.piece, None, None], (-1, 1), 1) * uv
    return measure_pieces(chart, seen.reshape(-1, 2)), mirrored


def loose_triangles(points: np.ndarray, island: np.ndarray) -> Chart:
    """Triangles (m, 3, 3) in space as a chart that knows no neighbours: corner c of triangle t is the vertex 3 t + c.

    `island` (m,) ascends; every island counts as if its area were 1.
    """
    starts = starts_of_numbers(island, int(island[-1]) + 1)

    def sums(values):
        return np.add.reduceat(values, starts, axis=0)

    middle = sums(points.mean(axis=1)) / sums(np.ones(len(points)))[:, None]
    centred = points - middle[island, None]
    extent = np.maximum.reduceat(np.abs(centred).max(axis=(1, 2)), starts)
    centred /= np.where(extent > 0, extent, 1)[island, None, None]
    area = sums(areas_of(centred))
    centred /= np.sqrt(np.where(area > _NOTHING, area, 1))[island, None, None]
    triangles = np.arange(3 * len(points)).reshape(-1, 3)
    size = np.sqrt(len(starts) / len(points))
    rest, degenerate = laid_flat(centred.reshape(-1, 3), triangles, size)
    measure = np.where(degenerate | (area <= _NOTHING)[island], 0.0, signed_areas(rest))
    nobody = np.zeros((0, 2), dtype=int)
    return Chart(triangles, nobody, nobody, rest, measure, measure, island, len(starts))


_NOTHING = 1e-14  # of the square of its extent, the area up to which an island has none


def _measures(larger, smaller):
    """Squared L2 stretch, symmetric Dirichlet energy, angle and log-area distortion of each triangle."""
    squared = (1 / larger + 1 / smaller) / 2
    dirichlet = (larger + smaller) / 4 + squared / 2
    return squared, dirichlet, np.sqrt(larger / smaller), (np.log(larger) + np.log(smaller)) / 2


def distortion(vertices: ArrayLike, triangles: ArrayLike, uv: ArrayLike) -> Distortion:
    """The `Distortion` of a map.

    Parameters
    ----------
    vertices : (n, 3), any unit
    triangles : (m, 3), consistently wound
    uv : (n, 2)

    Raises a subclass of `SurfaceError` for a bad surface, `UVError` for bad UVs.
    """
    surface = Surface(vertices, triangles)
    return measure(surface, checked_uv(len(surface.vertices), uv))


def checked_uv(n: int, uv: ArrayLike) -> np.ndarray:
    """`uv` as an (n, 2) array of finite floats; raises `UVError`."""
    uv = np.asarray(uv, dtype=np.float64)
    if uv.shape != (n, 2):
        raise UVError(f"the UVs must have the shape ({n}, 2), not {uv.shape}")
    if not np.isfinite(uv).all():
        raise UVError("some UVs are no numbers (NaN or infinite): reset them, or start from another map")
    return uv


def densities(its: Distortion) -> np.ndarray:
    """The symmetric Dirichlet energy of every triangle, (m,), whose mean is `symmetric_dirichlet`."""
    ratio = its.triangle_angle
    with np.errstate(over="ignore"):
        return (ratio + 1 / ratio) / 2 * np.cosh(its.triangle_log_area)
