# SPDX-License-Identifier: GPL-3.0-or-later
"""From a good map to the one of least distortion: projected Newton steps on an energy that no triangle can flip in.

Air takes part, with the shape it has before a step as its rest shape (Jiang, Schaefer, Panozzo 2017), so that the
outline cannot cross itself.  It has its part in Newton's equations, but none in the energy that tells how long a step
may be: it will be at rest where the step leads.
"""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np

from .domain import Domain
from .energy import Barrier, map_scale
from .stepping import PART

_LONGEST = 0.9  # of the step at which a triangle collapses,
_FARTHEST = 0.75  # or where all that it leaves is still far from the end
_ARMIJO = 1e-4  # of the decrease that the slope promises, the least that is taken
_HALVINGS = 20  # of the step, at most
_PROMISING = 0.6  # of what the slope promises: a decrease by more is worth a longer step
_LONGER = 1.5  # times as long
_LENGTHENINGS = 12  # of the step, at most: what has all but collapsed opens in few
_NEGLIGIBLE = 1e-3  # a decrease smaller than this, relative to the energy, is not worth another step,
_LITTLE = 2e-2  # nor is one smaller than this, relative to what the energy lies above its least possible value
_INVISIBLE = 1e-6  # a decrease of the energy that nobody could see
_ROOMY = 4  # times Newton's own step may be until a triangle collapses: then it is short,
_TRUE = 0.2  # of what it promises, by which it may miss that and keep its promise
_LEFT = 0.5  # of a decrease that is worth a step: less is left to old equations
_CUT = 0.8  # of Newton's own step: one that ends before is cut short
_SPRING = 1e-9  # that holds every vertex in its place, relative to what acts on it
_ROUGH = 0.1  # residual of the equations, relative to the gradient, on the way and of old equations,
_FINE = 0.05  # after a step that has brought less than
_MUCH = 0.15  # of what the energy lies above its least possible value,
_SHARP = 0.01  # and where few triangles rule the gradient, so that the others go where they should not:
_SHORT = 0.5  # after a step that one that all but collapses has made shorter than this,
_EXTREME = 20  # or above so many times the least possible energy


