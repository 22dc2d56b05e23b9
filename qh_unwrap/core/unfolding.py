# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning the last triangles over: those that rounding flips, and faces without area, which lie anyhow.

Around every such triangle the vertices descend an energy that is finite for flipped triangles, too, and high: it
presses them open (Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov 2021, "Foldover-free maps in 50 lines of
code").  Whatever lies farther away stays where it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from .air import Triangulator, make_air
from .certificate import certified_pieces, orientation
from .chart import Surface
from .energy import map_scale
from .tensor import jacobian_of
from .triangles import corners_of, hat_gradients, laid_flat, signed_areas

_RINGS = (1, 3, 8)  # of triangles that give way
_ROOM = 1e-6  # height of a triangle, relative to the piece's extent, that survives rounding
_THICKER = 2  # than the height that survives, to reach that
_BENT = (1e-1, 1e-2, 1e-3)  # how far the energy is bent to be finite, relative to a triangle's area at rest
_MOST = 500  # flipped triangles with area of a piece, above which it would take too long
_STEPS = 100  # of the descent, at most


def unfolded(surface: Surface, uv: np.ndarray, held: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """The map `uv` (n, 2) with its flipped triangles turned over, those without area in space included, and in which
    pieces (p,) that was needed and could be had.

    held  (n, 2) bool, the coordinates that stay
    most  the part of a piece's area that its flipped triangles may have, for this to be tried

    Outlines give way, too, where the map is certified afterwards; elsewhere they stay.
    """
    flipped = _flipped(surface, uv)
    done = np.zeros(surface.piece_count, bool)
    if not flipped.any():
        return uv, done
    tried = surface.sums(np.where(flipped, surface.measure, 0)) <= most * surface.sums(surface.measure)
    tried &= surface.sums((flipped & ~surface.degenerate).astype(int)) <= _MOST
    tried &= surface.sums(flipped.astype(int)) > 0
    if not tried.any():
        return uv, done
    outline = np.zeros((len(uv), 1), bool)
    outline[np.concatenate(surface.loops)] = True
    net = _Net(surface.triangles, surface.rest * map_scale(surface, uv)[surface.piece, None, None], surface.piece)
    room = _room(surface, uv)
    for holding in (held, held | outline):
        opened = uv
        for rings in _RINGS:
            wrong = _flipped(surface, opened) & tried[surface.piece]
            if not wrong.any():
                break
            opened = _opened(net, opened, holding, wrong, rings, room)
        sound = tried & (surface.sums(_flipped(surface, opened).astype(int)) == 0)
        moved = (opened != uv) & outline
        moved_pieces = sound & (surface.vertex_sums(moved.any(axis=1).astype(int)) > 0)
        if moved_pieces.any():
            rows = moved_pieces[surface.vertex_piece]
            sound[moved_pieces] = certified_pieces(surface.of(moved_pieces), opened[rows])
        uv = np.where(sound[surface.vertex_piece, None], opened, uv)
        done |= sound
        tried &= ~sound
        if not tried.any():
            break
    return uv, done


def unfolded_in_air(
    surface: Surface, uv: np.ndarray, held: np.ndarray, triangulate: Triangulator
) -> tuple[np.ndarray, bool]:
    """The map `uv` (n, 2) of one piece, which is valid but for rounding where it lies, with its outline so far from
    itself, and its triangles so far from flipping, that it is certified there; and whether that could be had.

    held  (n, 2) bool, the coordinates that stay
    """
    (low,), (size,) = surface.boxes(uv)
    size = size.max()
    air = make_air((uv - low) / size, surface.loops, triangulate) if size > 0 else None
    if air is None:
        return uv, False
    everything = np.vstack([uv, low + size * air.points])
    fixed = np.vstack([held, np.repeat(air.on_circle[:, None], 2, axis=1)])
    flat, _ = laid_flat(np.pad(everything, ((0, 0), (0, 1))), air.triangles, _room(surface, uv)[0])
    rest = np.concatenate([surface.rest * map_scale(surface, uv)[0], flat])
    triangles = np.concatenate([surface.triangles, air.triangles])
    net = _Net(triangles, rest, np.zeros(len(triangles), int))
    for rings in _RINGS:
        in_island, in_air = _flipped(surface, everything[: len(uv)]), orientation(everything, air.triangles) <= 0
        wrong = np.concatenate([in_island, in_air])
        if not wrong.any():
            break
        everything = _opened(net, everything, fixed, wrong, rings, _room(surface, uv))
    opened = everything[: len(uv)]
    return opened, bool(certified_pieces(surface, opened)[0])


class _Net(NamedTuple):
    """Triangles (m, 3), their corners in the shapes that they are to come near to, (m, 3, 2), and their pieces (m,)."""

    triangles: np.ndarray
    rest: np.ndarray
    piece: np.ndarray


def _room(surface, uv):
    """The height of a triangle that survives rounding, in every piece, (p,)."""
    low, size = surface.boxes(uv)
    farthest = np.maximum(np.abs(low), np.abs(low + size)).max(axis=1)
    return np.maximum(_ROOM * size.max(axis=1), 2 * np.finfo(np.float32).eps * farthest)


def _flipped(surface, uv):
    """The triangles that are flipped, or collapsed though they have area in space, (m,) bool."""
    sign = orientation(uv, surface.triangles)
    return (sign < 0) | ((sign == 0) & ~surface.degenerate)


def _opened(net, uv, held, wrong, rings, room):
    """The map after a descent of the vertices of the `wrong` triangles (m,) bool, and of those on some rings around."""
    moving = np.zeros(len(uv), bool)
    moving[net.triangles[wrong]] = True
    for _ in range(rings - 1):
        moving[net.triangles[moving[net.triangles].any(axis=1)]] = True
    patch = np.flatnonzero(moving[net.triangles].any(axis=1))
    piece = net.piece[patch]
    uv = uv.copy()
    for k in np.unique(piece):  # each by itself, so that the others make no difference
        its = patch[piece == k]
        vertices, corners = np.unique(net.triangles[its].T, return_inverse=True)
        corners = corners.reshape(3, -1)
        free = moving[vertices, None] & ~held[vertices]
        if free.any():
            before = _heights(uv[vertices], corners)
            needed = np.where(wrong[its] | (before <= 0), room[k], np.minimum(before / 2, room[k]))
            hats = hat_gradients(net.rest[its])
            # What is too thin to survive is to become thicker than it is at rest, where its base lies along the x-axis.
            height = net.rest[its, :, 1].max(axis=1)
            hats[:, 1, wrong[its]] *= np.minimum(height / (_THICKER * needed), 1)[wrong[its]]
            uv[vertices] = _descended(uv[vertices], corners, hats, free, needed)
    return uv


def _descended(uv, corners, hats, free, needed):
    """The map (n, 2) of triangles with the `corners` (3, m) after the descent of the `free` coordinates (n, 2) bool,
    which ends once all triangles have the `needed` heights (m,)."""
    moved, x = uv.copy(), uv[free]

    def at(x):
        moved[free] = x
        return moved

    def is_open(x):
        return (_heights(at(x), corners) >= needed).all()

    def stop_if_open(intermediate_result):
        if is_open(intermediate_result.x):
            raise StopIteration

    left = len(needed) + 1
    for bent in _BENT:
        x = minimize(
            lambda x, bent=bent: _energy(at(x), corners, hats, bent, free),
            x,
            jac=True,
            method="L-BFGS-B",
            callback=stop_if_open,
            options=dict(maxiter=_STEPS),
        ).x
        still = int((_heights(at(x), corners) < needed).sum())
        if not still or still >= left:
            break
        left = still
    return at(x)


def _heights(uv, corners):
    """The heights of triangles with the `corners` (3, m) over their longest edges, (m,), negative where flipped."""
    corners = corners_of(uv, corners.T)
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    return 2 * signed_areas(corners) / np.maximum(longest, np.finfo(float).tiny)


def _energy(uv, corners, hats, bent, free):
    """The energy of the triangles with these `corners` (3, m), and its gradient by the free coordinates.

    Where a step goes so far that there are no numbers for it, the energy is high, and the step is not taken.
    """
    with np.errstate(all="ignore"):
        value, gradient = _energy_anywhere(uv, corners, hats, bent)
    if not (np.isfinite(value) and np.isfinite(gradient).all()):
        return 1e300, np.zeros(int(free.sum()))
    return value, gradient[free]


def _energy_anywhere(uv, corners, hats, bent):
    (a, b), (c, d) = jacobian_of(corners, hats, uv)
    det = a * d - b * c
    root = np.sqrt(det * det + bent * bent)
    # The determinant where it is large, and positive always; without cancellation where it is negative.
    bar = np.where(det > 0, det + root, bent * bent / (root + np.abs(det))) / 2
    top = (a * a + b * b + c * c + d * d + det * det + 1) / 2
    value = top / bar
    slope = det / bar - value / bar * (1 + det / root) / 2  # by the determinant
    gradient = np.zeros_like(uv)
    x, y = (np.array([-first - second, first, second]) for first, second in hats.swapaxes(0, 1))
    for column, (one, other) in enumerate(
        ((a / bar + slope * d, b / bar - slope * c), (c / bar - slope * b, d / bar + slope * a))
    ):
        gradient[:, column] = np.bincount(corners.ravel(), (one * x + other * y).ravel(), len(uv))
    return value.sum(), gradient
