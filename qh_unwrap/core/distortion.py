# SPDX-License-Identifier: GPL-3.0-or-later
"""How a map distorts a surface, area-weighted on the surface and independent of the map's overall scale."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .certificate import orientation
from .chart import Chart, Surface
from .errors import ShapeError, UVError
from .pieces import starts_of_numbers
from .tensor import squared_stretches
from .triangles import areas_of, boxes_of, by_parts, laid_flat, signed_areas

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
    """The `Distortion` of every piece's map, beside the shapes that triangles have in space."""
    return _by_pieces(chart.in_space, *_fields(chart.in_space, uv))


def _fields(chart, uv):
    """Stretch, angle, logarithm of the area, orientation, energy and squared stretch of every triangle, (m,) each."""
    larger, smaller, *_ = squared_stretches(chart, uv, smallest=1e-100)
    squared, dirichlet, angle, log_area = by_parts(_measures, larger, smaller)
    sign = orientation(uv, chart.triangles)
    sign[(sign == 0) & (chart.measure == 0)] = 1
    return np.sqrt(squared), angle, log_area, sign, dirichlet, squared


def _by_pieces(chart, stretch, angle, log_area, sign, dirichlet, squared):
    total = chart.sums(chart.measure)
    share = chart.measure / np.where(total > 0, total, 1)[chart.piece]
    numbers = (
        np.sqrt(chart.sums(share * squared)).tolist(),
        chart.sums(share * dirichlet).tolist(),
        chart.sums(share * angle).tolist(),
        np.sqrt(chart.sums(share * log_area**2)).tolist(),
        chart.sums((sign < 0).astype(int)).tolist(),
        chart.sums((sign == 0).astype(int)).tolist(),
    )
    ends = [*starts_of_numbers(chart.piece, chart.piece_count).tolist(), len(sign)]
    arrays = ([field[start:end] for start, end in pairwise(ends)] for field in (stretch, angle, log_area, sign))
    return [Distortion(*values) for values in zip(*numbers, *arrays, strict=True)]


class Measured(NamedTuple):
    """How any UVs distort."""

    islands: list[Distortion]
    """Of each island, by its own scale."""
    whole: Distortion
    """Of all together, as if they were one."""
    mirrored: np.ndarray
    """(k,) bool, the islands that are mirrored as a whole: their flips are counted the other way round."""
    orientation: np.ndarray
    """(m,), -1 for triangles that are flipped in their islands, 0 for collapsed ones, else 1."""
    energy: np.ndarray
    """(m,), the symmetric Dirichlet energy of every triangle, by its island's scale; ideal 1."""


def measure_corners(points: np.ndarray, uv: np.ndarray, island: np.ndarray | None = None) -> Measured:
    """How any UVs distort, valid or not, island by island.

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
    chart, size = _loose_triangles(points, np.zeros(len(uv), dtype=int) if island is None else np.asarray(island))
    mirrored = chart.sums(signed_areas(uv)) < 0
    seen = np.asfortranarray((np.where(mirrored[chart.piece, None, None], (-1, 1), 1) * uv).reshape(-1, 2))
    fields = _fields(chart, seen)
    islands = _by_pieces(chart, *fields)
    if len(islands) == 1:
        whole = islands[0]
    else:
        its = (size / size.max())[chart.piece]
        rest, measure = chart.rest * its[:, None, None], chart.measure * its**2
        one = np.zeros(len(uv), dtype=int)
        (whole,) = measure_pieces(Chart(chart.triangles, _NOBODY, _NOBODY, rest, measure, measure, one, 1), seen)
    return Measured(islands, whole, mirrored, fields[3], fields[4])


def _loose_triangles(points, island):
    """Triangles (m, 3, 3) in space as a chart that knows no neighbours: corner c of triangle t is the vertex 3 t + c.

    `island` (m,) ascends; every island is scaled so that its area is 1.  Also returns how large it was, (k,).
    """
    starts = starts_of_numbers(island, int(island[-1]) + 1)

    def sums(values):
        return np.add.reduceat(values, starts, axis=0)

    a, b, c = points.swapaxes(0, 1)
    middle = sums(a + b + c) / (3 * sums(np.ones(len(points))))[:, None]
    centred = points - middle[island, None]
    low, high = boxes_of(centred)
    extent = np.maximum(np.maximum.reduceat(high, starts), -np.minimum.reduceat(low, starts)).max(axis=1)
    size = np.where(extent > 0, extent, 1)
    area = sums(areas_of(centred)) / size**2
    there = area > _NOTHING
    size *= np.sqrt(np.where(there, area, 1))
    centred /= size[island, None, None]
    triangles = np.asfortranarray(np.arange(3 * len(points)).reshape(-1, 3))
    rest, degenerate = laid_flat(centred.reshape(-1, 3), triangles, np.sqrt(len(starts) / len(points)))
    measure = np.where(degenerate | ~there[island], 0.0, signed_areas(rest))
    return Chart(triangles, _NOBODY, _NOBODY, rest, measure, measure, island, len(starts)), size


_NOTHING = 1e-14  # of the square of its extent, the area up to which an island has none
_NOBODY = np.zeros((0, 2), dtype=int)


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
