# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tiles islands lie in, and whether their images have these; needs no Blender."""

import numpy as np

ONLY = frozenset([1001])  # the tiles of an image that has no others: the 0 to 1 square
_ROW = 10  # tiles
_SLACK = 1e-5  # of a tile, by which an island may reach over its border


def faults(low, high, present):
    """What is wrong with where each island lies, an empty text for nothing.

    low, high  (k, 2) the corners of the islands' boxes
    present    for each of them the numbers of the tiles that its image has
    """
    first, last = np.floor(low + _SLACK), np.maximum(np.ceil(high - _SLACK) - 1, np.floor(low + _SLACK))
    within = (first == last).all(axis=1)
    tile = np.where((first[:, 0] >= 0) & (first[:, 0] < _ROW) & (first[:, 1] >= 0), 1001 + first @ (1, _ROW), 0)
    return [
        _fault(*each)
        for each in zip(within.tolist(), np.minimum(tile, 1e9).astype(np.int64).tolist(), present, strict=True)
    ]


def _fault(is_within, tile, present):
    if not is_within:
        return "it reaches over the border of its tile: move it within one"
    if tile in present:
        return ""
    where = f"it lies in tile {tile}" if tile else "it lies outside of all tiles"
    missing = "which its image does not have" if len(present) > 1 else "outside of the 0 to 1 square"
    return f"{where}{f', {missing}' if tile else ''}: move it to one that there is"
