# SPDX-License-Identifier: GPL-3.0-or-later
"""A small picture of the UVs of a run on a file, drawn without Blender's renderer."""

import struct
import zlib

import bpy
import numpy as np

from . import mesh_arrays

_SIZE = 128  # pixels along a side
_PALETTE = bytes((255, 255, 255, 205, 215, 230, 120, 140, 170, 20, 30, 50))  # paper, frame, edges, outlines
_FRAME, _EDGE, _OUTLINE = 1, 2, 3


def png(outcomes, places):
    """The bytes of a .png file with the islands' edges and, darker, their outlines; the unit square is framed."""
    segments = [_segments(*each) for each in _corners(outcomes, places)]
    if not segments:
        return b""
    ends, outlined = (np.concatenate(each) for each in zip(*segments, strict=True))
    low = np.minimum(ends.min(axis=(0, 1)), 0)
    high = np.maximum(ends.max(axis=(0, 1)), 1)
    scale = (_SIZE - 3) / (high - low).max()
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    frame = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    pixels = np.zeros((_SIZE, _SIZE), dtype=np.uint8)
    for lines, color in ((frame, _FRAME), (ends[~outlined], _EDGE), (ends[outlined], _OUTLINE)):
        _draw(pixels, (lines - low) * scale + 1, color)
    return _encoded(pixels[::-1])


def _corners(outcomes, places):
    """Yield of each mesh the UVs of its corners, and the sizes of the faces that were unwrapped, one after another."""
    faces = {}
    for outcome, place in zip(outcomes, places, strict=True):
        if not outcome.error:
            faces.setdefault((outcome.obj, place["map"]), []).append(outcome.face_indices)
    for (name, layer), indices in faces.items():
        mesh = bpy.data.objects[name].data
        start, size = (np.empty(len(mesh.polygons), dtype=np.int32) for _ in range(2))
        mesh.polygons.foreach_get("loop_start", start)
        mesh.polygons.foreach_get("loop_total", size)
        index = np.concatenate(indices)
        start, size = start[index], size[index]
        offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        yield np.nan_to_num(mesh_arrays.uvs(mesh, layer)[np.repeat(start, size) + offset]), size


def _segments(uv, size):
    """The ends (e, 2, 2) of the edges, each once, and which of them belong to one face alone."""
    start = np.cumsum(size) - size
    following = np.arange(1, len(uv) + 1)
    following[start + size - 1] = start
    ends = np.stack([uv, uv[following]], axis=1)
    swapped = (ends[:, 0, 0] > ends[:, 1, 0]) | ((ends[:, 0, 0] == ends[:, 1, 0]) & (ends[:, 0, 1] > ends[:, 1, 1]))
    ends[swapped] = ends[swapped][:, ::-1]
    kept, count = np.unique(ends.reshape(-1, 4), axis=0, return_counts=True)
    return kept.reshape(-1, 2, 2).astype(np.float64), count == 1


def _draw(pixels, ends, color):
    """Color the pixels under lines (e, 2, 2), by points along them."""
    steps = np.ceil(np.abs(ends[:, 1] - ends[:, 0]).max(axis=1)).astype(int) + 1
    which = np.repeat(np.arange(len(ends)), steps)
    along = (np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)) / np.maximum(steps - 1, 1)[which]
    points = ends[which, 0] + along[:, None] * (ends[which, 1] - ends[which, 0])
    x, y = np.clip(np.rint(points), 0, _SIZE - 1).astype(int).T
    pixels[y, x] = color


def _encoded(pixels):
    """A .png file with four colors, as its specification (ISO/IEC 15948) has it."""
    quads = pixels.reshape(_SIZE, -1, 4)
    packed = (quads << np.array([6, 4, 2, 0], dtype=np.uint8)).sum(axis=2).astype(np.uint8)
    rows = np.hstack([np.zeros((_SIZE, 1), dtype=np.uint8), packed])
    header = struct.pack(">IIBBBBB", _SIZE, _SIZE, 2, 3, 0, 0, 0)
    parts = ((b"IHDR", header), (b"PLTE", _PALETTE), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(map(_chunk, *zip(*parts, strict=True)))


def _chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
