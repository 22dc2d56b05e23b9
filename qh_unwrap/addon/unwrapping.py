# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrapping the chosen faces of objects: read, split into islands, unwrap, place, write, judge what is stored."""

import dataclasses
import itertools
from collections.abc import Generator, Sequence

import bpy
import numpy as np

from ..core import Settings, Shape, UnwrapError
from ..core.course import PINS_CROSS
from ..core.errors import BoundaryError, ClosedError, GenusError, UVError
from ..core.islands import attached, find_islands
from ..core.stepping import mapped
from ..core.unwrapping import unwrap_variously
from . import judging, layout, mesh_arrays, modes, stacking, texels
from .hints import hint_at_seams
from .mesh_islands import MeshIslands
from .options import MeshOptions
from .outcome import Outcome, count
from .selection import Target
from .work import Work, corners_to_write


def unwrap_targets(
    targets: Sequence[Target],
    settings: Settings,
    options: MeshOptions,
    context: bpy.types.Context,
    cuts: Sequence = (),
) -> Generator[float, None, list[Outcome]]:
    """Unwrap the targets' faces.  A generator: yields the share that is done, returns the outcomes.

    An island that fails is left as it was, and its outcome says why; nothing is written before all are done.  With
    `cuts` (`cutting.Cut`) of some targets, their new seams are marked where the islands beside them get UVs.
    """
    works, cuts = [], {cut.target.obj: cut for cut in cuts}
    for target in targets:
        yield 0.0
        cut = cuts.get(target.obj)
        its = list(_works(target, cut.mesh if cut else mesh_arrays.read(target.obj, options), settings))
        for work in its if cut else ():
            _take(cut, work)
        works += its
    yield from mapped(lambda share: _UNWRAPPING * share, _unwrap(works))
    if are_as_read(works):
        placed = yield from _placed(works, options, context)
        yield 1.0
        if placed and are_as_read(works):
            with modes.in_object_mode(context):
                for obj, group in itertools.groupby(placed, key=lambda work: work.target.obj):
                    write(obj, list(group), cuts.get(obj))
            texels.note(placed, context)
    return [work.outcome for work in works]


_UNWRAPPING = 0.9  # of all the work, by and large; the rest is to see what lies on what


def are_as_read(works):
    """Whether all meshes are as they were read; if not, no island is unwrapped, and its outcome says why."""
    meshes = {id(work.mesh): work for work in works}.values()  # once each
    if all(mesh_arrays.is_as_read(work.target.obj, work.mesh) for work in meshes):
        return True
    for work in works:
        work.outcome.error = "a mesh was changed meanwhile: unwrap again"
    return False


def _placed(works, options, context):
    """Put the islands where they belong, and see what they lie on there; yields the share that is done, returns those
    that have UVs now."""
    judging.keep_what_was_valid(works)
    yield _UNWRAPPING
    layout.place([work for work in works if work.uv is not None], works, options, context)
    yield _UNWRAPPING
    tell_of_density(works, options)
    placed = [work for work in works if work.uv is not None]
    judging.judge(placed)
    yield from mapped(lambda _: _UNWRAPPING, hint_at_seams(placed))
    if placed and options.placement != 'UNIT':
        rest = 1 - _UNWRAPPING
        yield from mapped(lambda share: _UNWRAPPING + rest * share, stacking.report_overlaps(placed, works, options))
    return placed


def tell_of_density(works, options):
    """Warn of islands that cannot get the texel density that is given, since something of them is held."""
    if options.texel_density == 'GIVEN':
        for work in works:
            if work.in_frame and work.uv is not None and work.scale is None:
                work.outcome.warnings += ("its texel density stays, since pins or its outline hold it",)


def _works(target, mesh, settings):
    obj, faces, stays_attached = target
    topology = mesh.corner_vertex, mesh.corner_edge, mesh.face_start, mesh.seam, faces
    hanging = np.zeros(len(mesh.corner_vertex), dtype=bool)
    if stays_attached and mesh.uv is not None:
        hanging = attached(*topology, mesh.uv)
    islands = find_islands(*topology, mesh.corner_triangles)
    together = MeshIslands(mesh, islands)
    for number, island in enumerate(islands):
        outcome = Outcome(obj.name, number + 1, island.faces, alone=len(islands) == 1)
        yield Work(target, mesh, island, outcome, settings, hanging, together, number)


def _take(cut, work):
    """Let an island know of the seams that it is to get, and of the map that was found with them."""
    island = work.island
    work.has_new_seams = bool(cut.new[cut.mesh.corner_edge[island.corners]].any())
    found = np.full((len(island.vertices), 2), np.nan)
    found[island.corner_vertex] = cut.corner_uv[island.corners]
    if work.has_new_seams and not np.isnan(found).any():
        work.found_uv = found
    for chart in cut.charts:
        if chart.error is not None and island.faces[0] in chart.faces:
            work.cut_fault = str(chart.error)


def _unwrap(works):
    """Unwrap the islands, each with its settings; yields the share that is done."""
    asked, tried = [], []
    for work in works:
        try:
            asked.append(_shape(work))
            tried.append(work)
        except UnwrapError as error:
            work.outcome.error = str(error)
    results = yield from unwrap_variously(asked)
    for work, result in zip(tried, results, strict=True):
        if isinstance(result, UnwrapError):
            work.outcome.error = _explained(result, work)
            work.outcome.needs_cut = isinstance(result, ClosedError | GenusError)
            if work.cut_fault and work.outcome.needs_cut:
                work.outcome.error = work.cut_fault
        else:
            keep(work, result)


