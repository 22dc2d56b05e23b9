# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures as pixels: lines and letters become triangles, which are filled; needs no Blender."""

import numpy as np

_FINER = 3  # samples along the side of a pixel
_PORTION = 2_000_000  # samples that are looked at together: it bounds the memory


def pixels_of(figure, letters):
    """The picture (h, w, 3) of a `Figure`, from 0 to 1 and from top to bottom.

    `letters(text)` gives the letters of a text as triangles (t, 3, 2), of size 1, on a baseline from 0, with y upwards.
    """
    sheet = np.ones((figure.height * _FINER, figure.width * _FINER, 3), dtype=np.float32)
    for line in figure.lines:
        _fill(sheet, _stroke(line), line.colour)
    for text in figure.texts:
        triangles = letters(text.text)
        if len(triangles):
            _fill(sheet, _placed(triangles, text), text.colour)
    return sheet.reshape(figure.height, _FINER, figure.width, _FINER, 3).mean(axis=(1, 3))


def _placed(triangles, text):
    x, y = text.place
    width = triangles[..., 0].max()
    shift = {"start": 0, "middle": width / 2, "end": width}[text.anchor]
    return np.stack([x + text.size * (triangles[..., 0] - shift), y - text.size * triangles[..., 1]], axis=-1)


def _stroke(line):
    """The triangles of a line: a rectangle for each piece, a little longer, so that no gaps are at its corners."""
    ends = _dashed(line.points, line.dashes) if line.dashes else np.stack([line.points[:-1], line.points[1:]], axis=1)
    along = ends[:, 1] - ends[:, 0]
    along = along * (line.width / 2) / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    across = along[:, ::-1] * (-1, 1)
    longer = 0 if line.dashes else 0.5
    start, end = ends[:, 0] - longer * along, ends[:, 1] + longer * along
    a, b, c, d = start - across, end - across, end + across, start + across
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _dashed(points, dashes):
    """The pieces (k, 2, 2) of a line that are drawn."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    place = np.append(0, np.cumsum(steps))
    marks = np.cumsum(np.tile(dashes, int(np.ceil(place[-1] / sum(dashes))) + 1))
    cuts = np.unique(np.concatenate([place, marks[marks < place[-1]]]))
    at = np.column_stack([np.interp(cuts, place, values) for values in points.T])
    middle = (cuts[:-1] + cuts[1:]) / 2
    drawn = np.searchsorted(marks, middle) % 2 == 0
    return np.stack([at[:-1], at[1:]], axis=1)[drawn]


def _fill(sheet, triangles, colour):
    """Fill triangles (t, 3, 2), in pixels, with a colour."""
    corners = triangles * _FINER
    height, width = sheet.shape[:2]
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, (width, height)).astype(int)
    high = np.clip(np.floor(corners.max(axis=1) - 0.5) + 1, 0, (width, height)).astype(int)
    size = np.maximum(high - low, 0)
    count = size.prod(axis=1)
    flat = sheet.reshape(-1, 3)
    for chosen in np.array_split(np.flatnonzero(count), count.sum() // _PORTION + 1):
        triangle = np.repeat(chosen, count[chosen])
        within = np.arange(len(triangle)) - np.repeat(np.cumsum(count[chosen]) - count[chosen], count[chosen])
        column = low[triangle, 0] + within % np.maximum(size[triangle, 0], 1)
        row = low[triangle, 1] + within // np.maximum(size[triangle, 0], 1)
        centre = np.column_stack([column, row]) + 0.5
        sides = np.array([_side(corners[triangle, k], corners[triangle, k - 2], centre) for k in range(3)])
        inside = (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
        flat[(row * width + column)[inside]] = rgb(colour)


def _side(start, end, point):
    """On which side of a line each point is, (k,), by the sign."""
    (x, y), (px, py) = (end - start).T, (point - start).T
    return x * py - y * px


def rgb(colour):
    """The three parts of a colour "#rrggbb", from 0 to 1."""
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
