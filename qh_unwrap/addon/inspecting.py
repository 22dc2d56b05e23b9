# SPDX-License-Identifier: GPL-3.0-or-later
"""Checking the UVs that objects have, whoever made them: reads them, writes nothing, and says what there is to say."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.distortion import Distortion
from ..core.inspection import inspect
from ..core.pieces import around_faces, starts_of_numbers
from ..core.published import Published, published_of_islands
from ..core.stepping import mapped
from ..core.triangles import areas_of, boxes_of, signed_areas
from ..core.uv_islands import uv_islands
from . import mesh_arrays, texels, tiles
from .joined_meshes import JoinedMeshes
from .last_run import last_run
from .options import MeshOptions
from .outcome import Outcome, count
from .selection import Target

KINDS = ("flipped", "mirrored", "overlapping", "worst")  # of faces that a check finds
_WORST = 0.01  # of the faces, those that count as the worst
_UNDISTORTED = 1 + 1e-6  # energy up to which a face is not distorted at all
_NAMED = 5  # of the islands that one lies on


@dataclass(frozen=True, eq=False)
class Check:
    """What was found in all islands together, and in which faces of each object."""

    face_counts: dict[str, int]  # of each object's mesh
    faces: dict[str, dict[str, np.ndarray]]  # of each of the `KINDS` the faces (k,), by the names of objects
    whole: Distortion | None = None
    published: Published | None = None
    texel_density: float | None = None

    def to_dict(self):
        """JSON-ready."""
        return dict(
            distortion=self.whole and self.whole.to_dict(),
            texel_density=self.texel_density,
            **{f"{kind}_faces": sum(map(len, its.values())) for kind, its in self.faces.items()},
        )


def check_targets(
    targets: Sequence[Target], context: bpy.types.Context, options: MeshOptions | None = None
) -> Generator[float, None, list[Outcome]]:
    """Check the UVs of the targets' faces.  A generator: yields the share that is done, returns the outcomes."""
    meshes = []
    for target in targets:
        yield 0.0
        meshes.append(mesh_arrays.read(target.obj, options))
    joined = JoinedMeshes(targets, meshes)
    errors = [Outcome(name, 0, faces, is_check=True, error=reason) for reason, name, faces in joined.left_out()]
    if joined.selected.any():
        islands, found = yield from mapped(lambda share: 0.1 + 0.7 * share, inspected(joined))
        outcomes = _outcomes(joined, islands, found)
        _number(outcomes + errors)
        _tell_of_overlaps(outcomes, found)
        yield 0.8
        check = _measured(joined, islands, found, outcomes, texels.unit(context.scene))
    else:
        outcomes, check = [], Check(joined.face_counts, {kind: {} for kind in KINDS})
        _number(errors)
    outcomes += errors
    last_run.remember_check(outcomes, check)
    return outcomes


def inspected(joined):
    """The islands of the selected faces of `JoinedMeshes`, and the `Inspection` of them.  A generator: yields the share
    that is done."""
    topology = joined.corner_vertex, joined.corner_edge, joined.face_start, joined.edge_count, joined.corner_triangles
    islands = uv_islands(*topology, joined.uv, joined.selected)
    slot = _slots(joined, islands)
    places = joined.points, joined.uv, joined.slot_aspect[slot], joined.sheets[slot], joined.face_start
    found = yield from inspect(islands, *places)
    return islands, found


def _slots(joined, islands):
    """The number of the material that most faces of each island have, (k,), the first of several."""
    faces = np.flatnonzero(joined.selected)
    slots = len(joined.images)
    keys, uses = np.unique(islands.face_island[faces] * slots + joined.slot[faces], return_counts=True)
    island, slot = np.divmod(keys, slots)
    order = np.lexsort((slot, -uses, island))
    return slot[order][starts_of_numbers(island[order], islands.count)]


def _outcomes(joined, islands, found):
    """What there is to say of the islands' faces, without their numbers."""
    order = np.flatnonzero(joined.selected)
    order = order[np.argsort(islands.face_island[order], kind="stable")]
    ends = [*starts_of_numbers(islands.face_island[order], islands.count).tolist(), len(order)]
    names = [joined.targets[k].obj.name for k in joined.object_of(order[ends[:-1]]).tolist()]
    faces = order - joined.face_starts[joined.object_of(order)]
    outcomes = [
        Outcome(name, 0, faces[start:end], after=distortion, injective=certified, is_check=True)
        for name, start, end, distortion, certified in zip(
            names, ends[:-1], ends[1:], found.measured.islands, found.certified.tolist(), strict=True
        )
    ]
    for k in np.flatnonzero(~found.certified).tolist():
        outcomes[k].faults += tuple(_faults(found.measured.islands[k], found.overlaps_itself[k]))
    for k in np.flatnonzero(found.measured.mirrored).tolist():
        outcomes[k].mirrored = True
        outcomes[k].notes += ("it is mirrored",)
    turned = np.bincount(islands.face_island[islands.turned_faces], minlength=islands.count)
    for k in np.flatnonzero(turned).tolist():
        its = f"{count(int(turned[k]), 'face')} {'is' if turned[k] == 1 else 'are'}"
        outcomes[k].notes += (f"{its} inside out, which is not counted as flipped",)
    return outcomes