class Descent:
    """Steps down the energy of maps, in every piece of a domain on its own way.

    Parameters
    ----------
    balance : as in `Settings`
    size : (p,), the scale of each piece's map that the energy aims at
    patience : how much smaller gains than usual are worth a step
    rigidly : whether to begin by laying triangles out as they are, as far as they let one another
    """

    def __init__(self, balance: float, size: np.ndarray, patience: float = 1.0, rigidly: bool = False):
        self._balance, self._size, self._patience, self._rigidly = balance, size, patience, rigidly
        self._energy: Barrier | None = None
        self._residual = np.full(len(size), _ROUGH)
        self._drop = np.full(len(size), np.inf)  # of the energy in the last step,
        self._little = np.zeros(len(size), bool)  # whether that brought little,
        self._hindered = np.ones(len(size), bool)  # and whether it was cut short

    def of(self, pieces: np.ndarray) -> Descent:
        """The same of the chosen pieces (p,) bool alone."""
        part = Descent(self._balance, self._size[pieces], self._patience, self._rigidly)
        part._residual, part._little = self._residual[pieces], self._little[pieces]
        part._hindered, part._drop = self._hindered[pieces], self._drop[pieces]
        return part

    def step(
        self, domain: Domain, uv: np.ndarray, going: np.ndarray
    ) -> Generator[str, None, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """One step from the map `uv` (n, 2) in the pieces that are `going` (p,); the others stay.

        Returns the map before, maybe with new air, the map after, and for which pieces (p,) no further step would pay.
        Pieces with flips stay and are done.  Yields `PART` now and then.
        """
        uv = domain.renewed(uv, self._hindered)
        energy = self._energy_of(domain, uv)
        before, start = energy.resting, energy.resting_value
        sound = np.isfinite(start)
        if not (sound & going).any():
            return uv, uv, np.ones(len(start), bool)
        if not sound.all():
            some = yield from self._step_of_some(domain, uv, going, sound)
            return uv, *some
        if self._rigidly:
            yield PART
            after = _laid_out(domain, energy, uv, before, start, going)
            self._rigidly, self._energy, self._size = False, None, map_scale(domain.island, after)
            return uv, after, np.zeros(len(start), bool)
        gradient, beside, own = _newton_equations(domain, energy, before)
        yield PART
        # What begins near the least possible value has little to gain from the first step on.
        near = np.isinf(self._drop) & (start - energy.least < _MUCH * energy.least)
        residual = np.where(near, np.minimum(self._residual, _FINE), self._residual)
        direction = domain.constrained.newton_direction(gradient, beside, own, residual)
        yield PART
        after, value, moved, slope, limit = _moved(domain, energy, uv, before, start, going, gradient, direction)
        hard = (limit < _SHORT) | (value > _EXTREME * energy.least)
        much = start - value >= _MUCH * (start - energy.least)
        self._residual = np.where(hard, _SHARP, np.where(much, _ROUGH, _FINE))
        self._hindered = going & (limit < _CUT)
        done, nearly = self._ends(energy, start, value, -slope / 2, limit)
        if nearly.any():
            yield PART
            after = _polished(domain, energy, after, nearly)
        return uv, after, ~moved | done | nearly

    def _ends(self, energy, start, value, promised, limit):
        """Which pieces (p,) bool are done after a step that brought their energies from `start` to `value`, and for
        which its equations will do once more to end.

        promised  (p,), by how much these would have lowered the energy
        limit     (p,), the longest step that was looked at
        """
        worth = np.minimum(_NEGLIGIBLE * start, np.maximum(_LITTLE * (start - energy.least), _INVISIBLE))
        # What promised more gets another step, if it was cut short or air may have been in its way.
        hindered = ((limit < 1) | energy.in_air) & (promised > worth) & ~self._little
        drop, worth = start - value, worth / self._patience
        little = drop < worth
        # A step that has brought what it promised is followed by one that brings far less; but air gives way a bit more
        # in every step.
        surprise, trend = np.abs(drop - promised), drop * (drop / self._drop)
        true = ~energy.in_air & (limit > _ROOMY) & (surprise < _TRUE * promised)
        nearly = true & ~little & (np.maximum(surprise, trend) < _LEFT * worth)
        self._little, self._drop = little, np.maximum(drop, np.finfo(float).tiny)
        return little & ~hindered, nearly

    def _energy_of(self, domain, uv):
        """The energy with its air as in `uv`; what does not depend on that serves on."""
        if self._energy is None or self._energy.triangles is not domain.triangles:
            self._energy = Barrier(domain, uv, self._balance, self._size)
        else:
            self._energy.rest(uv)
        return self._energy

    def _step_of_some(self, domain, uv, going, sound):
        """The map after a step of the `sound` pieces alone, and which are done: equations of flipped triangles are no
        equations."""
        part, its_uv = domain.of(sound, uv)
        descent = self.of(sound)
        _, its_uv, its_done = yield from descent.step(part, its_uv, going[sound])
        self._residual[sound], self._little[sound] = descent._residual, descent._little
        self._hindered[sound], self._size[sound] = descent._hindered, descent._size
        self._drop[sound] = descent._drop
        self._rigidly = descent._rigidly
        done = np.ones(len(sound), bool)
        done[sound] = its_done
        after = uv.copy()
        after[sound[domain.vertex_piece]] = its_uv
        return after, done


def descended(
    domain: Domain, energy: Barrier, uv: np.ndarray, jacobian: np.ndarray, start: np.ndarray, going: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The map `uv` (n, 2) after one step down any energy in the pieces that are `going` (p,) bool.

    `jacobian` (2, 2, m) and `start` (p,) are the map's derivative and energy.  Returns the map, the energy of every
    piece, (p,), and which have moved, (p,) bool.
    """
    gradient, beside, own = _newton_equations(domain, energy, jacobian)
    direction = domain.constrained.newton_direction(gradient, beside, own, _FINE)
    return _moved(domain, energy, uv, jacobian, start, going, gradient, direction)[:3]


def _laid_out(domain, energy, uv, jacobian, start, going):
    """The map after all triangles are laid out in their shapes at rest, turned as they are, and joined with the least
    change (the local and the global step of Liu et al. 2008), or as far on the way there as the energy falls.

    From a conformal map it leads most of the way to the best, for the price of its start.
    """
    *by_corner, stiffness = energy.pull(jacobian)
    gradient = _gathered(energy.corners, by_corner, len(uv))
    triangles = domain.triangles
    beside = np.bincount(triangles.half_edge_edges, stiffness.ravel(), len(triangles.edges))
    (own,) = _own([beside], triangles.edges, len(uv))
    direction = domain.constrained.direction(gradient, beside, own)
    return _moved(domain, energy, uv, jacobian, start, going, np.zeros_like(uv), direction, longest=_FARTHEST)[0]


def _polished(domain, energy, uv, going):
    """The map after another step with the last one's Hessian, in the pieces that are `going` (p,) bool."""
    jacobian = energy.jacobian(uv)
    start = energy.value(jacobian)
    gradient = _gradient(domain, energy, energy.gradient(jacobian))
    gradient[~going[domain.vertex_piece]] = 0
    direction = domain.constrained.next_direction(gradient, _ROUGH)
    return _moved(domain, energy, uv, jacobian, start, going, gradient, direction)[0]


def _gradient(domain, energy, by_corner):
    """The gradient (n, 2) of what the triangles have `by_corner`, zero where held."""
    gradient = _gathered(energy.corners, by_corner, len(domain.vertex_piece))
    gradient[domain.constrained.held] = 0
    return gradient


def _gathered(corners, by_corner, n):
    """Vectors at the vertices, (n, 2), that sum up those of the triangles' corners, (3, m) each."""
    return np.array([np.bincount(corners.ravel(), values.ravel(), n) for values in by_corner]).T


def _moved(domain, energy, uv, jacobian, start, going, gradient, direction, longest=_LONGEST):
    """The map after a step of the right length, the energy of every piece, which have moved, and the slope of the
    energy and the longest step that were looked at, (p,) each."""
    change = energy.jacobian(direction)
    piece = domain.vertex_piece
    slope = np.bincount(piece, np.einsum("nc,nc->n", gradient, direction), len(start))
    limit = np.where(going, longest * energy.longest_step(jacobian, change), 0.0)
    length, value = _search(
        lambda length: energy.value(jacobian + domain.triangles.at(length) * change), start, slope, limit
    )
    after = uv + (length[0] if len(length) == 1 else length[piece, None]) * direction
    return after, value, length > 0, slope, limit


def _search(
    energy_at: Callable[[np.ndarray], np.ndarray], start: np.ndarray, slope: np.ndarray, limit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The length of every piece's step, (p,), not above its `limit`, and the energy there, which is `start` before it.

    Newton's own length is 1.  It is halved until the energy falls.  Where that falls by more than the `slope` promises,
    as it does far from the end, the step becomes longer as long as that pays.
    """
    length = np.minimum(1.0, limit)
    value = energy_at(length)
    for _ in range(_HALVINGS):
        steep = ~(value <= start + _ARMIJO * length * slope)
        if not steep.any():
            break
        length[steep] /= 2
        value = energy_at(length)
    else:
        steep = ~(value <= start + _ARMIJO * length * slope)
        length[steep], value[steep] = 0, start[steep]
    growing = start - value > -_PROMISING * length * slope
    for _ in range(_LENGTHENINGS):
        longer = np.where(growing, np.minimum(_LONGER * length, limit), length)
        growing = longer > length
        if not growing.any():
            break
        its = energy_at(longer)
        growing &= its < value
        length, value = np.where(growing, longer, length), np.where(growing, its, value)
    return length, value


def _newton_equations(domain, energy, jacobian):
    """The gradient (n, 2), zero where held, and the Hessian as `Constrained.newton_direction` takes it."""
    n, edges = len(domain.vertex_piece), domain.triangles.edges
    corners, k = energy.corners, len(edges)
    *by_corner, mean, difference, symmetric, anti = energy.derivatives(jacobian)
    gradient = _gradient(domain, energy, by_corner)
    for c, block in enumerate(anti):  # transposed where seen from the larger vertex
        np.negative(block, out=block, where=corners[c] > corners[(c + 1) % 3])
    of = domain.triangles.half_edge_edges
    beside = [np.bincount(of, part.ravel(), k) for part in (mean, difference, symmetric, anti)]
    return gradient, beside, _own(beside[:3], edges, n)


def _own(beside, edges, n):
    """What the Hessian has at the vertices, (n,) each, where it has `beside` at the edges (k, 2)."""
    one, other = edges.T
    # Moving all vertices together changes nothing.
    own = [-np.bincount(one, part, n) - np.bincount(other, part, n) for part in beside]
    # What hangs on the rest by nothing but folded faces without area has no equation of its own: it stays.
    own[0] = np.where(own[0] > 0, own[0] * (1 + _SPRING), 1.0)
    return own
