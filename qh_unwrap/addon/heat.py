# SPDX-License-Identifier: GPL-3.0-or-later
"""Distortion as colours: what each triangle of a mesh gets, and the legend; needs no Blender."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.distortion import measure_corners
from ..core.pieces import around_faces, first_and_last
from ..core.triangles import areas_of, normals, signed_areas
from ..core.uv_islands import uv_islands

_PIXELS = 1024  # along the sides of an image that is not there
_FULL = 1 - 1e-5  # of the scale, from where on a color is at its strongest
_LIGHT = np.array([0.35, -0.45, 0.82])
_SHADOW = 0.45  # how much darker than in full light a face turned away from it is

# From light to dark, so that they can be told apart without seeing red or green.
_SEQUENTIAL = np.array([(0.97, 0.97, 0.95), (0.99, 0.82, 0.55), (0.95, 0.45, 0.24), (0.70, 0.02, 0.08)])
_DIVERGING = np.array(
    [(0.08, 0.30, 0.60), (0.45, 0.68, 0.85), (0.97, 0.97, 0.95), (0.95, 0.62, 0.47), (0.70, 0.02, 0.08)]
)
WRONG = (0.03, 0.03, 0.03)
NOTHING = (0.45, 0.45, 0.45)  # without UVs


@dataclass(frozen=True)
class Heat:
    """Measures of the triangles of a mesh that is shown, (t,) each."""

    corners: np.ndarray  # (t, 3) of the mesh
    stretch: np.ndarray
    angle: np.ndarray
    log_area: np.ndarray
    wrong: np.ndarray  # bool, flipped in the map or without area there
    area: np.ndarray  # on the surface, in the scene's units
    texels: np.ndarray  # how many the triangle covers
    face: np.ndarray  # the number of its face
    has_image: bool  # else the texels are those of one that is not there
    outline: np.ndarray  # (k, 2) corners, the sides of faces along the outlines of the islands in the map


def measured(shown):
    """The `Heat` of a `ShownMesh`, None if it has no UVs or no faces."""
    if shown.uv is None or not shown.visible.any():
        return None
    known = np.isfinite(shown.uv).all(axis=1)
    uv = np.where(known[:, None], shown.uv, 0)
    edges = shown.corner_edge, shown.face_start, shown.edge_count
    islands = uv_islands(shown.corner_vertex, *edges, shown.triangles, uv, shown.visible)
    corner_face, following = around_faces(shown.face_start, len(uv))
    corners, face = islands.corners, corner_face[islands.corners[:, 0]]
    points = (shown.points @ shown.linear.T)[shown.corner_vertex[corners]].astype(float)
    uv = uv[corners].astype(float)
    texels = np.abs(signed_areas(uv)) * np.where(shown.pixels > 0, shown.pixels, _PIXELS**2)[face]
    uv[..., 0] *= shown.aspect[face, None]
    found = measure_corners(points, uv, islands.island)
    stretch, angle, log_area = (
        np.concatenate([getattr(its, f"triangle_{name}") for its in found.islands])
        for name in ("stretch", "angle", "log_area")
    )
    sides = _outline(islands, shown, following, corner_face)
    return Heat(
        corners=corners,
        stretch=stretch,
        angle=angle,
        log_area=log_area,
        wrong=(found.orientation <= 0) | ~known[corners].all(axis=1),
        area=areas_of(points),
        texels=texels,
        face=face,
        has_image=bool((shown.pixels[face] > 0).all()),
        outline=np.column_stack([sides, following[sides]]),
    )


def _outline(islands, shown, following, corner_face):
    """The corners (k,) that start the sides of faces where islands end."""
    corners = np.flatnonzero(shown.visible[corner_face])
    edge = shown.corner_edge[corners]
    ends = islands.corner_vertex[corners], islands.corner_vertex[following[corners]]
    key = np.minimum(*ends) * np.int64(len(corner_face)) + np.maximum(*ends)
    one, other = first_and_last(key, edge, shown.edge_count)
    inner = (np.bincount(edge, minlength=shown.edge_count) == 2) & (one == other)
    return corners[~inner[edge]]


class Legend(NamedTuple):
    """What the colours of a heatmap mean."""

    title: str
    colours: np.ndarray  # (k, 3) from the one end of the scale to the other, in even steps
    ticks: tuple  # the words below the scale, evenly from end to end
    lines: tuple  # sentences


def coloured(heats, settings):
    """The colours (t, 3) of the triangles of each `Heat`, all by the same scale, and the `Legend`.

    A face has one colour, the mean of its triangles; black are triangles that are flipped or have no area in the map.
    `None` among the heats, for what has no UVs, stays `None`.
    """
    quantity, limit = settings.quantity, settings.limit
    known = [heat for heat in heats if heat is not None]
    mean = _mean(known, quantity)
    ramp = _DIVERGING if quantity in _BOTH_WAYS else _SEQUENTIAL
    low = -1 if quantity in _BOTH_WAYS else 0
    values = [_logarithms(heat, quantity, mean) for heat in known]
    scaled = [np.clip(value / np.log(limit), low, 1) for value in values]
    found = iter(_coloured(heat, each, ramp, low) for heat, each in zip(known, scaled, strict=True))
    colours = [None if heat is None else next(found) for heat in heats]
    return colours, _legend(known, values, scaled, settings, mean, ramp, missing=len(heats) - len(known))


_BOTH_WAYS = ('AREA', 'DENSITY')


def _logarithms(heat, quantity, mean):
    """How far each triangle is from what is ideal, (t,): 0 is ideal, and what is positive gets red."""
    if quantity == 'STRETCH':
        return np.log(np.maximum(heat.stretch, 1e-30))
    if quantity == 'ANGLE':
        return np.log(heat.angle)
    if quantity == 'AREA':
        return -heat.log_area
    with np.errstate(divide="ignore", invalid="ignore"):
        density = np.log(heat.texels / heat.area) / 2
    return np.log(max(mean, 1e-30)) - np.clip(np.nan_to_num(density), -100, 100)


def _mean(heats, quantity):
    """Over the whole surface, what is ideal: texels along a metre, from areas; 1 for the ratios."""
    area = sum(heat.area.sum() for heat in heats)
    if quantity != 'DENSITY':
        return 1.0
    return float(np.sqrt(sum(heat.texels.sum() for heat in heats) / area)) if area else 0.0


def _coloured(heat, scaled, ramp, low):
    weight = np.maximum(heat.area, 1e-12 * (heat.area.max() or 1.0))
    of_face = np.bincount(heat.face, weight * scaled) / np.maximum(np.bincount(heat.face, weight), 1e-300)
    place = (of_face[heat.face] - low) / (1 - low) * (len(ramp) - 1)
    colours = np.column_stack([np.interp(place, np.arange(len(ramp)), channel) for channel in ramp.T])
    colours[heat.wrong] = WRONG
    return colours.astype(np.float32)


def _legend(heats, values, scaled, settings, mean, ramp, missing):
    quantity, limit = settings.quantity, settings.limit
    label = next(choice.label for choice in _choices(settings) if choice.identifier == quantity)
    lines = list(_meaning(quantity, limit, mean))
    area = sum(heat.area.sum() for heat in heats)
    if area:
        red = sum(heat.area[each >= _FULL].sum() for heat, each in zip(heats, scaled, strict=True)) / area
        if quantity in _BOTH_WAYS:
            blue = sum(heat.area[each <= -_FULL].sum() for heat, each in zip(heats, scaled, strict=True)) / area
            lines.append(f"Of the surface {_percent(red)} is that red, {_percent(blue)} that blue")
        else:
            lines.append(f"{_spread(heats, values)}; {_percent(red)} of the surface is that red")
    if quantity == 'DENSITY' and not all(heat.has_image for heat in heats):
        lines.append(f"As if what has no image had one of {_PIXELS} pixels")
    wrong = sum(int(heat.wrong.sum()) for heat in heats)
    if wrong:
        triangles = "1 triangle is" if wrong == 1 else f"{wrong} triangles are"
        lines.append(f"Black: {triangles} flipped or without area in the map")
    if missing:
        lines.append("Gray: no UVs")
    return Legend(label, ramp, _ticks(quantity, limit, mean), tuple(lines))


def _spread(heats, values):
    """What half of the surface stays below, and what nearly all of it does: a single triangle does not count."""
    value, area = np.concatenate(values), np.concatenate([heat.area for heat in heats])
    order = np.argsort(value)
    part = np.cumsum(area[order])
    half, nearly_all = np.exp(value[order[np.searchsorted(part, np.array([0.5, 0.95]) * part[-1])]])
    return f"Half below {_rounded(half)}, 95 % below {_rounded(nearly_all)}"


def _choices(settings):
    return type(settings).__dataclass_fields__["quantity"].metadata["choices"]


def _percent(share):
    """As people say it: what is there is never called 0 %."""
    if share <= 0:
        return "0 %"
    if share < 0.001:
        return "less than 0.1 %"
    return f"{100 * share:.2g} %" if share < 0.095 else f"{100 * share:.0f} %"


def _meaning(quantity, limit, mean):
    if quantity == 'STRETCH':
        yield f"Red: the image is drawn out to {limit:.4g} times its size, or more"
    elif quantity == 'ANGLE':
        yield f"Red: squares become {limit:.4g} times as long as wide, or longer"
    elif quantity == 'AREA':
        yield f"Red: 1/{limit:.4g} of its share of the image, or less"
        yield f"Blue: {limit:.4g} times its share, or more"
    else:
        yield f"Red: {_rounded(mean / limit)} pixels per metre, or fewer"
        yield f"Blue: {_rounded(mean * limit)}, or more; the mean is {_rounded(mean)}"


def _ticks(quantity, limit, mean):
    """From left to right, in even steps of the ratio."""
    root = np.sqrt(limit)
    if quantity == 'DENSITY':
        return tuple(_rounded(mean * ratio) for ratio in (limit, 1, 1 / limit))
    if quantity == 'AREA':
        return f"× {limit:.4g}", "1", f"1/{limit:.4g}"
    return "1", f"{root:.3g}", f"{limit:.4g}"


def _rounded(number):
    return f"{number:.3g}" if number < 1000 else f"{number:.0f}" if number < 1e6 else "a million"


def lit(colours, heat_points):
    """The colours (t, 3) of triangles with corners (t, 3, 3) in the light of a lamp, so that the shape can be seen."""
    normal = normals(heat_points.astype(float))
    length = np.linalg.norm(normal, axis=1)
    towards = normal @ (_LIGHT / np.linalg.norm(_LIGHT)) / np.where(length > 0, length, 1)
    return (colours * (1 - _SHADOW * (1 - towards) / 2)[:, None]).astype(np.float32)
