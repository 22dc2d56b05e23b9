# SPDX-License-Identifier: GPL-3.0-or-later
"""How a map distorts a surface, area-weighted on the surface and independent of the map's overall scale."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .certificate import orientation
from .chart import Surface
from .errors import UVError
from .tensor import squared_stretches
from .triangles import by_parts

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


def measure_pieces(surface: Surface, uv: np.ndarray) -> list[Distortion]:
    """The `Distortion` of every piece's map."""
    larger, smaller, *_ = squared_stretches(surface, uv, smallest=1e-100)
    share = surface.measure / surface.sums(surface.measure)[surface.piece]
    squared, dirichlet, angle, log_area = by_parts(_measures, larger, smaller)
    sign = orientation(uv, surface.triangles)
    sign[(sign == 0) & surface.degenerate] = 1
    numbers = (
        np.sqrt(surface.sums(share * squared)).tolist(),
        surface.sums(share * dirichlet).tolist(),
        surface.sums(share * angle).tolist(),
        np.sqrt(surface.sums(share * log_area**2)).tolist(),
        surface.sums((sign < 0).astype(int)).tolist(),
        surface.sums((sign == 0).astype(int)).tolist(),
    )
    arrays = (np.split(each, surface.triangle_starts[1:]) for each in (np.sqrt(squared), angle, log_area, sign))
    return [Distortion(*values) for values in zip(*numbers, *arrays, strict=True)]


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
