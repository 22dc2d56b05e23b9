# SPDX-License-Identifier: GPL-3.0-or-later
"""Published measures of what was unwrapped, taken from the UVs as they are stored."""

import dataclasses

import numpy as np

from ..core.published import published_of_islands
from ..core.triangles import signed_areas
from . import mesh_arrays


def add_published(outcomes, targets, options):
    """Give the outcomes of islands that have new UVs their published measures; returns those of all together."""
    done = [outcome for outcome in outcomes if not outcome.error]
    if not done:
        return None
    own = {}
    for k, outcome in enumerate(done):
        own.setdefault(outcome.obj, []).append((k, outcome.face_indices))
    space, plane, island = [], [], []
    for target in targets:
        if target.obj.name not in own:
            continue
        mesh = mesh_arrays.read(target.obj, dataclasses.replace(options, weld=False))
        numbers = np.full(len(mesh.face_start), -1)
        for k, faces in own[target.obj.name]:
            numbers[faces] = k
        number = numbers[mesh.corner_faces[mesh.corner_triangles[:, 0]]]
        order = np.flatnonzero(number >= 0)
        order = order[np.argsort(number[order], kind="stable")]
        corners = mesh.corner_triangles[order]
        aspect = mesh.aspect[mesh.corner_faces[corners]]
        space.append(mesh.vertices[mesh.corner_vertex[corners]])
        plane.append(mesh.uv[corners] * np.stack([aspect, np.ones_like(aspect)], axis=-1))
        island.append(number[order])
    space, plane, island = (np.concatenate(each) for each in (space, plane, island))
    mirrored = np.bincount(island, signed_areas(plane), len(done)) < 0
    measures = published_of_islands(
        space, plane * np.where(mirrored[island, None, None], (-1, 1), 1), island, len(done)
    )
    for k, outcome in enumerate(done):
        outcome.published = measures, k
    return measures.whole
