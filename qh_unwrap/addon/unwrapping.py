# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrapping the chosen faces of objects: read, split into islands, unwrap each, place, write."""

import dataclasses
import itertools

import numpy as np

from ..core import UnwrapError, distortion, unwrap_steps, unwrap_together
from ..core.errors import BoundaryError, UVError
from ..core.islands import attached, find_islands
from ..core.pieces import joined, numbers
from ..core.stepping import mapped
from ..core.validity import are_injective, orientation
from . import memory, mesh_arrays, packing, placing
from .delaunay import triangulate
from .outcome import Outcome, count
from .overlaps import overlap, overlapping
from .work import Work

_FIXED = 300  # vertices that take as long as what an island takes whatever its size
_LEFT = 0.9  # of an island after each iteration, by and large
_TOGETHER = 0.5  # of the work is that on small islands, if there are any


def unwrap_targets(targets, settings, options, context):
    """Unwrap the targets' faces.  A generator: yields the share that is done, returns the outcomes.

    An island that fails is left as it was, and its outcome says why; nothing is written before all are done.
    """
    works = []
    for target in targets:
        yield 0.0
        works += _works(target, settings, options)
    yield from _unwrap_all(works)
    yield 1.0
    if not all(mesh_arrays.is_as_read(work.target.obj, work.mesh) for work in works):
        for work in works:
            work.outcome.error = "a mesh was changed meanwhile: unwrap again"
        return [work.outcome for work in works]

    _place([work for work in works if work.uv is not None], works, options, context)
    placed = [work for work in works if work.uv is not None]
    if placed:
        if options.placement != 'UNIT':
            _report_overlaps(placed, works)
        with mesh_arrays.in_object_mode(context):
            for obj, group in itertools.groupby(placed, key=lambda work: work.target.obj):
                _write(obj, list(group))
    return [work.outcome for work in works]


def _works(target, settings, options):
    obj, faces, stays_attached = target
    mesh = mesh_arrays.read(obj, options)
    topology = mesh.corner_vertex, mesh.corner_edge, mesh.face_start, mesh.seam, faces
    hanging = np.zeros(len(mesh.corner_vertex), dtype=bool)
    if stays_attached and mesh.uv is not None:
        hanging = attached(*topology, mesh.uv)
    islands = find_islands(*topology, mesh.corner_triangles)
    for number, island in enumerate(islands, start=1):
        outcome = Outcome(obj.name, number, len(island.faces), alone=len(islands) == 1)
        yield Work(target, mesh, island, outcome, settings, hanging)


def _unwrap_all(works):
    """Unwrap the small ones together and the others one by one; yields the share that is done."""
    share = 0.0
    for share in _unwrap_together(works):
        yield share
    works = [work for work in works if work.uv is None]
    sizes = np.array([_FIXED + len(work.island.vertices) for work in works])
    left = (1 - share) / max(sizes.sum(), 1)
    for done, size, work in zip(np.cumsum(sizes) - sizes, sizes, works, strict=True):
        try:
            yield share + left * done
            for iteration in _unwrap(work):
                yield share + left * (done + size * (1 - _LEFT**iteration))
        except UnwrapError as error:
            work.outcome.error = str(error)
        except MemoryError:
            work.outcome.error = "the memory ran out: mark seams to cut it into smaller islands"


def _unwrap_together(works):
    """Unwrap what is small and free, all at once; yields the share that is done then, if others are left."""
    free_memory = memory.free()
    works = [work for work in works if work.is_free and memory.suffices(len(work.vertices), free_memory)]
    if not works:
        return
    old = [None if work.old_uv is None or work.is_cut else work.old_uv for work in works]
    islands = [(work.vertices, work.triangles, uv) for work, uv in zip(works, old, strict=True)]
    steps = unwrap_together(islands, works[0].settings)
    try:
        results = yield from mapped(lambda done: _TOGETHER * done / len(works), steps)
    except MemoryError:  # there may be enough for one at a time
        return
    for work, result in zip(works, results, strict=True):
        if result is not None:
            _keep(work, result)


def _unwrap(work):
    memory.check(len(work.vertices), memory.free())
    hanging = work.hanging if work.old_triangles is not None else np.zeros(len(work.vertices), dtype=bool)
    try:
        result = yield from _result(work, hanging)
    except (BoundaryError, UVError) as error:
        if not hanging.any():
            raise
        raise type(error)(f"{error} (faces that are not selected hang on it: or select all of its island)") from None
    _keep(work, result)


def _keep(work, result):
    work.uv, work.loops = result.uv, result.loops
    work.mirrored = result.report.mirrored
    work.outcome.before, work.outcome.after = result.report.before, result.report.after
    work.outcome.iterations = result.report.iterations
    work.outcome.converged = result.report.converged
    work.outcome.warnings += tuple(result.report.warnings)
    if work.island.crowded_edges:
        edges = count(work.island.crowded_edges, "edge")
        work.outcome.warnings += (f"it ends at {edges} where more than two faces meet",)


def _result(work, hanging):
    settings, uv, pinned = work.settings, work.old_uv, work.pinned
    if hanging.any():
        if settings.boundary == 'FREE':
            pinned |= hanging
        elif settings.boundary != 'KEEP':
            settings = dataclasses.replace(settings, boundary='KEEP')
            work.outcome.warnings += ("its outline is kept, since faces that are not selected hang on it",)
    work.in_frame = settings.boundary == 'KEEP' or (settings.boundary == 'FREE' and pinned.any())
    if uv is not None and work.is_cut:
        if work.in_frame or settings.initial == 'CURRENT':
            raise UVError("its UVs are cut where there is no seam: mark the cuts with UV > Seams from Islands")
        uv = None
    steps = unwrap_steps(work.vertices, work.triangles, settings, uv=uv, pinned=pinned, triangulate=triangulate)
    return (yield from mapped(lambda state: state.iteration, steps))


def _place(works, all_works, options, context):
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


def _report_overlaps(works, all_works):
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


def _write(obj, works):
    corners = np.concatenate([work.island.corners for work in works])
    uv = np.concatenate([work.corner_uv for work in works])
    try:
        mesh_arrays.write(obj, corners, uv)
    except UnwrapError as error:
        for work in works:
            work.outcome.error = str(error)
        return
    areas = placing.areas([(work.vertices, work.triangles) for work in works])
    for work, area in zip(works, areas.tolist(), strict=True):
        work.outcome.area = area
    _judge(works)


def _judge(works):
    """Say what there is to say of the UVs that Blender stores, which are rounded where they lie now."""
    uvs = [work.stored_uv for work in works]
    uv, triangles, first, triangle_starts = joined(uvs, [work.triangles for work in works])
    piece = numbers(triangle_starts, len(triangles))
    sign = orientation(uv, triangles)
    changed = sign != np.concatenate([work.outcome.after.triangle_orientation for work in works])
    for k in np.unique(piece[changed]):
        work = works[k]
        work.outcome.after = distortion(work.vertices, work.triangles, uvs[k] * work.aspect)

    loops = [loop + start for work, start in zip(works, first, strict=True) for loop in work.loops]
    solid = sign != 0  # those without area do not count, unless they should have some
    loop_piece = np.repeat(np.arange(len(works)), [len(work.loops) for work in works])
    certified = are_injective(uv, triangles[solid], piece[solid], loops, loop_piece)
    for work, certain in zip(works, certified.tolist(), strict=True):
        after = work.outcome.after
        work.outcome.injective = certain and not (after.flips or after.collapsed)
