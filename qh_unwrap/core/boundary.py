# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the island's outline goes in the plane."""

from itertools import combinations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .certificate import count_crossings, enclosed_area
from .chart import Surface
from .errors import BorderError, BoundaryError, PinError, UnwrapError, UVError
from .initial import project
from .loops import edge_lengths
from .settings import Settings

_BOW = 0.02  # how far a side bulges, relative to its length, where it must not be straight
_CORNER_CANDIDATES = 40  # vertices of the outline, from which the corners of a rectangle are chosen
_AROUND = 0.015  # distance along the outline, relative to its length, within which its bends count as one corner


def held_outlines(
    surface: Surface,
    settings: Settings,
    uv: np.ndarray,
    has_uv: np.ndarray,
    pinned: np.ndarray,
    crossing: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, list[tuple[str, ...]], dict[int, UnwrapError]]:
    """What is held of every piece of a surface, for U and V, (n, 2) bool, and where, (n, 2), as `held_vertices` says.

    Also returns for each piece a tuple of warnings, and a dictionary from pieces to their errors.

    uv        (n, 2), of the pieces that have some, (p,) bool in `has_uv`
    pinned    (n, 2) bool, for U and V
    crossing  (p,) bool, the pieces whose outlines are kept though they cross themselves
    """
    held, values = np.zeros(len(uv), bool), np.zeros((len(uv), 2))
    warnings: list[tuple[str, ...]] = [()] * surface.piece_count
    faults: dict[int, UnwrapError] = {}
    ends = np.append(surface.vertex_starts, len(uv))
    some = pinned.any(axis=1)
    for k in range(surface.piece_count):
        its = slice(ends[k], ends[k + 1])
        pins = None if settings.boundary == "KEEP" else some[its]
        try:
            held[its], values[its], warnings[k] = held_vertices(
                surface.one(k),
                settings,
                uv[its] if has_uv[k] else None,
                pins,
                crossing is not None and bool(crossing[k]),
            )
        except UnwrapError as error:
            faults[k] = error
    held = np.column_stack([held, held])
    return (held | pinned if settings.boundary == "KEEP" else held), values, warnings, faults


def held_vertices(
    surface: Surface,
    settings: Settings,
    uv: np.ndarray | None = None,
    pinned: np.ndarray | None = None,
    crossing: bool = False,
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """The vertices of a surface of one piece whose place is given, (n,) bool, where it is, (n, 2), and warnings.

    `uv` (n, 2) are the UVs that it has, `pinned` (n,) bool its pinned vertices; an outline that is kept may
    cross itself if `crossing`.
    Raises `UVError`, `PinError` or `BoundaryError` where the settings cannot be followed.
    """
    warnings: tuple[str, ...] = ()
    loop = surface.loops[0]
    if settings.boundary in ("CIRCLE", "OUTLINE") and pinned is not None and pinned.any():
        raise PinError("pins need the boundary FREE or KEEP: unpin, or choose one of these")
    if settings.boundary == "KEEP":
        if uv is None:
            raise UVError("a kept boundary needs UVs, and there are none: choose another boundary")
        return _kept(surface, uv, pinned, crossing), uv, warnings
    if not edge_lengths(surface.vertices[loop]).any():
        raise BoundaryError("its outline has no length: merge its vertices by distance, or mark seams elsewhere")
    if settings.boundary == "CIRCLE":
        places = _circle(surface.vertices[loop])
    elif settings.boundary == "RECTANGLE":
        places, bowed = _on_polygon(surface, *_rectangle(surface, settings.aspect, pinned))
    else:
        places, bowed = _on_polygon(surface, *_hull(surface))
    if settings.boundary != "CIRCLE" and bowed:
        sides = "a side is" if bowed == 1 else f"{bowed} sides are"
        warnings = (f"{sides} bowed by {_BOW:.0%}, since edges join two of its vertices",)
    held = np.zeros(len(surface.vertices), bool)
    held[loop] = True
    values = np.zeros((len(surface.vertices), 2))
    values[loop] = places
    return held, values, warnings


def _circle(points):
    """Places on a circle, (k, 2), by the arc lengths of the closed polygon (k, 3).

    They start with the vertex farthest from the middle, so that it does not matter how the vertices are numbered.
    """
    first = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    angle = 2 * np.pi * np.roll(_fractions(np.roll(points, -first, axis=0)), first)
    return 0.5 + 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])


