# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the unwrapped islands go, and what lies on what then."""

import itertools

import numpy as np

from ..core import UnwrapError, placing
from ..core.overlaps import overlap, overlapping
from . import packing


def place(works, all_works, options, context):
    works = [work for work in works if not work.in_frame]
    for work in works:
        old = work.old_triangles
        work.mirrored = old is not None and placing.is_mirrored(old)
        if work.mirrored:
            work.uv = work.uv * (-1, 1)
        if options.placement == 'UNIT':
            work.uv = placing.in_unit_square(work.uv / work.aspect) * work.aspect
        elif old is not None:
            work.uv = placing.in_place(work.uv, work.triangles, old)
    if options.placement == 'UNIT':
        return
    new = [work for work in works if work.old_triangles is None]
    if new:
        turned = placing.upright([(work.uv, work.vertices, work.triangles, work.mesh.up) for work in new])
        for work, uv in zip(new, turned, strict=True):
            work.uv = uv
    if options.placement == 'PACK':
        _pack(works, options, True, context)
    elif new:
        _pack(new, options, False, context)
        tile = placing.free_tile(np.concatenate([np.empty((0, 2)), *_others(new, all_works)]))
        for work in new:
            if work.uv is not None:
                work.uv = work.uv + (tile, 0) * work.aspect


def _pack(works, options, nested, context):
    works = sorted(works, key=lambda work: work.aspect[0])
    groups = {
        aspect: [(work.vertices, work.triangles, work.uv) for work in group]
        for aspect, group in itertools.groupby(works, key=lambda work: work.aspect[0])
    }
    try:
        packed = packing.pack(groups, options, nested, context) if works else []
    except UnwrapError as error:
        packed = [None] * len(works)
        for work in works:
            work.outcome.error = str(error)
    for work, uv in zip(works, packed, strict=True):
        work.uv = uv


def _others(works, all_works):
    """The UVs (k, 2) of everything else in the works' meshes, where they mean anything."""
    mine = {id(work) for work in works}
    for work in all_works:
        if id(work) not in mine and work.uv is not None:
            yield work.uv / work.aspect
        elif id(work) not in mine and work.old_triangles is not None:
            yield work.old_uv / work.aspect
    yield from (rest.reshape(-1, 2) for _, rest in _rests(all_works))


def _rests(works):
    """For each mesh, the faces that are not to be unwrapped, as triangles (t, 3, 2), where their UVs mean anything."""
    for obj, group in itertools.groupby(works, key=lambda work: work.target.obj):
        work = next(group)
        mesh, faces = work.mesh, work.target.faces
        if mesh.uv is not None and not faces.all():
            corner_face = np.repeat(np.arange(len(faces)), np.diff(mesh.face_start, append=len(mesh.corner_vertex)))
            rest = mesh.uv[mesh.corner_triangles[~faces[corner_face[mesh.corner_triangles[:, 0]]]]]
            if placing.says_where(rest):
                yield obj.name, rest


def report_overlaps(works, all_works):
    """Name the islands that lie on others now and did not before."""
    names = [work.outcome.label for work in works]
    now = [(work.uv / work.aspect)[work.triangles] for work in works]
    before = [work.old_triangles for work in works]
    before = [old if old is None else old / work.aspect for old, work in zip(before, works, strict=True)]
    for obj, rest in _rests(all_works):
        names.append(f"faces of {obj} that were not unwrapped")
        now.append(rest)
        before.append(rest)
    for i, j in overlapping(now):
        if before[i] is None or before[j] is None or not overlap(before[i], before[j]):
            works[i].outcome.overlaps += (names[j],)
            if j < len(works):
                works[j].outcome.overlaps += (names[i],)
