# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be said of islands as Blender will store and draw them, before anything is written."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..core import Surface, distortion
from ..core.certificate import are_injective, as_stored, orientation
from ..core.contacts import touches_along_seams_only
from ..core.delaunay import triangulate
from ..core.pieces import joined, numbers, parts_of, starts_of
from ..core.triangles import areas_in_space
from ..core.unfolding import unfolded, unfolded_in_air
from .work import written_uv

_SAME = 1e-6  # of an island's extent, by which the two sides of a seam may be apart and yet be meant to be one line
_ROUNDED = 1e-2  # of an island's area, that triangles flipped by rounding may have


def keep_what_was_valid(works):
    """Give islands their old UVs back where these covered nothing twice, and the new ones do."""
    for work in works:
        if work.uv is None or work.certified or not work.can_stay or _closed(work):
            continue
        before = work.as_before()
        new, old = _seen([work, before])
        if not _is_valid(work, new) and _is_valid(before, old):
            work.uv, work.mirrored = before.uv, before.mirrored
            outcome = work.outcome
            outcome.after = distortion(work.vertices, work.triangles, work.uv)
            outcome.warnings += ("its UVs stay as they were: no other map that covers nothing twice was found",)


def _is_valid(work, seen):
    return seen.is_injective or ((seen.sign >= 0).all() and touches_along_seams_only(seen.uv, work.loops, work.place))


class _Seen(NamedTuple):
    """An island as Blender will store it, rounded where it lies now."""

    uv: np.ndarray  # (n, 2)
    sign: np.ndarray  # (t,) the orientation of the triangles that Blender draws
    is_injective: bool  # but for triangles without area, and without any contact


def _stored_uvs(works):
    """The works' new UVs, (n, 2) each, in Blender's single precision, as seen from where they are not mirrored."""
    stored = parts_of(as_stored(written_uv(works)), starts_of([work.uv for work in works]))
    return [uv * (-1, 1) if work.mirrored else uv for work, uv in zip(works, stored, strict=True)]


def _seen(works):
    uvs = _stored_uvs(works)
    uv, triangles, first, triangle_starts = joined(uvs, [work.drawn for work in works])
    sign = orientation(uv, triangles)
    loops = [loop + start for work, start in zip(works, first, strict=True) for loop in work.loops]
    loop_piece = np.repeat(np.arange(len(works)), [len(work.loops) for work in works])
    solid = sign != 0  # those without area do not count, unless they should have some
    piece = numbers(triangle_starts, len(triangles))
    certified = are_injective(uv, triangles[solid], piece[solid], loops, loop_piece)
    return [_Seen(*each) for each in zip(uvs, parts_of(sign, triangle_starts), certified.tolist(), strict=True)]


def judge(works):
    """Say what there is to say of the UVs that Blender will store, and of the triangles that it draws; what only
    rounding spoils is mended first."""
    if not works:
        return
    seen = _seen(works)
    mended = [k for k, each in enumerate(seen) if not each.is_injective and _opened(works[k])]
    if mended:
        for k, each in zip(mended, _seen([works[k] for k in mended]), strict=True):
            seen[k] = each
    signs = [each.sign for each in seen]
    starts = starts_of(signs)
    reported = np.concatenate([work.outcome.after.triangle_orientation for work in works])
    differ = np.logical_or.reduceat(np.concatenate(signs) != reported, starts).tolist()
    flipped = np.logical_or.reduceat(np.concatenate(signs) < 0, starts).tolist()
    for k, (work, (uv, sign, is_injective)) in enumerate(zip(works, seen, strict=True)):
        outcome = work.outcome
        if work.island.is_redrawn or differ[k]:
            outcome.after = distortion(work.vertices, work.triangles, uv * work.aspect)
        if work.island.is_redrawn:
            _judge_drawn(work, sign)
        if work.island.doubled_faces:
            _judge_doubled(work, orientation(uv, work.doubled))
        outcome.injective = not (outcome.after.flips or outcome.after.collapsed or flipped[k])
        if outcome.injective and not is_injective:
            outcome.injective = touches_along_seams_only(uv, work.loops, work.place)
            if outcome.injective:
                outcome.warnings += ("it touches itself along a seam, and covers nothing twice",)


def _opened(work):
    """Whether an island that only rounding spoils, where it was placed, could be changed so that it is certified there:
    its outline is closed where both sides of a seam lie on each other, or opened where they do not."""
    if _closed(work):
        return True
    if not work.certified:
        return False
    seen = (-1, 1) if work.mirrored else (1, 1)
    surface, uv, held = Surface(work.vertices, work.triangles), work.uv * seen, work.held
    opened, done = unfolded_in_air(surface, uv, held, triangulate)
    if not done:
        opened, (done,) = unfolded(surface, uv, held, _ROUNDED)
    if done:
        work.uv = opened * seen
    return bool(done)


def _closed(work):
    """Whether it is certified once vertices on both sides of a seam have the very same UVs, where rounding alone keeps
    them apart; then they have."""
    uv = work.uv
    rim = np.concatenate(work.loops)
    rim = rim[~work.held[rim].any(axis=1)]
    place = work.place
    order = rim[np.argsort(place[rim], kind="stable")]
    first = order[np.searchsorted(place[order], place[order])]
    near = _SAME * np.ptp(uv, axis=0).max() + 4 * np.finfo(np.float32).eps * np.abs(uv).max()
    apart = np.abs(uv[order] - uv[first]).max(axis=1)
    joined_up = (apart <= near) & (apart > 0)
    if not joined_up.any():
        return False
    work.uv = uv.copy()
    work.uv[order[joined_up]] = uv[first[joined_up]]
    (stored,) = _stored_uvs([work])
    sign = orientation(stored, work.triangles)
    if (sign > 0).all() and touches_along_seams_only(stored, work.loops, place):
        return True
    work.uv = uv
    return False


def _judge_drawn(work, sign):
    """Count the flips and collapses of an island's faces in the triangles that Blender draws."""
    flips, collapsed = _wrong(work, work.drawn, sign)
    work.outcome.after = dataclasses.replace(work.outcome.after, flips=flips, collapsed=collapsed)
    if flips or collapsed:
        work.outcome.warnings += (
            "Blender cuts some of its neighbouring faces along the same diagonal: triangulate them",
        )


def _judge_doubled(work, sign):
    """Add the flips and collapses of doubled faces, which Blender may cut into other triangles than their twins."""
    after = work.outcome.after
    flips, collapsed = _wrong(work, work.doubled, sign)
    work.outcome.after = dataclasses.replace(after, flips=after.flips + flips, collapsed=after.collapsed + collapsed)
    if flips or collapsed:
        work.outcome.warnings += (
            "Blender cuts doubled faces otherwise than their twins: delete the doubles, or triangulate both",
        )


def _wrong(work, triangles, sign):
    """How many of an island's triangles (t, 3) are flipped and how many collapsed, by their orientations (t,)."""
    has_area = areas_in_space(work.vertices, triangles) > 0
    return int((sign < 0).sum()), int(((sign == 0) & has_area).sum())