def _fractions(points):
    """Where along a closed polygon its points lie, (k,), from 0 for the first to less than 1; no two in one place."""
    length = edge_lengths(points)
    length = np.maximum(length, 1e-3 * length.mean())
    return np.concatenate([[0.0], np.cumsum(length)[:-1]]) / length.sum()


def _rectangle(surface, aspect, pinned):
    """The corners (4, 2) of the rectangle, and what `_along_sides` says of it."""
    loop = surface.loops[0]
    if len(loop) < 4:
        raise BoundaryError("a rectangle needs an outline of at least four vertices: choose another boundary")
    corners = _chosen_corners(surface, aspect) if pinned is None or not pinned.any() else _pinned_corners(loop, pinned)
    at = _fractions(surface.vertices[loop])
    share = np.diff(at[corners], append=at[corners[0]] + 1)
    across, up = share[0] + share[2], share[1] + share[3]
    if (across < up) != (0 < aspect < 1):
        corners = np.roll(corners, -1)
        across, up = up, across
    width, height = (aspect, 1.0) if aspect else (across, up)
    size = max(width, height)
    polygon = np.array([[0, 0], [width, 0], [width, height], [0, height]]) / size
    return polygon, *_along_sides(surface, corners)


def _along_sides(surface, corners):
    """The side that each outline vertex lies on, (k,), and how far along it by arc length, (k,), from 0 to less than 1.

    `corners` are the places in the outer loop where the sides begin.
    """
    loop = surface.loops[0]
    order = np.roll(np.arange(len(loop)), -corners[0])
    at = _fractions(surface.vertices[loop[order]])
    start = at[(np.asarray(corners) - corners[0]) % len(loop)]
    side = np.empty(len(loop), dtype=np.int64)
    along = np.empty(len(loop))
    side[order] = np.searchsorted(start, at, side="right") - 1
    along[order] = (at - start[side[order]]) / np.diff(start, append=1.0)[side[order]]
    return side, along


def _pinned_corners(loop, pinned):
    """The four places in the outer loop that are pinned; raises `PinError` if these are not all the pins."""
    corners = np.flatnonzero(pinned[loop])
    if len(corners) != 4 or pinned.sum() != 4:
        raise PinError(
            f"a rectangle takes its corners from four pinned vertices of the outline, not {pinned.sum()},"
            f" {len(corners)} of them on the outline: pin four, or none"
        )
    return corners


def _chosen_corners(surface, aspect):
    """Four places in the outer loop where it bends sharply, and that cut it into sides that suit the rectangle."""
    loop = surface.loops[0]
    at = _fractions(surface.vertices[loop])
    bend = np.pi - surface.angle_sums(len(surface.vertices))[loop]  # in radians, positive at convex vertices
    # How sharp a corner is: the sum of the bends at and around the vertex, that of the vertex itself counting double
    total = np.concatenate([[0.0], np.cumsum(np.tile(bend, 3))])
    places = np.concatenate([at - 1, at, at + 1])
    within = np.searchsorted(places, at - _AROUND), np.searchsorted(places, at + _AROUND, "right")
    sharpness = bend + total[within[1]] - total[within[0]]
    candidates = []
    for place in np.argsort(-sharpness, kind="stable"):
        gap = np.abs(at[candidates] - at[place]) if candidates else np.ones(1)
        if np.minimum(gap, 1 - gap).min() >= 1 / (2 * _CORNER_CANDIDATES):
            candidates.append(place)
        if len(candidates) == _CORNER_CANDIDATES:
            break
    if len(candidates) < 4:
        candidates = np.argsort(-sharpness, kind="stable")[:4]
    sets = np.array(list(combinations(np.sort(candidates), 4)))
    share = np.diff(at[sets], axis=1, append=at[sets[:, :1]] + 1)
    uneven = (share[:, 0] - share[:, 2]) ** 2 + (share[:, 1] - share[:, 3]) ** 2
    if aspect:
        wanted = aspect / (1 + aspect)
        across = share[:, 0] + share[:, 2]
        uneven += np.minimum((across - wanted) ** 2, (1 - across - wanted) ** 2)
    sharp = np.minimum(sharpness[sets], np.pi).sum(axis=1)
    return sets[np.argmax(sharp - 20 * uneven)]


