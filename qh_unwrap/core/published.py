# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of UVs under the names and by the formulas of a published benchmark, to compare with others' numbers.

They are those of G. Shay, J. Solomon, O. Stein, *A Dataset and Benchmark for Mesh Parameterization* (2022).
docs/checking.md has the formulas.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .triangles import areas_of, by_parts, corner_angles, signed_areas


@dataclass(frozen=True)
class Published:
    """The benchmark's measures of one mesh with its UVs.

    Both areas are scaled to 1, s1 >= s2 being the stretches of a triangle then.  Triangles without area on the surface
    do not count.  What is infinite, since triangles have no area in the map, is infinite here.
    """

    max_area_distortion: float
    """The largest a/A + A/a - 2, A and a being the areas of a triangle in space and in the map; ideal 0."""
    average_area_discrepancy: float
    """The sum of |a - A|; ideal 0."""
    max_angle_distortion: float
    """The largest s1/s2 + s2/s1 - 2; ideal 0."""
    average_angle_discrepancy: float
    """The mean, by areas A, of the sums of the differences of a triangle's three angles, in radians; ideal 0."""
    min_singular_value: float
    """The smallest s2; ideal 1."""
    max_singular_value: float
    """The largest s1; ideal 1."""
    proportion_flipped: float
    """The share of triangles that lie against the others, at most a half; ideal 0."""
    resolution: float
    """The largest 1/s2 if instead the map is scaled until the longer side of its box is 1, and the surface not at all:
    as many pixels the map needs along a side for one at least along each unit of the surface."""
    symmetric_dirichlet_energy: float
    """The sum of A (s1^2 + s2^2 + s1^-2 + s2^-2) / 2; ideal 2."""

    def to_dict(self) -> dict[str, float]:
        """All of them by their names."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def published(points: np.ndarray, uv: np.ndarray) -> Published | None:
    """The benchmark's measures of triangles with the corners (m, 3, 3) in space and (m, 3, 2) in the map.

    None where all is without area in space or in the map.
    """
    return published_of_islands(points, uv, np.zeros(len(points), dtype=int), 1).of(0)


@dataclass(frozen=True, eq=False)
class PublishedMeasures:
    """The same of many islands: rows in the order of the fields of `Published`, NaN where there are none."""

    values: np.ndarray  # (9, k)

    def of(self, k: int) -> Published | None:
        """The measures of the k-th island."""
        row = self.values[:, k].tolist()
        return None if np.isnan(row[0]) else Published(*row)


def published_of_islands(points: np.ndarray, uv: np.ndarray, island: np.ndarray, count: int) -> PublishedMeasures:
    """The measures of each of `count` islands, whose numbers `island` (m,) ascend, as if it were the whole mesh."""
    points, uv = np.asarray(points, dtype=np.float64), np.asarray(uv, dtype=np.float64)
    area, in_map = areas_of(points), np.abs(signed_areas(uv))
    total, total_in_map = (np.bincount(island, each, count) for each in (area, in_map))
    there = (total > 0) & (total_in_map > 0)
    values = np.full((len(fields(Published)), count), np.nan)
    its = (area > 0) & there[island]
    if its.any():
        values[:, there] = _measures(points[its], uv[its], area[its], (np.cumsum(there) - 1)[island[its]])
    return PublishedMeasures(values)


def _measures(points, uv, area, island):
    """The rows of measures (9, k) of islands that all have some area, of triangles that all have some in space."""
    starts = np.searchsorted(island, np.arange(island[-1] + 1))
    signed = signed_areas(uv)

    def sums(values):
        return np.add.reduceat(values, starts)

    def largest(values):
        return np.maximum.reduceat(values, starts)

    def lowest(values):
        return np.minimum.reduceat(values, starts)

    total, total_in_map = sums(area), sums(np.abs(signed))
    share, share_in_map = area / total[island], np.abs(signed) / total_in_map[island]
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        larger, smaller = by_parts(_stretches, points.T, uv.T)
        width = _widths(uv, starts).max(axis=1)
        resolution = width * largest(1 / smaller)
        scale = np.sqrt(total / total_in_map)[island]
        larger, smaller = larger * scale, smaller * scale
        ratio = share_in_map / share
        aspect = np.where(smaller > 0, larger / smaller, np.inf)
        angles = np.abs(corner_angles(_flat(points.T).T) - corner_angles(uv)).sum(axis=1)
        flipped = sums((signed < 0).astype(float)) / sums(np.ones(len(signed)))
        return np.array(
            [
                largest(ratio + 1 / ratio) - 2,
                sums(np.abs(share_in_map - share)),
                largest(aspect + 1 / aspect) - 2,
                sums(share * np.where(_has_angles(uv), angles, 6 * np.pi)),
                lowest(smaller),
                largest(larger),
                np.minimum(flipped, 1 - flipped),
                resolution,
                sums(share * (larger**2 + smaller**2 + larger**-2 + smaller**-2)) / 2,
            ]
        )


def _widths(uv, starts):
    """The sizes (k, 2) of the boxes around islands' UVs (m, 3, 2)."""
    return np.maximum.reduceat(uv.max(axis=1), starts) - np.minimum.reduceat(uv.min(axis=1), starts)


def _flat(points):
    """Triangles in space, (3, 3, m), laid into the plane with their first side along its first axis, (2, 3, m)."""
    one, other = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    length = np.sqrt((one**2).sum(axis=0))
    along = (one * other).sum(axis=0) / length
    height = np.sqrt((np.cross(one, other, axis=0) ** 2).sum(axis=0)) / length
    flat = np.zeros((2, *points.shape[1:]))
    flat[0, 1], flat[0, 2], flat[1, 2] = length, along, height
    return flat


def _stretches(points, uv):
    """The larger and the smaller singular value, (m,) each, of the maps of triangles (3, 3, m) to their UVs (2, 3, m).

    They are the halves of the sum and of the difference of the lengths of two vectors, the parts of the derivative that
    turn and that mirror; the difference, which may cancel, is had from their product, the scale of the area.
    """
    flat = _flat(points)
    length, along, height = flat[0, 1], flat[0, 2], flat[1, 2]
    a, b = (uv[:, 1] - uv[:, 0]) / length
    c, d = (uv[:, 2] - uv[:, 0] - along * np.array([a, b])) / height
    larger = (np.hypot(a + d, b - c) + np.hypot(a - d, b + c)) / 2
    return larger, np.abs(a * d - b * c) / np.where(larger > 0, larger, 1)


def _has_angles(uv):
    """Which triangles (m, 3, 2) have no two corners in one place, (m,) bool: the others have no angles to compare."""
    return (uv != np.roll(uv, 1, axis=1)).any(axis=2).all(axis=1)
