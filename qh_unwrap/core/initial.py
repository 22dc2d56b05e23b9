# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps to begin with."""

import numpy as np

from .errors import UVError
from .solver import Dirichlet
from .surface import corner_angles, edge_lengths
from .weights import cotangent, mean_value, uniform

_WEIGHTS = {"UNIFORM": uniform, "HARMONIC": cotangent, "MEAN_VALUE": mean_value}


def initial_map(surface, initial, dirichlet, uv=None):
    """The map `initial` (n, 2) of a surface, with the vertices that `dirichlet` holds in their places."""
    if initial in _WEIGHTS:
        return dirichlet.solve(_WEIGHTS[initial](surface))
    if initial == "CURRENT":
        if uv is None:
            raise UVError("to start from the current UVs there must be some: choose another start")
        start = uv
    else:
        start = project(surface) if initial == "PROJECTION" else conformal(surface)
    held = dirichlet.held
    return np.where(held[:, None], dirichlet.values, fit(start, held, dirichlet.values, mirror=True))


def fit(points, chosen, targets, mirror=False):
    """Move `points` (n, 2) by the similarity that brings the `chosen` nearest to their targets, or a mirrored one."""
    z, target = (xy[:, 0] + 1j * xy[:, 1] for xy in (points, targets))
    best = min(
        (_fit(candidate, chosen, target) for candidate in ((z, z.conj()) if mirror else (z,))),
        key=lambda found: found[0],
    )[1]
    return np.column_stack([best.real, best.imag])


def _fit(z, chosen, target):
    centred, wanted = z - z[chosen].mean(), target[chosen] - target[chosen].mean()
    size = np.vdot(centred[chosen], centred[chosen]).real
    turn = (np.vdot(centred[chosen], wanted) / size if size > 0 else 0) or 1.0
    fitted = turn * centred + target[chosen].mean()
    return np.linalg.norm(fitted[chosen] - target[chosen]), fitted


def project(surface):
    """Projection on the least-squares plane, seen from the side that its faces turn to, (n, 2)."""
    corners = surface.vertices[surface.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    share = np.linalg.norm(normal, axis=1) / np.linalg.norm(normal, axis=1).sum()
    corners = corners - share @ corners.mean(axis=1)
    # The second moments of a triangle are those of its corners and of three times its centre, each a twelfth.
    points = np.vstack([*corners.transpose(1, 0, 2), corners.sum(axis=1)])
    axes = np.linalg.eigh(points.T @ (np.tile(share, 4)[:, None] * points))[1]  # the least extent comes first
    across, right = axes[:, 0], axes[:, 2]
    if normal.sum(axis=0) @ across < 0:
        across = -across
    # Of the two ways round, the one with the farther end to the right: it turns with the surface.
    extent = surface.vertices @ right
    if extent.max() < -extent.min():
        right = -right
    return surface.vertices @ np.column_stack([right, np.cross(across, right)])


def conformal(surface):
    """Conformal map with a natural boundary, (n, 2): the flattening of Sawhney, Crane 2017 that scales no outline.

    Of all conformal maps of a disk it has the least area distortion: its scale factors exp(u) are 1 along the outline,
    u solves Yamabe's equation, and tells how much the outline turns at each vertex.  Holes are closed meanwhile.
    """
    solid = surface.filled()
    loop = surface.loops[0]
    n = len(solid.vertices)
    held = np.zeros(n, bool)
    held[loop] = True
    weights = cotangent(solid)
    solve = Dirichlet(solid.order, solid.edges, held, np.zeros((n, 2))).factor(weights)
    angle_sum = np.bincount(solid.triangles.ravel(), corner_angles(solid.flat).ravel(), n)
    u = solve(np.zeros((n, 1)), (angle_sum - 2 * np.pi)[:, None])[:, 0]
    i, j = solid.edges.T
    flux = np.bincount(i, weights[0] * (u[i] - u[j]), n) + np.bincount(j, weights[1] * (u[j] - u[i]), n)

    direction = np.cumsum(np.pi - angle_sum[loop] + flux[loop])  # of the side that follows each vertex
    along = np.column_stack([np.cos(direction), np.sin(direction)])
    length = edge_lengths(surface.vertices[loop])
    # Close the outline by the least change of its lengths
    length -= length * (along @ np.linalg.lstsq(along.T @ (length[:, None] * along), length @ along, rcond=None)[0])
    outline = np.zeros((n, 2))
    outline[np.roll(loop, -1)] = np.cumsum(length[:, None] * along, axis=0)
    return solve(outline)[: len(surface.vertices)]