def _hull(surface):
    """The corners (c, 2) of the convex hull of the outline's flat view, and the side that each outline vertex goes to
    and how far along it, as `_along_sides` returns them."""
    loop = surface.loops[0]
    flat = project(surface)[loop]
    try:
        corners = ConvexHull(flat).vertices
    except QhullError:
        raise BoundaryError("the outline's flat view is a line: choose another boundary") from None
    corners = np.roll(corners, -int(np.argmin(corners)))
    polygon = flat[corners]
    if (np.diff(corners) > 0).all():
        side, along = _along_sides(surface, corners)
    else:
        # The flat view of the outline meets its own hull out of order: spread it along the hull by length.
        start = np.append(_fractions(polygon), 1.0)
        at = _fractions(surface.vertices[loop])

        def spread(shift):
            here = (at + shift) % 1
            side = np.clip(np.searchsorted(start, here, side="right") - 1, 0, len(polygon) - 1)
            return side, (here - start[side]) / np.diff(start)[side]

        def misfit(shift):
            side, along = spread(shift)
            ends = polygon[side], np.roll(polygon, -1, axis=0)[side]
            return ((ends[0] + along[:, None] * (ends[1] - ends[0]) - flat) ** 2).sum()

        side, along = spread(min(np.arange(256) / 256, key=misfit))
    polygon = polygon - polygon.min(axis=0)
    return polygon / polygon.max(), side, along


def _on_polygon(surface, polygon, side, along):
    """The places of the outline on a convex polygon (c, 2), (k, 2), and how many of its sides had to be bowed.

    `side` and `along` (k,) say which side each outline vertex lies on and how far along it.  A side is bowed where an
    inner edge joins two of its vertices: on a straight side, triangles at that edge would collapse.
    """
    start, end = polygon, np.roll(polygon, -1, axis=0)
    position = np.full(len(surface.vertices), -1)
    position[surface.loops[0]] = np.arange(len(side))
    inner = np.ones(len(surface.edges), bool)
    inner[surface.half_edge_edges[surface.on_boundary]] = False
    i, j = position[surface.edges[inner & (position[surface.edges] >= 0).all(axis=1)]].T
    # A corner lies on two sides
    before = np.where(along == 0, (side - 1) % len(polygon), side)
    bowed = np.zeros(len(polygon), bool)
    for one, other in ((side, side), (side, before), (before, side), (before, before)):
        bowed[one[i][one[i] == other[j]]] = True
    direction = (end - start)[side]
    outward = np.column_stack([direction[:, 1], -direction[:, 0]])
    bulge = 4 * _BOW * along * (1 - along) * bowed[side]
    return start[side] + along[:, None] * direction + bulge[:, None] * outward, int(bowed.sum())


def _kept(surface, uv, pinned, crossing):
    """The vertices of all boundary loops, and those that are pinned, (n,) bool; raises `BorderError`."""
    held = np.zeros(len(surface.vertices), bool)
    for loop in surface.loops:
        held[loop] = True
    if not enclosed_area(uv[outer_loop(surface, uv)]) > 0:
        raise BorderError("the UVs' outline encloses no area", "choose another boundary")
    fault = "" if crossing else crossing_fault(surface, uv)
    if fault:
        raise BorderError(fault, "untangle it, or choose another boundary")
    return held if pinned is None else held | pinned


def crossing_fault(surface: Surface, uv: np.ndarray) -> str:
    """What there is to say of boundary loops that cross themselves or each other, an empty text if they do not."""
    crossings = count_crossings([uv[loop] for loop in surface.loops])
    times = "once" if crossings == 1 else f"{crossings} times"
    return f"the UVs' outline crosses itself {times}" if crossings else ""


def outer_loop(surface: Surface, uv: np.ndarray) -> np.ndarray:
    """The loop that encloses the largest area in the plane."""
    return max(surface.loops, key=lambda loop: abs(enclosed_area(uv[loop])))
