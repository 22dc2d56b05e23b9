# SPDX-License-Identifier: GPL-3.0-or-later
"""How maps are led after pins that were moved, a bit at a time if need be, so that nothing flips on the way."""

import numpy as np

from .certificate import wrong_pieces
from .domain import Domain
from .improvement import Group
from .initial import led
from .settings import Settings
from .weights import scheme

_HALVINGS = 8  # of the way, at most


def lead(group: Group, settings: Settings, together: bool) -> np.ndarray:
    """Move what is held nearer to where it is to be, and the rest with it, as far as nothing flips.

    together  whether some vertices move together; then all follow by the equations of an iteration

    Returns which pieces have arrived, (p',) bool.
    """
    domain, uv = group.domain, group.uv
    constrained, piece = domain.constrained, domain.vertex_piece
    way = way_of(group, settings, together)
    part = np.ones(len(group.pieces))
    for _ in range(_HALVINGS):
        moved = uv + part[piece, None] * way
        moved = np.where(constrained.held & (part[piece, None] == 1), constrained.values, moved)
        wrong = wrong_pieces(domain.charts, moved)
        if not wrong.any():
            break
        part[wrong] /= 2
    else:
        moved = np.where(wrong[piece, None], uv, moved)
    group.uv = moved
    return part == 1


def way_of(group: Group, settings: Settings, together: bool) -> np.ndarray:
    """How far everything goes, (n, 2), until what is held has arrived; something may well flip on the way."""
    domain, uv = group.domain, group.uv
    if not together:
        return _smooth_way(domain, uv)
    constrained = domain.constrained
    weights = domain.weights(scheme(settings)(domain.charts, uv), uv)
    return constrained.factor(weights)(np.where(constrained.held, constrained.values - uv, 0))


def _smooth_way(domain: Domain, uv: np.ndarray) -> np.ndarray:
    """How far everything goes, (n, 2), if the pins arrive; the circle around the air stays."""
    n = len(domain.island.vertices)
    pinned, values = domain.constrained.held.copy(), domain.constrained.values
    pinned[n:] = False
    way = np.zeros_like(uv)
    for k in np.unique(domain.vertex_piece[(pinned & (values != uv)).any(axis=1)]):
        its = domain.vertex_piece == k
        way[its] = led(uv[its], pinned[its], values[its]) - uv[its]
    way[n:][domain.constrained.held[n:]] = 0
    return way
