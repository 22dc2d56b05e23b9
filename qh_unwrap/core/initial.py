# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps to begin with."""

import numpy as np
from scipy.interpolate import RBFInterpolator

from .chart import Surface
from .domain import Held
from .triangles import corners_of, normals, sums_by_parts
from .weights import cotangent, mean_value, uniform

_SAMPLE = 1000  # points that lead the others, at most
_WEIGHTS = {"UNIFORM": uniform, "HARMONIC": cotangent, "MEAN_VALUE": mean_value}


def weighted_map(domain: Held, initial: str) -> np.ndarray:
    """The map (n, 2) of a domain by the fixed weights that `initial` names, with what is held in its place."""
    make = _WEIGHTS[initial]
    return domain.constrained.solve(domain.triangles.joined([make(chart) for chart in domain.charts]))


def fit(points: np.ndarray, chosen: np.ndarray, targets: np.ndarray, mirror: bool = False) -> np.ndarray:
    """The points (n, 2) moved by the similarity that brings the `chosen` ones, (n,) bool, nearest to `targets` (n, 2).

    With `mirror` it may be a mirrored similarity, if that brings them nearer.
    """
    z, target = (xy[:, 0] + 1j * xy[:, 1] for xy in (points, targets))
    best = min(
        (_fit(candidate, chosen, target) for candidate in ((z, z.conj()) if mirror else (z,))),
        key=lambda found: found[0],
    )[1]
    return np.column_stack([best.real, best.imag])


def _fit(z, chosen, target):
    """How far the chosen points stay from their targets, and all points moved; points are complex numbers (n,)."""
    centred, wanted = z - z[chosen].mean(), target[chosen] - target[chosen].mean()
    size = np.vdot(centred[chosen], centred[chosen]).real
    factor = (np.vdot(centred[chosen], wanted) / size if size > 0 else 0) or 1.0  # it rotates and scales
    fitted = factor * centred + target[chosen].mean()
    return np.linalg.norm(fitted[chosen] - target[chosen]), fitted


def led(points: np.ndarray, held: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The points (n, 2) after their `held` coordinates, (n, 2) bool, went to `values` (n, 2), and the others with them.

    They follow smoothly wherever they lie in between, so that what is mapped one to one mostly stays so.
    """
    result = np.where(held, values, points)
    for axis in range(2):
        rows = np.flatnonzero(held[:, axis])
        rows = rows[:: -(-len(rows) // _SAMPLE) or 1]
        _, first = np.unique(points[rows], axis=0, return_index=True)
        rows = rows[np.sort(first)]
        offsets = values[rows, axis] - points[rows, axis]
        if offsets.any():
            try:
                follow = RBFInterpolator(points[rows], offsets, kernel="linear", degree=0)
            except np.linalg.LinAlgError:  # where points lie too close together
                continue
            free = ~held[:, axis]
            result[free, axis] += follow(points[free])
    return result


def project(surface: Surface) -> np.ndarray:
    """The projection of every piece on its least-squares plane, seen from the side that its faces look to, (n, 2)."""
    points = np.asfortranarray(surface.vertices)

    def moments(corner_vertex):
        corners = corners_of(points, corner_vertex.T)
        normal = normals(corners).T
        share = np.linalg.norm(normal, axis=0)
        # The second moments of a triangle are those of its corners and of three times its centre, each a twelfth.
        x, y, z = (np.vstack([along, along.sum(axis=0)]) for along in corners.T)
        pairs = (x, x), (x, y), (x, z), (y, y), (y, z), (z, z)
        second = [share * (one * other).sum(axis=0) / 12 for one, other in pairs]
        return np.array([*normal, share, *(share * along[3] / 3 for along in (x, y, z)), *second])

    total = sums_by_parts(moments, surface.triangle_starts, surface.triangles.T)
    normal, middle, second = total[:3], total[4:7] / total[3], total[7:] / total[3]
    xx, xy, xz, yy, yz, zz = second - middle[[0, 0, 0, 1, 1, 2]] * middle[[0, 1, 2, 1, 2, 2]]
    axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).T)[1]
    across, right = axes[:, :, 0], axes[:, :, 2]  # the least and the most extent
    back = (normal.T * across).sum(axis=1) < 0
    across = np.where(back[:, None], -across, across)
    # Of the two ways round, take that with the farther end to the right: a rotated surface has the same map.
    piece, starts = surface.vertex_piece, surface.vertex_starts
    along = np.einsum("ij,ij->i", surface.vertices, right[piece])
    left = np.maximum.reduceat(along, starts) < -np.minimum.reduceat(along, starts)
    right = np.where(left[:, None], -right, right)
    along = np.where(left[piece], -along, along)
    up = np.cross(across, right)
    return np.array([along, np.einsum("ij,ij->i", surface.vertices, up[piece])]).T
