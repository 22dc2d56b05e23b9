# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning maps back that are flipped all over, while what is held stays: outlines of any shape, pins.

The energy is that of Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov 2021 ("Foldover-free maps in 50 lines of
code"): finite for flipped triangles, too, the less so the less it is bent.  It is descended by Newton's steps, which
arrive after some twenty where descents along gradients are still under way after thousands.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from .certificate import wrong_pieces
from .descent import descended
from .domain import Domain
from .energy import Barrier, map_scale
from .errors import SingularError
from .stepping import PART
from .triangles import hat_gradients

_STEPS = 150  # at most
_STALLED = 1e-2  # a decrease smaller than this, relative to the energy, makes the energy less bent
_AT_ONCE = 20  # steps, after which it becomes less bent anyway
_LONG = 1.2  # steps at most, relative to Newton's own
_SHARPER = 0.7  # how bent it is then, relative to before
_LEAST_BENT = 1e-7  # relative to a triangle's area at rest, beyond which nothing else is to be expected


def untangled(
    domain: Domain, uv: np.ndarray, before: np.ndarray | None = None
) -> Generator[str, None, tuple[np.ndarray, np.ndarray]]:
    """Turn flipped triangles of the map `uv` (n, 2) back, in those pieces that have any.

    before  (n, 2), a map in which the air is as it lies at rest; by default `uv`

    A generator: yields `PART` after each step, returns the map and in which pieces (p,) bool nothing is flipped now;
    others are as they were.
    """
    start, sound = uv, ~wrong_pieces(domain.charts, uv)
    size = map_scale(domain.island, uv)
    bent = np.ones(len(sound))
    going, since = ~sound, np.zeros(len(sound), int)
    for _ in range(_STEPS):
        if not going.any():
            break
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                energy = _Bent(domain, start if before is None else before, size, bent)
                jacobian = energy.jacobian(uv)
                value = energy.value(jacobian)
                after, now, moved = descended(domain, energy, uv, jacobian, value, going)
                stalled = ~moved | ~(value - now >= _STALLED * value)
        except SingularError:
            if len(sound) > 1:  # whose fault it is comes out where each is alone
                raise
            break
        if not np.isfinite(after).all():
            break
        uv = after
        sound |= going & ~wrong_pieces(domain.charts, uv)
        since += 1
        stalled |= since > _AT_ONCE
        bent, since = np.where(stalled, bent * _SHARPER, bent), np.where(stalled, 0, since)
        going = ~sound & (bent > _LEAST_BENT)
        yield PART
    return np.where(sound[domain.vertex_piece, None], uv, start), sound


class _Bent(Barrier):
    """An energy of maps with flipped triangles, finite as much as it is `bent` (p,), relative to triangles at rest."""

    def __init__(self, domain: Domain, before: np.ndarray, size: np.ndarray, bent: np.ndarray):
        self._domain = domain
        everything = domain.triangles
        self.corners, self._single = everything.corners, len(size) == 1
        self._hats = np.empty((2, 2, self.corners.shape[1]))
        for chart, part in everything:
            if chart.is_air:
                self._hats[..., part] = hat_gradients(chart.shapes(before))
            else:
                np.divide(chart.hats, self._at(size, chart), out=self._hats[..., part])
        self._weight = np.ones(self.corners.shape[1])
        self._own = (np.broadcast_to(everything.at(bent), self._weight.shape),)
        self._void = None

    def value(self, jacobian: np.ndarray) -> np.ndarray:
        (a, b), (c, d) = jacobian
        (bent,) = self._own
        det = a * d - b * c
        with np.errstate(over="ignore"):
            value = (a * a + b * b + c * c + d * d + det * det + 1) / _bar(det, np.hypot(det, bent), bent)
        return self._domain.triangles.sums(value)

    def longest_step(self, _jacobian: np.ndarray, _change: np.ndarray) -> np.ndarray:
        # Newton's own length, and a little more, since nothing is in the way
        return np.full(self._domain.island.piece_count, _LONG)

    def gradient(self, jacobian: np.ndarray) -> tuple[np.ndarray, ...]:
        return self.derivatives(jacobian)[:2]

    def _density(self, s1, s2, bent):
        det = s1 * s2
        root = np.hypot(det, bent)
        top = s1 * s1 + s2 * s2 + det * det + 1
        top1, top2 = 2 * (s1 + det * s2) / top, 2 * (s2 + det * s1) / top
        # The bar's logarithmic derivative by the determinant is 1 / root.
        g1, g2 = top1 - s2 / root, top2 - s1 / root
        bend = det / root**3
        f11 = g1 * g1 + 2 * (1 + s2 * s2) / top - top1 * top1 + bend * s2 * s2
        f22 = g2 * g2 + 2 * (1 + s1 * s1) / top - top2 * top2 + bend * s1 * s1
        f12 = g1 * g2 + 4 * det / top - top1 * top2 + bend * det - 1 / root
        return top / _bar(det, root, bent), g1, g2, f11, f12, f22


def _bar(det, root, bent):
    """The determinant where it is large, and positive always; without cancellation where it is negative."""
    return np.where(det > 0, det + root, bent * bent / (root + np.abs(det))) / 2
