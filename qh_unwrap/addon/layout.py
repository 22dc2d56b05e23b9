# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the unwrapped islands go."""

import itertools

import numpy as np

from ..core import UnwrapError, placing
from ..core.triangles import areas_in_space
from . import packing, texels
from .work import maps, put_maps, surfaces

_SLACK = 1e-5  # of the square, by which islands may reach over its border


def place(works, all_works, options, context):
    works = [work for work in works if not work.in_frame]
    old, new = ([work for work in works if work.has_place == has_place] for has_place in (True, False))
    for work in works:
        work.mirrored = work.has_place and work.was_mirrored
        if work.mirrored:
            work.uv = work.uv * (-1, 1)
        if options.placement == 'UNIT':
            work.uv = placing.in_unit_square(work.uv / work.aspect) * work.aspect
    if old and options.placement != 'UNIT':
        islands = surfaces(old)
        onto = np.concatenate([work.old_triangles for work in old])
        put_maps(old, islands.of_each(placing.in_place(islands, maps(old), onto)))
    texels.choose_scales(works, options, context)
    if options.placement != 'PACK':
        resize(works if options.placement == 'UNIT' else old)
    if options.placement == 'UNIT':
        return
    if new:
        islands = surfaces(new)
        turned = placing.upright(islands, maps(new), np.array([work.mesh.up for work in new]))
        put_maps(new, islands.of_each(turned))
    if options.placement == 'PACK':
        _pack(works, options, True, context)
        _make_way(works, all_works)
    elif new:
        _pack(new, options, False, context)
        _move_beside(new, all_works)


def resize(works):
    """Give islands the scale that is chosen for them, around their middles."""
    works = [work for work in works if work.scale is not None]
    if not works:
        return
    islands, uv = surfaces(works), maps(works)
    middle = placing.centres(islands, uv)[islands.piece]
    resized = middle + (uv - middle) * texels.factors(works)[islands.piece, None]
    put_maps(works, islands.of_each(resized))


def pack_apart(works, options, context):
    """Pack islands as they are beside everything else in their meshes."""
    for work in works:
        work.uv = work.old_uv
    _pack(works, options, True, context)
    _move_beside(works, works)


def _move_beside(works, all_works):
    """Move packed islands to the first tile from the square on that nothing else in their meshes lies in."""
    tile = placing.free_tile(np.concatenate([np.empty((0, 2)), *_others(works, all_works)]))
    for work in works:
        if work.uv is not None:
            work.uv = work.uv + (tile, 0) * work.aspect


def _make_way(works, all_works):
    """Move packed islands to a free tile if islands that are held lie where they were packed, on the same image.

    Blender's packer can pack around pinned islands, but where these leave little room it shrinks the others to nothing.
    """
    held = {}
    for work in all_works:
        uv = work.uv if work.uv is not None else work.old_uv
        if work.in_frame and uv is not None:
            held.setdefault(work.image, []).append(uv / work.aspect)
    tiles = {image: placing.free_tile(np.concatenate(uvs)) for image, uvs in held.items()}
    for work in works:
        tile = tiles.get(work.image, 0)
        if tile and work.uv is not None:
            work.uv = work.uv + (tile, 0) * work.aspect
            work.outcome.warnings += ("it is packed beside the square, in which pinned islands lie",)


def _pack(works, options, nested, context):
    if not works:
        return
    works = sorted(works, key=lambda work: work.aspect[0])
    islands = surfaces(works)
    uv, enlarged = placing.to_scale(islands, maps(works), _importance(works))
    scaled = works[0].scale is not None  # as then all of them are
    if scaled:
        put_maps(works, islands.of_each(uv))
        factors = texels.factors(works)
        factors /= np.sqrt(((factors * np.ptp(islands.boxes(uv), axis=0).max(axis=1)) ** 2).sum())
        uv = uv * factors[islands.piece, None]
        enlarged = np.zeros(len(works), dtype=bool)
    try:
        packed = packing.pack(islands, uv, [work.aspect[0] for work in works], options, nested, context)
    except UnwrapError as error:
        for work in works:
            work.uv, work.outcome.error = None, str(error)
        return
    put_maps(works, islands.of_each(packed))
    for k in np.flatnonzero(enlarged).tolist():
        works[k].outcome.warnings += ("beside the others it would vanish: packed larger than its share",)
    if scaled:
        _resize_together(works)


def _importance(works):
    """How important the works are in the mean over their surface, (k,), None if all are alike."""
    if all(work.importance is None for work in works):
        return None
    return np.array(
        [
            1.0
            if work.importance is None
            else np.average(work.importance, weights=areas_in_space(work.vertices, work.triangles))
            for work in works
        ]
    )


def _resize_together(works):
    """Give packed islands the scales that are chosen for them, all by the same factor around the origin."""
    factor = float(np.median(texels.factors(works)))
    for work in works:
        work.uv = work.uv * factor
    if max((work.uv / work.aspect).max() for work in works) > 1 + _SLACK:
        for work in works:
            work.outcome.warnings += ("at this texel density the islands need more room than the 0 to 1 square",)


def _others(works, all_works):
    """The UVs (k, 2) of everything else in the works' meshes, where they mean anything."""
    mine = {id(work) for work in works}
    for work in all_works:
        if id(work) not in mine and work.uv is not None:
            yield work.uv / work.aspect
        elif id(work) not in mine and work.has_place:
            yield work.old_uv / work.aspect
    yield from (rest.reshape(-1, 2) for _, rest, _ in left_alone(all_works))


def left_alone(works):
    """The faces that are not unwrapped, of each mesh and image those whose UVs mean anything.

    Yields the object, their UVs as triangles (t, 3, 2), and the image.
    """
    for obj, group in itertools.groupby(works, key=lambda work: work.target.obj):
        work = next(group)
        mesh, faces = work.mesh, work.target.faces
        if mesh.uv is not None and not faces.all():
            face = mesh.corner_faces[mesh.corner_triangles[:, 0]]
            for image, shown in mesh.faces_by_image():
                rest = mesh.uv[mesh.corner_triangles[(shown & ~faces & ~mesh.fresh)[face]]]
                if placing.says_where(rest):
                    yield obj, rest, image
