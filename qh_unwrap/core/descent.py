# SPDX-License-Identifier: GPL-3.0-or-later
"""From a good map to the one of least distortion: projected Newton steps on an energy that no triangle can flip in.

Air takes part, with the shape it has before a step as its rest shape (Jiang, Schaefer, Panozzo 2017), so that the
outline cannot cross itself.
"""

import numpy as np

from .domain import Domain
from .energy import Barrier

_LONGEST = 0.9  # of the step at which a triangle collapses
_ARMIJO = 1e-4  # of the decrease that the slope promises, the least that is taken
_HALVINGS = 20  # of the step, at most
_NEGLIGIBLE = 1e-3  # a decrease smaller than this, relative to the energy, is not worth another step,
_LITTLE = 1e-2  # nor is one smaller than this, relative to what the energy lies above its least possible value
_INVISIBLE = 1e-6  # a decrease of the energy that nobody could see
_SPRING = 1e-9  # that holds every vertex in its place, relative to what acts on it
_RESIDUAL = 0.03  # of Newton's equations, relative to the gradient


def newton_step(
    domain: Domain, uv: np.ndarray, balance: float, size: np.ndarray, going: np.ndarray, patience: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One step down the energy of the map `uv` (n, 2) in the pieces that are `going` (p,); the others stay.

    `size` (p,) is the scale of each piece's map that the energy aims at.  Returns the map before, maybe with new air,
    the map after, and for which pieces (p,) no further step would pay; with more `patience`, smaller gains do.  Pieces
    with flips stay and are done.
    """
    uv = domain.renewed(uv)
    energy = Barrier(domain, uv, balance, size)
    before = energy.jacobian(uv)
    start = energy.value(before)
    sound = np.isfinite(start)
    if not (sound & going).any():
        return uv, uv, np.ones(len(start), bool)
    if not sound.all():
        # Equations with flipped triangles are no equations: leave these pieces out.
        part, its_uv = domain.of(sound, uv)
        _, its_uv, its_done = newton_step(part, its_uv, balance, size[sound], going[sound], patience)
        done = np.ones(len(start), bool)
        done[sound] = its_done
        after = uv.copy()
        after[sound[domain.vertex_piece]] = its_uv
        return uv, after, done
    after, value, moved = descended(domain, energy, uv, before, start, going)
    worth = np.minimum(_NEGLIGIBLE * start, np.maximum(_LITTLE * (start - energy.least), _INVISIBLE))
    return uv, after, ~moved | (start - value < worth / patience)


def descended(
    domain: Domain, energy: Barrier, uv: np.ndarray, jacobian: np.ndarray, start: np.ndarray, going: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The map `uv` (n, 2) after Newton's step down the energy in the pieces that are `going` (p,) bool.

    `jacobian` (2, 2, m) and `start` (p,) are the map's derivative and energy.  Returns the map, the energy that it was
    last seen with, (p,), and which pieces have moved, (p,) bool.
    """
    gradient, direction = _newton_direction(domain, energy, jacobian)
    change = energy.jacobian(direction)
    length = np.where(going, np.minimum(1.0, _LONGEST * energy.longest_step(jacobian, change)), 0.0)
    piece = domain.vertex_piece
    slope = np.bincount(piece, (gradient * direction).sum(axis=1), len(start))
    for _ in range(_HALVINGS):
        value = energy.value(jacobian + domain.triangles.at(length) * change)
        steep = ~(value <= start + _ARMIJO * length * slope)
        if not steep.any():
            break
        length[steep] /= 2
    else:
        length[steep] = 0
    return uv + (length[0] if len(length) == 1 else length[piece, None]) * direction, value, length > 0


def _newton_direction(domain, energy, jacobian):
    """The gradient, zero where held, and the direction of descent, (n, 2) each."""
    n, edges = len(domain.vertex_piece), domain.triangles.edges
    corners, k = energy.corners, len(edges)
    *by_corner, mean, difference, symmetric, anti = energy.derivatives(jacobian)
    gradient = np.array([np.bincount(corners.ravel(), values.ravel(), n) for values in by_corner]).T
    gradient[domain.constrained.held] = 0
    for c, block in enumerate(anti):  # transposed where seen from the larger vertex
        np.negative(block, out=block, where=corners[c] > corners[(c + 1) % 3])
    of = domain.triangles.half_edge_edges
    beside = [np.bincount(of, part.ravel(), k) for part in (mean, difference, symmetric, anti)]
    one, other = edges.T
    # Moving all vertices together changes nothing.
    own = [-np.bincount(one, part, n) - np.bincount(other, part, n) for part in beside[:3]]
    # What hangs on the rest by nothing but folded faces without area has no equation of its own: it stays.
    own[0] = np.where(own[0] > 0, own[0] * (1 + _SPRING), 1.0)
    return gradient, domain.constrained.newton_direction(gradient, beside, own, _RESIDUAL)
