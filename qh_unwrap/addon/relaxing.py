# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxing and straightening the UVs that are selected: read, part into regions, relax, judge what is stored, write."""

import dataclasses
import itertools

import numpy as np

from ..core import Settings, Shape, UnwrapError
from ..core.regions import Connected, Selection
from ..core.relaxing import relax_islands, rim, straighten_islands
from ..core.stepping import mapped
from ..core.straightening import Polygons, rectangle, straight_lines
from . import judging, layout, mesh_arrays, modes, stacking, texels
from .mesh_islands import MeshIslands
from .outcome import Outcome
from .selection import Target
from .unwrapping import are_as_read, keep, tell_of_density, write
from .uv_selection import UVSelection
from .work import Work

_RELAXING = 0.9  # of all the work, by and large; the rest is to see what lies on what
_REACH = 2.0  # of an island's size, within which the outlines of others are looked at
NO_MAP = "it has no UV map: unwrap it first"
NO_ROOM = "nothing that is selected can move: select more, unpin some, or let outlines move"
STAYS = "its outline stays as it is: it would run over other islands"


def relax(chosen, settings, options, context):
    """Relax what is selected in UV maps; `chosen` are pairs of objects and `UVSelection`s.

    A generator: yields the share that is done, returns the outcomes of the regions that were selected; there are none
    where nothing is selected.  Nothing is written before all are done.
    """
    return (yield from _carried_out(chosen, _regions, _relaxed, settings, options, context))


def straighten(chosen, settings, options, context):
    """Straighten what is selected in UV maps, and relax the rest of its islands around it.

    A generator like `relax`; the outcomes are those of whole islands.
    """
    return (yield from _carried_out(chosen, _straight, _straightened, settings, options, context))


def _regions(obj, selected, settings, options):
    """The works of an object: regions whose UVs move, or what stands in the way."""
    if not selected.corners.any():
        return
    mesh = mesh_arrays.read(obj, options)
    if mesh.uv is None:
        yield _refused(obj, mesh, selected.faces, NO_MAP)
        return
    connected = _connected(mesh, selected)
    moving = connected.moving(settings.move_outline) & ~connected.spread(mesh.pinned)
    if not moving.any():
        yield _refused(obj, mesh, connected.faces_with(selected.corners), NO_ROOM)
        return
    yield from _works(obj, mesh, connected, connected.faces_with(moving), moving)


def _straight(obj, selected, settings, options):
    """The same of whole islands, with what is to be straight in them."""
    mesh = mesh_arrays.read(obj, options)
    is_rectangle = settings.shape == 'RECTANGLE'
    sides = selected.faces[mesh.corner_faces] if is_rectangle else selected.sides
    if not sides.any():
        return
    if mesh.uv is None:
        yield _refused(obj, mesh, selected.faces, NO_MAP)
        return
    everything = UVSelection(*(np.ones_like(each) for each in selected))
    connected = _connected(mesh, everything)
    moving = connected.moving(settings.move_outline) & ~connected.spread(mesh.pinned)
    chosen = np.zeros(len(mesh.face_start), dtype=bool)
    chosen[mesh.corner_faces[sides]] = True
    for work in _works(obj, mesh, connected, connected.whole_islands(chosen), moving):
        its = work.island.corners[: work.island.own_corners]
        if sides[its].any():
            try:
                work.straight = _what_is_straight(work, sides[its], settings)
            except UnwrapError as error:
                work.outcome.error = str(error)
            yield work


def _what_is_straight(work, selected, settings):
    if work.uv_fault:
        raise UnwrapError(f"{work.uv_fault}: unwrap it first")
    mesh, island = work.mesh, work.island
    corners, vertex = island.corners[: island.own_corners], island.corner_vertex[: island.own_corners]
    face = mesh.corner_faces[corners]
    is_last = np.diff(face, append=-1) != 0
    following = np.arange(1, len(corners) + 1)
    following[is_last] = np.flatnonzero(np.diff(face, prepend=-1) != 0)
    polygons = Polygons(vertex, vertex[following], face)
    # In what is true to scale a level line is level in the UVs, too.
    pinned = np.repeat(work.pinned[:, None], 2, axis=1)
    if settings.shape == 'RECTANGLE':
        return rectangle(polygons, work.vertices, work.old_uv, selected, pinned)
    return straight_lines(polygons, work.vertices, work.old_uv, selected, pinned, settings.along)


def _connected(mesh, selected):
    selection = Selection(selected.faces, selected.corners)
    return Connected(mesh.corner_vertex, mesh.corner_edge, mesh.face_start, len(mesh.seam), mesh.uv, selection)


def _works(obj, mesh, connected, faces, moving):
    """A work for each island that the faces make, of which the corners that are `moving`, (c,) bool, may move."""
    islands = connected.islands(faces, mesh.corner_triangles)
    target = Target(obj, faces)
    together, nowhere = MeshIslands(mesh, islands), np.zeros(len(moving), dtype=bool)
    for number, island in enumerate(islands):
        outcome = Outcome(obj.name, number + 1, island.faces, alone=len(islands) == 1)
        work = Work(target, mesh, island, outcome, Settings(boundary='KEEP'), nowhere, together, number)
        work.connected = connected
        work.moving = np.zeros(len(island.vertices), dtype=bool)
        work.moving[island.corner_vertex[moving[island.corners]]] = True
        yield work


def _refused(obj, mesh, faces, error):
    """An outcome for all of the faces, with the error; as a work, of which there is no island."""
    outcome = Outcome(obj.name, 1, np.flatnonzero(faces), error=error)
    return Work(Target(obj, faces), mesh, None, outcome, Settings(), None, None, 0)


