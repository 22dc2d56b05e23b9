# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures of UVs under the names and by the formulas of a published benchmark, to compare with others' numbers.

They are those of G. Shay, J. Solomon, O. Stein, *A Dataset and Benchmark for Mesh Parameterization* (2022).
docs/checking.md has the formulas.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from .pieces import starts_of_numbers
from .triangles import areas_of, boxes_of, by_parts, corner_angles, signed_areas


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
    return published_of_islands(points, uv, np.zeros(len(points), dtype=int), 1).whole


@dataclass(frozen=True, eq=False)
class PublishedMeasures:
    """The same of many islands, and of all of them together."""

    whole: Published | None
    values: np.ndarray  # (9, k), rows in the order of the fields of `Published`, NaN where there are none

    def of(self, k: int) -> Published | None:
        """The measures of the k-th island, as if it were the whole mesh."""
        return _published(self.values[:, k])


def published_of_islands(points: np.ndarray, uv: np.ndarray, island: np.ndarray, count: int) -> PublishedMeasures:
    """The measures of each of `count` islands, whose numbers `island` (m,) ascend, and of all together."""
    points, uv = np.asarray(points, dtype=np.float64), np.asarray(uv, dtype=np.float64)
    its = areas_of(points) > 0
    if not its.all():
        points, uv, island = points[its], uv[its], island[its]
    fields_ = _Fields.of(points, uv)
    values = fields_.measures(island, count)
    whole = values if count == 1 else fields_.measures(np.zeros(len(uv), dtype=int), 1)
    return PublishedMeasures(_published(whole[:, 0]), values)


def _published(row):
    return None if np.isnan(row[0]) else Published(*row.tolist())


class _Fields(NamedTuple):
    """What there is to know of every triangle with some area in space, (m,) each."""

    area: np.ndarray
    signed: np.ndarray  # its area in the map
    larger: np.ndarray  # singular values
    smaller: np.ndarray
    angles: np.ndarray  # the sum of the differences of its angles
    low: np.ndarray  # (m, 2) its box in the map
    high: np.ndarray  # (m, 2)

    @classmethod
    def of(cls, points: np.ndarray, uv: np.ndarray) -> _Fields:
        """Those of triangles with these corners."""
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            larger, smaller, angles = by_parts(_compared, points.T, uv.T)
        return cls(areas_of(points), signed_areas(uv), larger, smaller, angles, *boxes_of(uv))

    def measures(self, island, count):
        """The measures (9, count) of islands, NaN where one has no area in space or in the map."""
        total, total_in_map = (np.bincount(island, each, count) for each in (self.area, np.abs(self.signed)))
        there = (total > 0) & (total_in_map > 0)
        values = np.full((len(fields(Published)), count), np.nan)
        if there.all():
            values[:] = self._measures(island, total, total_in_map)
        elif there.any():
            its = there[island]
            left = _Fields(*(each[its] for each in self))
            values[:, there] = left._measures((np.cumsum(there) - 1)[island[its]], total[there], total_in_map[there])
        return values

    def _measures(self, island, total, total_in_map):
        """The same where all islands have some area."""
        starts = starts_of_numbers(island, len(total))

        def sums(values):
            return np.add.reduceat(values, starts)

        def largest(values):
            return np.maximum.reduceat(values, starts)

        def lowest(values):
            return np.minimum.reduceat(values, starts)

        share, share_in_map = self.area / total[island], np.abs(self.signed) / total_in_map[island]
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            width = np.max(largest(self.high) - lowest(self.low), axis=1)
            scale = np.sqrt(total / total_in_map)[island]
            larger, smaller = self.larger * scale, self.smaller * scale
            ratio = share_in_map / share
            aspect = np.where(smaller > 0, larger / smaller, np.inf)
            flipped = sums((self.signed < 0).astype(float)) / sums(np.ones(len(island)))
            return np.array(
                [
                    largest(ratio + 1 / ratio) - 2,
                    sums(np.abs(share_in_map - share)),
                    largest(aspect + 1 / aspect) - 2,
                    sums(share * self.angles),
                    lowest(smaller),
                    largest(larger),
                    np.minimum(flipped, 1 - flipped),
                    width * largest(1 / self.smaller),
                    sums(share * (larger**2 + smaller**2 + larger**-2 + smaller**-2)) / 2,
                ]
            )


def _compared(points, uv):
    """The singular values of the maps of triangles (3, 3, m) to their UVs (2, 3, m), and the sums of the differences of
    their angles, (m,) each."""
    flat = _flat(points)
    same = (uv == np.roll(uv, 1, axis=1)).all(axis=0).any(axis=0)  # two corners in one place: no angles to compare
    angles = np.abs(corner_angles(flat.T) - corner_angles(uv.T)).sum(axis=1)
    return *_stretches(flat, uv), np.where(same, 6 * np.pi, angles)


def _flat(points):
    """Triangles in space, (3, 3, m), laid into the plane with their first side along its first axis, (2, 3, m)."""
    one, other = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    length = np.sqrt((one**2).sum(axis=0))
    along = (one * other).sum(axis=0) / length
    height = np.sqrt((np.cross(one, other, axis=0) ** 2).sum(axis=0)) / length
    flat = np.zeros((2, *points.shape[1:]))
    flat[0, 1], flat[0, 2], flat[1, 2] = length, along, height
    return flat


def _stretches(flat, uv):
    """The larger and the smaller singular value, (m,) each, of the maps of triangles (2, 3, m) to their UVs (2, 3, m).

    The triangles are laid into the plane.  The values are the halves of the sum and of the difference of the lengths of
    two vectors, the parts of the derivative that turn and that mirror; the difference, which may cancel, is had from
    their product, the scale of the area.
    """
    length, along, height = flat[0, 1], flat[0, 2], flat[1, 2]
    a, b = (uv[:, 1] - uv[:, 0]) / length
    c, d = (uv[:, 2] - uv[:, 0] - along * np.array([a, b])) / height
    larger = (np.hypot(a + d, b - c) + np.hypot(a - d, b + c)) / 2
    return larger, np.abs(a * d - b * c) / np.where(larger > 0, larger, 1)
