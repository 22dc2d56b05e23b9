# SPDX-License-Identifier: GPL-3.0-or-later
"""What there is to find in any UVs: how they distort, what is flipped, collapsed or covered, and what is certified."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from .certificate import are_injective, as_stored, orientation
from .contacts import touches_along_seams_only
from .coverage import covered
from .distortion import Measured, measure_corners
from .pieces import starts_of_numbers
from .stepping import mapped
from .topology import Topology
from .uv_islands import UVIslands

_SMALL = 64  # triangles of an island, up to which their pairs are compared at once


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found, island by island (k) and triangle by triangle (t)."""

    measured: Measured
    """How they distort."""
    certified: np.ndarray
    """(k,) bool, the islands in which no triangle is flipped or collapsed and none lies on another, exactly."""
    overlaps_itself: np.ndarray
    """(k,) bool, the islands of which some triangles lie on each other."""
    pairs: np.ndarray
    """(p, 2), pairs of islands that lie on each other, of each stack the first; each that does is in one of them."""
    grazes: np.ndarray
    """(k,) bool, the islands that lie on others no deeper than rounding may have taken them: no fault."""
    covered: np.ndarray
    """(t,) bool, the triangles that lie on another one, of any island."""
    stack: np.ndarray
    """(k,) the first island whose faces coincide exactly with those of each: such are stacked on purpose."""


def inspect(
    islands: UVIslands,
    points: np.ndarray,
    uv: np.ndarray,
    aspect: np.ndarray,
    sheet: np.ndarray,
    face_start: np.ndarray,
) -> Generator[float, None, Inspection]:
    """Find out all that there is in some islands, of which there must be one at least.

    points      (c, 3) where the mesh's corners are in space
    uv          (c, 2) their UVs
    aspect      (k,) width by height of the image on each island
    sheet       (k,) numbers from 0: islands of different ones never lie on each other
    face_start  (f,) first corner of each face

    A generator that yields the share that is done, from 0 to 1.
    """
    own_uv = as_stored(uv[islands.vertex_corner])
    corners_in_space, in_map = points[islands.corners], own_uv[islands.triangles]
    scale = np.column_stack([aspect, np.ones(islands.count)])[islands.island, None]
    measured = measure_corners(corners_in_space, in_map * scale, islands.island)
    yield 0.2

    fine = np.minimum.reduceat(measured.orientation, islands.triangle_starts) > 0
    certified = fine & (np.diff(islands.triangle_starts, append=len(islands.island)) > _SMALL)
    certified[certified] = _are_simple(islands, certified, own_uv, points, measured.mirrored)
    yield 0.4
    doubtful = np.flatnonzero(~certified[islands.island])
    within = yield from mapped(lambda share: 0.4 + 0.3 * share, covered(in_map[doubtful], islands.island[doubtful]))
    stack = _stacks(islands, own_uv, sheet, face_start)
    steps = covered(in_map, sheet[islands.island], stack[islands.island])
    touching = yield from mapped(lambda share: 0.7 + 0.2 * share, steps)
    its = np.flatnonzero(touching.triangles)
    steps = covered(in_map[its], sheet[islands.island[its]], stack[islands.island[its]], rounding=True)
    between = yield from mapped(lambda share: 0.9 + 0.1 * share, steps)

    found = np.zeros(len(islands.island), dtype=bool)
    found[its[between.triangles]] = True
    grazes = np.isin(stack, touching.pairs) & ~np.isin(stack, between.pairs)
    found[doubtful] |= within.triangles
    overlaps_itself = np.zeros(islands.count, dtype=bool)
    overlaps_itself[islands.island[doubtful[within.triangles]]] = True
    return Inspection(
        measured=measured,
        certified=fine & ~overlaps_itself,
        overlaps_itself=overlaps_itself,
        pairs=between.pairs,
        grazes=grazes,
        covered=found,
        stack=stack,
    )


def _are_simple(islands, chosen, own_uv, points, mirrored):
    """Which of the `chosen` islands, (k,) bool, all without flips, cover nothing twice by what their outlines say.

    Returns that for each of those chosen.  Islands in doubt, as where outlines cannot be told apart, are not among
    them.
    """
    count = int(chosen.sum())
    its = chosen[islands.island]
    drawn, closed_up = islands.triangles[its], islands.closed_up_triangles[its]
    piece = (np.cumsum(chosen) - 1)[islands.island[its]]
    used, number = np.unique(closed_up, return_inverse=True)
    closed_up = number.reshape(-1, 3)
    vertex_piece = np.empty(len(used), dtype=np.intp)
    vertex_piece[closed_up] = piece[:, None]
    if not count:
        return np.zeros(0, dtype=bool)
    vertex_starts = starts_of_numbers(vertex_piece, count)
    topology = Topology(closed_up, len(used), vertex_starts, starts_of_numbers(piece, count))

    uv = np.where(mirrored[chosen][vertex_piece, None], (-1, 1), 1) * own_uv[used]
    drawn = np.searchsorted(used, drawn)
    solid = orientation(uv, drawn) != 0  # the others have no area in space either
    told = topology.loop_counts > 0
    rank, solid = np.cumsum(told) - 1, solid & told[piece]
    simple = np.zeros(count, dtype=bool)
    if told.any():
        loop_piece = rank[topology.loop_piece]
        simple[told] = are_injective(uv, drawn[solid], rank[piece[solid]], topology.loops, loop_piece)
    for k in np.flatnonzero(told & ~simple).tolist():
        first, end = np.append(vertex_starts, len(used))[k : k + 2]
        loops = [loop - first for loop, of in zip(topology.loops, topology.loop_piece, strict=True) if of == k]
        places = points[islands.vertex_corner[used[first:end]]]
        place = np.unique(places, axis=0, return_inverse=True)[1].ravel()
        simple[k] = touches_along_seams_only(uv[first:end], loops, place)
    return simple


def _stacks(islands, own_uv, sheet, face_start):
    """The first island of each one's stack, (k,): those on one sheet whose faces have the very same corners, in any
    order."""
    chosen = np.flatnonzero(islands.face_island >= 0)
    places = np.ascontiguousarray(own_uv[islands.corner_vertex].astype(np.float32) + 0.0).view(np.uint64).ravel()
    faces = np.add.reduceat(_mixed(places), face_start)[chosen]
    order = np.argsort(islands.face_island[chosen], kind="stable")
    starts = starts_of_numbers(islands.face_island[chosen][order], islands.count)
    sums = np.add.reduceat(_mixed(faces)[order], starts)
    keys = np.column_stack([sums, np.asarray(sheet).astype(np.uint64)])
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return first[number.ravel()]


def _mixed(values):
    """Numbers of 64 bits that look random and are the same for the same values (k,): their sums tell sets apart.

    It is the finalizer of the generator SplitMix64 (Steele, Lea, Flood 2014).
    """
    values = values + np.uint64(0x9E3779B97F4A7C15)
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))
