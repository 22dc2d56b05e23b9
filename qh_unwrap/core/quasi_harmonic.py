# SPDX-License-Identifier: GPL-3.0-or-later
"""The iteration: a map gives tensors, the tensors weights, the weights a better map."""

from dataclasses import dataclass, field

import numpy as np

from .errors import SettingsError
from .tensor import area_scale, jacobian
from .triangles import box
from .validity import Repair, invalid
from .weights import scheme

_REMEMBER_ABOVE = 0.375  # the balance above which forgotten repairs make the iteration oscillate


@dataclass(frozen=True, eq=False)
class State:
    """The map after an iteration."""

    iteration: int
    """0 for the initial map."""
    uv: np.ndarray = field(repr=False)
    """(n, 2)"""
    change: float
    """The largest movement of a vertex by the layout's diameter; infinite for the initial map."""
    valid: bool
    """No triangle is flipped or collapsed in 32-bit floats."""
    converged: bool
    """No vertex moved by more than the tolerance, and none was held back."""
    repaired: bool
    """Weights had to be changed, in this iteration or an earlier one, to turn flipped triangles back."""


class Held:
    """A domain whose outline is held: nothing but the system that `dirichlet` solves on `surface`."""

    def __init__(self, surface, dirichlet):
        self.surface = surface
        self.dirichlet = dirichlet

    def renewed(self, uv):
        return uv

    def recalled(self, uv, _n):
        return uv

    def balanced(self, _uv, tensor):
        return tensor


def iterate(domain, settings, uv, n):
    """Improve the map `uv`, of which the surface's n vertices count; yields a `State` for it and after every iteration,
    ends when converged.

    One iteration takes the tensor M of the map (section 4 of the paper, eq. 7) in every triangle, discretises
    div(M grad f) = 0 (eq. 10) and solves for both coordinates.  `domain` is `Held` or an `Exterior`, and knows
    the other vertices.
    """
    next_weights = scheme(settings)
    repair = Repair(remember=settings.balance > _REMEMBER_ABOVE)
    repairing = settings.repair and settings.weights == "COTANGENT"
    change = np.inf
    yield State(0, uv, change, not invalid(domain.surface, uv).any(), False, False)
    for iteration in range(1, settings.iterations + 1):
        if change <= settings.tolerance:
            return
        previous = uv = domain.renewed(uv)
        weights = next_weights(domain, uv)
        if repairing:
            uv, valid = repair.solve(domain, weights, uv)
        else:
            uv = domain.dirichlet.solve(weights)
            valid = not invalid(domain.surface, uv).any()
        change = movement(previous[:n], uv[:n])
        converged = change <= settings.tolerance and not repair.shortened
        yield State(iteration, uv, change, valid, converged, repair.active)


def check_settings(settings):
    """Raise `SettingsError` where the weights cannot be used with the balance or the boundary."""
    if settings.weights == "MEAN_VALUE" and settings.balance > 0.5:
        raise SettingsError(
            "mean value weights diverge for a balance above 0.5: lower it, or use the weights COTANGENT"
        )
    if settings.weights == "MEAN_VALUE_SCALAR" and settings.balance == 1:
        raise SettingsError(
            "area-only weights change nothing at balance 1: lower it, or take the start MEAN_VALUE with 0 iterations"
        )
    if settings.boundary == "FREE" and settings.weights != "COTANGENT":
        raise SettingsError(
            f"a free boundary needs the weights COTANGENT, not {settings.weights}: change them, or choose the boundary"
            " CIRCLE"
        )


def movement(before, after):
    """The largest movement of a vertex by the diagonal of the box around the map `after` (n, 2)."""
    x, y = (after - before).T
    diagonal = max(np.linalg.norm(box(after)[1]), np.finfo(float).tiny)
    return float(np.sqrt((x * x + y * y).max()) / diagonal)


def exponents(balance):
    """p and r of the energy, the mean of `a^p b^r`, whose minimum the iteration at this balance comes near.

    `a = (s1/s2 + s2/s1) / 2` measures the angles, `b = (s1 s2 + 1 / (s1 s2)) / 2` the areas of a triangle with the
    stretches s1 and s2; p = r = 1 (balance 0.25) is the symmetric Dirichlet energy.
    """
    return float(np.clip(4 * balance, 0.05, 1)), min(1.0, 4 / 3 * (1 - balance)) ** 3


def density(squares, det, balance):
    """`a^p b^r` of triangles with the sum of squared stretches `squares` and the product `det`, (m,)."""
    p, r = exponents(balance)
    return (squares / (2 * det)) ** p * ((det + 1 / det) / 2) ** r


def energy(surface, uv, balance):
    """The mean of `a^p b^r` over the surface, at equal areas of surface and layout."""
    G = jacobian(surface, uv)
    scale = area_scale(surface, G)
    (a, b), (c, d) = G
    det = np.maximum(np.abs(a * d - b * c) / scale, 1e-100)
    share = np.where(surface.air | surface.degenerate, 0, surface.area)
    return float(share @ density((a * a + b * b + c * c + d * d) / scale, det, balance) / share.sum())