def _faults(distortion, overlaps_itself):
    """What is wrong with the triangles of an island."""
    if distortion.flips:
        yield f"{count(distortion.flips, 'triangle')} {'is' if distortion.flips == 1 else 'are'} flipped"
    if distortion.collapsed:
        its = f"{count(distortion.collapsed, 'triangle')} {'has' if distortion.collapsed == 1 else 'have'}"
        yield f"{its} no area in the map"
    if overlaps_itself:
        yield "it overlaps itself"


def _number(outcomes):
    """Number the outcomes of each object."""
    groups = {}
    for outcome in outcomes:
        groups.setdefault(outcome.obj, []).append(outcome)
    for group in groups.values():
        for number, outcome in enumerate(group, start=1):
            outcome.number, outcome.alone = number, len(group) == 1


def _tell_of_overlaps(outcomes, found):
    """Tell of each island what it lies on, and what it is stacked with on purpose."""
    others = {}
    for one, other in found.pairs.tolist():
        others.setdefault(one, []).append(other)
        others.setdefault(other, []).append(one)
    labels = [outcome.label for outcome in outcomes] if others else []
    for k in np.flatnonzero(found.grazes).tolist():
        outcomes[k].notes += ("it touches another island, and by rounding alone lies on it",)
    size = np.bincount(found.stack, minlength=len(outcomes))[found.stack]
    for k in np.flatnonzero(size > 1).tolist():
        outcomes[k].stacked = int(size[k]) - 1
        outcomes[k].notes += (f"it is stacked with {count(int(size[k]) - 1, 'other')}, face on face",)
    for k in np.flatnonzero(np.isin(found.stack, list(others))).tolist():
        its = sorted(others[int(found.stack[k])])
        outcomes[k].overlaps = tuple(labels[other] for other in its[:_NAMED])
        outcomes[k].more_overlaps = len(its[_NAMED:])
        outcomes[k].overlap_cure = "move it to a free place, or pack them together"


def _measured(joined, islands, found, outcomes, metres):
    """The `Check`, after the outcomes got their measures, densities and tiles."""
    slot = _slots(joined, islands)
    space, plane = joined.points[islands.corners], joined.uv[islands.corners]
    scale = np.column_stack([joined.slot_aspect[slot], np.ones(islands.count)])
    scale[found.measured.mirrored] *= (-1, 1)
    seen = plane * scale[islands.island, None]
    measures = published_of_islands(space, seen, islands.island, islands.count)
    area = np.bincount(islands.island, areas_of(space), islands.count)
    pixels = joined.pixels[slot] * np.bincount(islands.island, np.abs(signed_areas(plane)), islands.count)
    starts, (low, high) = islands.triangle_starts, boxes_of(plane)
    low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
    misplaced = tiles.faults(low, high, [joined.tiles[k] for k in slot.tolist()])
    rows = zip(outcomes, area.tolist(), pixels.tolist(), misplaced, strict=True)
    for k, (outcome, its_area, its_pixels, fault) in enumerate(rows):
        outcome.area, outcome.published = its_area, (measures, k)
        outcome.texel_density = texels.density(its_pixels, its_area, metres)
        outcome.faults += (fault,) if fault else ()
    shown = joined.pixels[slot] > 0
    return Check(
        joined.face_counts,
        {kind: joined.split(faces) for kind, faces in _faces(joined, islands, found).items()},
        found.measured.whole,
        measures.whole,
        texels.density(float(pixels[shown].sum()), float(area[shown].sum()), metres),
    )


def _faces(joined, islands, found):
    """The faces (k,) of each of the `KINDS`."""
    face = around_faces(joined.face_start, len(joined.corner_vertex))[0][islands.corners[:, 0]]
    energy = np.zeros(len(joined.face_start))
    np.maximum.at(energy, face, found.measured.energy)
    distorted = np.flatnonzero(energy > _UNDISTORTED)
    most = int(np.ceil(_WORST * joined.selected.sum()))
    worst = distorted[np.argsort(-energy[distorted], kind="stable")[:most]]
    kinds = (
        face[found.measured.orientation < 0],
        face[found.measured.mirrored[islands.island]],
        face[found.covered],
        worst,
    )
    return {kind: np.unique(its) for kind, its in zip(KINDS, kinds, strict=True)}
