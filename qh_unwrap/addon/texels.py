# SPDX-License-Identifier: GPL-3.0-or-later
"""Texel density: how many pixels of its image lie along a metre of a surface, and islands that get a given one."""

import numpy as np

from .work import maps, surfaces


def unit(scene):
    """Metres in a unit of the scene."""
    units = scene.unit_settings
    return units.scale_length if units.system != 'NONE' else 1.0


def density(pixels, area, metres):
    """Pixels along a metre, None where there are none, of an area in pixels and one in units of so many metres."""
    return (pixels / area) ** 0.5 / metres if pixels > 0 and area > 0 else None


def note(works, context):
    """Put into the outcomes of works that have UVs how large they are and what their texel density is."""
    if not works:
        return
    areas, in_map = _areas(works, maps(works))
    metres = unit(context.scene)
    for work, area, its in zip(works, areas.tolist(), in_map.tolist(), strict=True):
        picture = work.picture
        work.outcome.area = area
        pixels = its / work.aspect[0] * picture.pixels if picture else 0
        work.outcome.texel_density = density(pixels, area, metres)


def choose_scales(works, options, context):
    """Choose how long a unit of each work's surface shall be in its map, where that is not left to the placement.

    That is what the options give, or what the islands had; those that had no UVs get the mean of the others.
    """
    if options.texel_density == 'GIVEN':
        for work in works:
            work.scale = options.pixels_per_metre * unit(context.scene) / _side(work, options)
    elif options.texel_density == 'KEEP':
        old = [work for work in works if work.has_place]
        if not old:
            return
        areas, in_map = _areas(old, np.concatenate([work.old_uv for work in old]))
        mean = np.sqrt(in_map.sum() / areas.sum())
        for work in works:
            work.scale = mean
        for work, scale in zip(old, np.sqrt(in_map / areas).tolist(), strict=True):
            work.scale = scale


def _side(work, options):
    """Pixels along a unit of the map, which has the proportions of the image."""
    pixels = work.picture.pixels if work.picture else options.image_size**2
    return (pixels / work.aspect[0]) ** 0.5


def factors(works):
    """What to multiply each work's map with, (k,), so that it gets the scale that is chosen for it."""
    if not works:
        return np.zeros(0)
    areas, in_map = _areas(works, maps(works))
    return np.array([work.scale for work in works]) * np.sqrt(areas / np.where(in_map > 0, in_map, 1))


def _areas(works, uv):
    """The areas of the works, (k,), in space and in the maps `uv` (n, 2), which are one after another."""
    islands = surfaces(works)
    return islands.areas, islands.areas_in(uv)
