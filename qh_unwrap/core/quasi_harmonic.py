# SPDX-License-Identifier: GPL-3.0-or-later
"""The iteration: a map gives tensors, the tensors weights, the weights a better map."""

import numpy as np

from .certificate import wrong_pieces
from .domain import Domain
from .repair import Repair
from .settings import Settings
from .weights import scheme

_REMEMBER_ABOVE = 0.375  # the balance above which the iteration oscillates if it forgets its repairs


class Iteration:
    """Improves maps of a domain step by step.

    One step takes the tensor M of the map (section 4 of the paper, eq. 7) in every triangle, discretises
    div(M grad f) = 0 (eq. 10) and solves for both coordinates.
    """

    def __init__(self, domain: Domain, settings: Settings):
        self.domain = domain
        self._next_weights = scheme(settings)
        self._repairing = settings.repair and settings.weights == "COTANGENT"
        self._divisible = settings.weights != "STRETCH"  # whose weights have a history
        self._repair = Repair(settings.balance > _REMEMBER_ABOVE, domain.island.piece_count)

    @property
    def repaired(self) -> np.ndarray:
        """(p,) bool: weights had to be changed, in some step, to turn flipped triangles back."""
        return self._repair.active

    @property
    def shortened(self) -> np.ndarray:
        """(p,) bool: in the last step the map was held back, since it would have flipped."""
        return self._repair.shortened

    @property
    def divisible(self) -> bool:
        """Whether `of` can go on with some of the pieces."""
        return self._divisible

    def step(self, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The map before, maybe with new air, and after a step, (n, 2) each, and which pieces (p,) are valid."""
        domain = self.domain
        uv = domain.renewed(uv)
        weights = domain.weights(self._next_weights(domain.charts, uv), uv)
        if self._repairing:
            return uv, *self._repair.solve(domain, weights, uv)
        after = domain.constrained.solve(weights)
        return uv, after, ~wrong_pieces(domain.charts, after)

    def of(self, pieces: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Go on with the chosen `pieces` (p,) bool alone; returns their map."""
        self._repair.of(pieces, pieces[self.domain.island.vertex_piece])
        self.domain, uv = self.domain.of(pieces, uv)
        return uv
