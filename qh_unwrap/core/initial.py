# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps to begin with."""

import numpy as np

from .errors import UVError
from .pieces import starts_of
from .solver import Dirichlet
from .triangles import corners_of, normals, sums_by_parts
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
    """Projection of every piece on its least-squares plane, seen from the side that its faces turn to, (n, 2)."""

    def moments(corner):
        corners = corners_of(surface.vertices, corner.T)
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
    # Of the two ways round, the one with the farther end to the right: it turns with the surface.
    piece, starts = surface.vertex_piece, surface.vertex_starts
    along = np.einsum("ij,ij->i", surface.vertices, right[piece])
    left = np.maximum.reduceat(along, starts) < -np.minimum.reduceat(along, starts)
    right = np.where(left[:, None], -right, right)
    along = np.where(left[piece], -along, along)
    up = np.cross(across, right)
    return np.array([along, np.einsum("ij,ij->i", surface.vertices, up[piece])]).T


def conformal(surface):
    """Conformal map of every piece with a natural boundary, (n, 2): the flattening of Sawhney, Crane 2017 that scales
    no outline.

    Of all conformal maps of a disk it has the least area distortion: its scale factors exp(u) are 1 along the outline,
    u solves Yamabe's equation, and tells how much the outline turns at each vertex.  Holes are closed meanwhile, if
    there is only one piece; several must have none.
    """
    solid = surface.filled()
    outlines = surface.loops[: len(surface.vertex_starts)]
    loop = np.concatenate(outlines)
    starts = starts_of(outlines)
    n = len(solid.vertices)
    held = np.zeros(n, bool)
    held[loop] = True
    weights = cotangent(solid)
    solve = Dirichlet(solid.order, solid.edges, held, np.zeros((n, 2))).factor(weights)
    u = solve(np.zeros((n, 1)), (solid.angle_sums - 2 * np.pi)[:, None])[:, 0]
    i, j = solid.edges.T
    flux = np.bincount(i, weights[0] * (u[i] - u[j]), n) + np.bincount(j, weights[1] * (u[j] - u[i]), n)

    direction = np.cumsum(np.pi - solid.angle_sums[loop] + flux[loop])  # of the side that follows each vertex
    along = np.column_stack([np.cos(direction), np.sin(direction)])
    following = np.concatenate([np.roll(outline, -1) for outline in outlines])
    length = np.linalg.norm(surface.vertices[following] - surface.vertices[loop], axis=1)
    # Close every outline by the least change of its lengths.
    gap = np.add.reduceat(length[:, None] * along, starts)
    stiffness = np.add.reduceat(length[:, None, None] * along[:, :, None] * along[:, None], starts)
    change = (np.linalg.pinv(stiffness) @ gap[:, :, None])[solid.vertex_piece[loop], :, 0]
    length = length * (1 - (along * change).sum(axis=1))
    outline = np.zeros((n, 2))
    outline[following] = np.cumsum(length[:, None] * along, axis=0)  # closed, they end where the next one begins
    return solve(outline)[: len(surface.vertices)]
