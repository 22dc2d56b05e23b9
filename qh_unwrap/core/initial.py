# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps to begin with."""

import numpy as np

from .errors import UVError
from .solver import System
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
    """Conformal map with a natural boundary, (n, 2): the spectral one of Mullen, Tong, Alliez, Desbrun 2008.

    The smallest eigenvector, beside the constant, of Dirichlet energy less area against the boundary's mass, by
    inverse iteration.
    """
    n = len(surface.vertices)
    edge = surface.half_edge_edges[surface.on_boundary]
    start, end = (ends[surface.on_boundary] for ends in surface.half_edges)
    length = np.linalg.norm(surface.vertices[end] - surface.vertices[start], axis=1)
    mass = (np.bincount(start, length, n) + np.bincount(end, length, n)) / 2
    weights = cotangent(surface)[0]
    i, j = surface.edges.T
    blocks = -weights[:, None, None] * np.eye(2)
    # The layout's area is the sum of Im(conj(z_start) z_end) / 2 over its outline.
    blocks[edge] += np.where(start < end, 0.5, -0.5)[:, None, None] * np.array([[0, -1], [1, 0]])
    diagonal = np.bincount(i, weights, n) + np.bincount(j, weights, n)
    diagonal += 1e-8 * diagonal.mean() * mass
    system = System(surface.order, surface.edges, width=2)
    solve = system.factor(blocks, blocks.swapaxes(1, 2), diagonal[:, None, None] * np.eye(2))
    flat = project(surface)
    z = flat[:, 0] + 1j * flat[:, 1]
    for _ in range(50):
        previous = z
        z = solve((mass * z).view(float)).view(complex)
        z -= (mass @ z) / mass.sum()
        z /= np.sqrt(mass @ np.abs(z) ** 2)
        if abs(np.vdot(previous * mass, z)) > 1 - 1e-10:
            break
    return np.column_stack([z.real, z.imag])