def _shape(work):
    """The settings and the shape that the core gets for an island."""
    settings, uv, pinned = work.settings, work.old_uv, work.pinned
    has_pins = bool(pinned.any())
    if work.found_uv is not None and settings.boundary == 'FREE' and settings.initial == 'AUTO' and not has_pins:
        # A start that is valid: another one may not lead to a map that is.
        settings = dataclasses.replace(settings, initial='CURRENT', iterations=0)
        return settings, _made_shape(work, work.found_uv)
    if work.is_attached:
        if settings.boundary == 'FREE':
            pinned, has_pins = pinned | work.attached_vertices, True
        elif settings.boundary != 'KEEP':
            settings = dataclasses.replace(settings, boundary='KEEP')
            work.outcome.warnings += ("its outline is kept, since faces that are not selected hang on it",)
    work.in_frame = settings.boundary == 'KEEP' or (settings.boundary == 'FREE' and has_pins)
    uses_uv = work.in_frame or settings.initial == 'CURRENT'
    if work.uv_fault and uses_uv:
        raise UVError(f"{work.uv_fault}: {_without_uvs(settings)}")
    if uv is not None and work.is_fresh and not uses_uv:
        uv = None
    if uv is not None and work.is_cut:
        if uses_uv:
            text = f"its UVs are cut where there is no seam: {_uncut(work.mesh)}"
            raise UVError(text + (_HANGS if work.is_attached else ""))
        uv = None
    return settings, _made_shape(work, uv, pinned if has_pins else None)


def _made_shape(work, uv, pinned=None):
    its = dict(face=work.triangle_faces, importance=work.importance)
    return Shape(work.vertices, work.triangles, uv, pinned, **its)


def _without_uvs(settings):
    """What to do where UVs are needed and those that there are mean nothing."""
    if settings.boundary == 'KEEP':
        return "unwrap it with another boundary than Keep first"
    return "choose another start than Current UVs" if settings.initial == 'CURRENT' else "unpin it, and unwrap it first"


def _uncut(mesh):
    """What to do where UVs are cut without a seam; Blender's operator does not mark cuts along welded edges."""
    if mesh.welded_edge is not None:
        return "mark seams along the cuts, or turn Weld off"
    return "mark the cuts with UV > Seams from Islands"


_NO_ROOM = "faces that are not selected hang on it, and leave its outline no room: select all of its island"
_HANGS = " (faces that are not selected hang on it: or select all of its island)"


def _explained(error, work):
    return f"{error}{_HANGS}" if work.is_attached and isinstance(error, BoundaryError | UVError) else str(error)


def keep(work, result):
    """Take the core's result of an island."""
    report, outcome = result.report, work.outcome
    work.uv, work.loops, work.mirrored = result.uv, result.loops, report.mirrored
    work.certified = report.injective
    outcome.before, outcome.after = None if work.found_uv is not None else report.before, report.after
    outcome.iterations, outcome.converged = report.iterations, report.converged
    # To the core, vertices that faces hang on which are not selected are pins.
    hanging = work.is_attached and not work.pinned.any()
    warnings = (_NO_ROOM if hanging and text == PINS_CROSS else text for text in report.warnings)
    outcome.warnings += (*warnings, *_remarks(work.island))


def _remarks(island):
    """What there is to say of how an island was made of its faces."""
    if island.turned_faces and not island.one_sided_edges:  # what is one-sided has no outside
        faces = count(island.turned_faces, "face")
        yield f"{faces} {'is' if island.turned_faces == 1 else 'are'} inside out: turned for the unwrap"
    if island.one_sided_edges:
        edges = count(island.one_sided_edges, "edge")
        yield f"it is one-sided, like a Möbius band: cut at {edges}; mark a seam across it to choose where"
    if island.doubled_faces == 1:
        yield "1 doubled face takes the UVs of its twin, and is not counted as an overlap"
    elif island.doubled_faces:
        yield f"{island.doubled_faces} doubled faces take the UVs of their twins, and are not counted as overlaps"
    if island.crowded_edges:
        yield f"it ends at {count(island.crowded_edges, 'edge')} where more than two faces meet"


def write(obj, works, cut=None):
    """Write the works' UVs into their object, and mark the new seams of a cut; call it in Object Mode."""
    try:
        mesh_arrays.write(obj, *corners_to_write(works))
    except UnwrapError as error:
        for work in works:
            work.outcome.error = str(error)
        return
    if cut is not None:
        _mark(cut, works)


def _mark(cut, works):
    """Mark the new seams beside islands that were unwrapped, and say how many."""
    beside = np.zeros(len(cut.new), bool)
    for work in works:
        its = np.unique(cut.mesh.corner_edge[work.island.corners])
        work.outcome.cut_edges = int(cut.new[its].sum())
        beside[its] = True
    if cut.mesh.welded_edge is not None:
        beside = beside[cut.mesh.welded_edge]
    cut.new &= beside
    if cut.new.any():
        mesh_arrays.mark_seams(cut.target.obj, cut.new)


def pack_apart(targets: Sequence[Target], options: MeshOptions, context: bpy.types.Context) -> None:
    """Pack the targets' islands, as they are, beside everything else in their meshes.

    Raises `UnwrapError` where Blender's packer fails; then nothing is changed.
    """
    found = [work for target in targets for work in _works(target, mesh_arrays.read(target.obj, options), Settings())]
    works = [work for work in found if work.old_uv is not None and not work.is_cut]
    if not works:
        return
    layout.pack_apart(works, options, context)
    for work in works:
        if work.outcome.error:
            raise UnwrapError(work.outcome.error)
    with modes.in_object_mode(context):
        for obj, group in itertools.groupby(works, key=lambda work: work.target.obj):
            mesh_arrays.write(obj, *corners_to_write(list(group)))