def _carried_out(chosen, parted, improved, settings, options, context):
    """Have what is chosen `parted` into works and these `improved`, judge them and write them; yields the share that is
    done, returns their outcomes."""
    works = []
    for obj, selected in chosen:
        yield 0.0
        works += parted(obj, selected, settings, options)
    yield from mapped(lambda share: _RELAXING * share, improved(works, settings, options, context))
    placed = [work for work in works if work.uv is not None]
    if placed and are_as_read(works):
        judging.keep_what_was_valid(placed)
        yield _RELAXING
        judging.judge(placed)
        if settings.move_outline:
            steps = stacking.report_overlaps(placed, works, options)
            yield from mapped(lambda share: _RELAXING + (1 - _RELAXING) * share, steps)
        if are_as_read(works):
            with modes.in_object_mode(context):
                for obj, group in itertools.groupby(placed, key=lambda work: work.target.obj):
                    write(obj, list(group))
        texels.note([work for work in placed if work.uv is not None], context)
    return [work.outcome for work in works]


def _relaxed(works, settings, options, context):
    """Relax the works; those that run over others keep their outlines.  Yields the share that is done."""
    tried = [work for work in works if not work.outcome.error and _can_be_read(work, settings)]
    outlines = _Outlines(works) if settings.move_outline else None
    yield from _taken(tried, relax_islands([_shape(work, outlines) for work in tried], settings))
    if not settings.move_outline:
        tell_of_density(tried, options)
        return
    whole = [work for work in tried if work.uv is not None and work.moving.all()]
    if options.texel_density == 'GIVEN':  # else they keep theirs
        texels.choose_scales(whole, options, context)
        layout.resize(whole)
    bold = yield from _running_over(tried, works)
    for work in bold:
        work.scale, work.outcome.warnings = None, ()  # what there is to say of it is said anew
        work.moving[np.concatenate(work.loops)] = False
    held = dataclasses.replace(settings, move_outline=False)
    yield from _taken(bold, relax_islands([_shape(work) for work in bold], held))
    for work in bold:
        if work.moving.any():
            work.outcome.warnings += (STAYS,)
    tell_of_density(tried, options)


def _can_be_read(work, settings):
    fault = work.uv_fault
    if fault and (not settings.move_outline or not work.moving.all() or not np.isfinite(work.raw_uv).all()):
        work.outcome.error = f"{fault}: unwrap it first"
        return False
    work.in_frame = not fault
    return True


def _shape(work, outlines=None):
    walls = None if outlines is None else outlines.beside(work)
    its = dict(face=work.triangle_faces, importance=work.importance, walls=walls)
    return Shape(work.vertices, work.triangles, work.raw_uv, ~work.moving, **its)


class _Outlines:
    """The outlines of all islands that works may come near to, as segments in their UV maps."""

    def __init__(self, works):
        self._by_image = {}
        for mesh, connected in {id(work.mesh): (work.mesh, work.connected) for work in works}.values():
            if connected is None:
                continue
            sides = connected.outline_sides()
            sides = sides[np.isfinite(mesh.uv[sides]).all(axis=(1, 2))]
            for image, shown in mesh.faces_by_image():
                its = sides[shown[mesh.corner_faces[sides[:, 0]]]]
                self._by_image.setdefault(image, []).append((mesh, its[:, 0], mesh.uv[its]))

    def beside(self, work):
        """The segments (w, 2, 2) near a work that are not its own; None if there are none, or its outline stays."""
        if work.uv_fault or not work.moving[rim(work.triangles, len(work.moving))].any():
            return None
        low, high = work.old_uv.min(axis=0) / work.aspect, work.old_uv.max(axis=0) / work.aspect
        reach = _REACH * (high - low).max()
        own = np.zeros(len(work.mesh.corner_vertex), dtype=bool)
        own[work.island.corners] = True
        walls = [np.empty((0, 2, 2))]
        for mesh, corners, ends in self._by_image.get(work.image, ()):
            near = (ends.max(axis=1) >= low - reach).all(axis=1) & (ends.min(axis=1) <= high + reach).all(axis=1)
            if mesh is work.mesh:
                near &= ~own[corners]
            walls.append(ends[near])
        walls = np.concatenate(walls)
        return walls * work.aspect if len(walls) else None


def _running_over(works, all_works):
    """Which of the works lie on something now and did not before; a generator, which yields 1."""
    placed = [work for work in works if work.uv is not None]
    found = yield from mapped(lambda _: 1.0, stacking.new_overlaps_of(placed, all_works))
    return [work for work, others in zip(placed, found, strict=False) if others]


def _straightened(works, settings, _options, _context):
    """Straighten the works; yields the share that is done."""
    tried = [work for work in works if not work.outcome.error]
    shapes, outlines = [], _Outlines(works) if settings.move_outline else None
    for work in tried:
        straight = work.straight
        pinned = straight.held | ~work.moving[:, None]
        work.in_frame = True
        shape = _shape(work, outlines)
        shapes.append(dataclasses.replace(shape, uv=straight.values, pinned=pinned, start=work.old_uv))
    yield from _taken(tried, straighten_islands(shapes, settings))
    over = yield from _running_over(tried, works)
    for work in over:
        work.uv, work.outcome.error = None, "straightened, it would run over other islands: move these away first"


def _taken(works, steps):
    """Carry the steps out, whose results are those of the works."""
    results = yield from steps
    for work, result in zip(works, results, strict=True):
        if isinstance(result, UnwrapError):
            work.uv, work.outcome.error = None, str(result)
        else:
            keep(work, result)
