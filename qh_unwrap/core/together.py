# SPDX-License-Identifier: GPL-3.0-or-later
"""Many small islands at once: one surface of many pieces, whose every step costs hardly more than that of one.

Small islands are nearly flat as a rule, so a projection or the conformal map is close to the best one: the refinement
begins there, and without air around them.  Whatever is not certified then, has holes or cannot be unwrapped is left to
be unwrapped alone.
"""

import numpy as np

from .descent import descend, energies
from .distortion import measure_pieces
from .errors import SurfaceError
from .initial import conformal, project
from .pieces import joined
from .quasi_harmonic import Held
from .settings import Settings
from .solver import Dirichlet
from .surface import Surface
from .unwrapping import ISOMETRIC, Report, Result, face_warnings
from .validity import are_injective

_SMALL = 200  # triangles of an island that may go with others
_AT_ONCE = 20_000  # triangles
_STEPS = 12
_FAIR = 10  # the energy of a start from which few steps lead to the end


def unwrap_together(islands, settings=None):
    """Unwrap the small ones of `islands` without pins: (vertices (n, 3), triangles (m, 3), uv (n, 2) or None) each.

    The settings must be those of the free boundary, with the start left to choose and a refinement.  A generator:
    yields the number of islands done so far, and returns a list with a `Result`, or None for whatever is to be
    unwrapped alone.
    """
    settings = settings or Settings()
    results = [None] * len(islands)
    chosen = settings.boundary, settings.initial, settings.weights
    suits = chosen == ("FREE", "AUTO", "COTANGENT") and settings.iterations and settings.refine
    size = np.array([len(triangles) for _, triangles, _ in islands])
    small = np.flatnonzero(size <= (_SMALL if suits else 0))
    if not len(small):
        return results
    portion = np.cumsum(size[small]) // _AT_ONCE
    for part in np.split(small, np.flatnonzero(np.diff(portion)) + 1):
        for k, result in zip(part, _unwrap([islands[k] for k in part], settings), strict=True):
            results[k] = result
        yield int(part[-1]) + 1
    return results


def _unwrap(islands, settings):
    if not islands:
        return []
    try:
        vertices, triangles, _ = zip(*islands, strict=True)
        surface = Surface(*joined(vertices, triangles))
    except SurfaceError:
        if len(islands) == 1:
            return [None]
        half = len(islands) // 2
        return _unwrap(islands[:half], settings) + _unwrap(islands[half:], settings)
    if len(surface.loops) > len(islands):
        return _unwrap_some(islands, np.bincount(surface.loop_piece) == 1, settings)
    start = _best_start(surface, settings.balance)
    value = energies(surface, start, settings.balance)
    if not (value < _FAIR).all():
        return _unwrap_some(islands, value < _FAIR, settings)

    uv, changes, converged = start, [], value <= ISOMETRIC
    if not converged.all():
        held = np.zeros(len(start), bool)
        held[surface.vertex_starts] = True  # one vertex each: the rest follows from it
        domain = Held(surface, Dirichlet(surface.order, surface.edges, held, start))
        for moved, done in descend(domain, settings.balance, min(settings.refine, _STEPS), start):
            way = np.maximum.reduceat(np.linalg.norm(moved - uv, axis=1), surface.vertex_starts)
            changes.append(way / np.linalg.norm(_extent(surface, moved)[1], axis=1))
            uv, converged = moved, converged | done
    low, size = _extent(surface, uv)
    placed = (uv - low[surface.vertex_piece]) / size.max(axis=1)[surface.vertex_piece, None]
    certified = are_injective(placed, surface.triangles, surface.piece, surface.loops, surface.loop_piece)
    finished = certified & (converged | (settings.refine <= _STEPS))
    return _results(islands, surface, start, placed, finished, converged, np.reshape(changes, (-1, len(islands))))


def _unwrap_some(islands, chosen, settings):
    results = iter(_unwrap([island for island, its in zip(islands, chosen, strict=True) if its], settings))
    return [next(results) if its else None for its in chosen]


def _best_start(surface, balance):
    """Of the projection and the conformal map of every piece, that of least energy."""
    start = project(surface)
    value = energies(surface, start, balance)
    if (value > ISOMETRIC).any():
        other = conformal(surface)
        better = energies(surface, other, balance) < value
        start = np.where(better[surface.vertex_piece, None], other, start)
    return start


def _extent(surface, uv):
    """Lower left corner and size of every piece's bounding box, (p, 2) each."""
    low, high = (reduce.reduceat(uv, surface.vertex_starts) for reduce in (np.minimum, np.maximum))
    return low, high - low


def _results(islands, surface, start, uv, finished, converged, changes):
    measured = [None] * len(islands)
    if any(given is not None for _, _, given in islands):
        given = [np.zeros((len(vertices), 2)) if given is None else given for vertices, _, given in islands]
        measured = measure_pieces(surface, np.concatenate(given))
    rows = zip(
        islands,
        measured,
        measure_pieces(surface, start),
        measure_pieces(surface, uv),
        np.split(uv, surface.vertex_starts[1:]),
        surface.vertex_starts.tolist(),
        surface.loops,  # as many as there are pieces, and in their order
        surface.sums(surface.degenerate.astype(int)).tolist(),
        finished.tolist(),
        converged.tolist(),
        changes.T.tolist(),
        strict=True,
    )
    results = []
    for (_, _, given), before, initial, after, its_uv, first, loop, flat, done, settled, its_changes in rows:
        report = Report(
            before=None if given is None else before,
            initial=initial,
            after=after,
            iterations=len(its_changes),
            converged=settled,
            changes=tuple(its_changes),
            injective=done,
            mirrored=False,
            warnings=face_warnings(flat),
        )
        results.append(Result(its_uv, report, [loop - first]) if done else None)
    return results
