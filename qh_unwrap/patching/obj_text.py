# SPDX-License-Identifier: GPL-3.0-or-later
"""New `vt` lines and texture indices in the text of an OBJ file.

A UV that changes stays in its line where that is free, so that the faces that use it need not change.  Where a UV
becomes several, lines are added before the first face that needs them, and later UVs get other numbers.
"""

import re

import numpy as np

_WORD = re.compile(rb"[^\s\\]+")
_CORNER = re.compile(rb"(?<![^\s\\])(-?\d+)(?:/(-?\d*))?(/-?\d*)?(?![^\s\\])")


def patched(obj, uv, changed):
    """The text of an `ObjOriginal` with other UVs.

    uv       (c, 2) float32, of all corners of the faces that changed
    changed  (f,) bool
    """
    slots = _Slots(obj, uv, changed)
    lines = list(obj.lines)
    for number, values in slots.moved.items():
        lines[obj.vt_line[number]] = _with_uv(lines[obj.vt_line[number]], values)
    _renumber(obj, slots, lines)
    added = {}
    for line, values in zip(slots.added_line, slots.added_uv, strict=True):
        end = b"\r\n" if obj.lines[line].endswith(b"\r\n") else b"\n"
        added.setdefault(line, []).append(b"vt " + b" ".join(map(_number, values)) + end)
    for line, texts in added.items():
        lines[line] += b"".join(texts)
    return b"".join(lines)


class _Slots:
    """Where every UV goes.

    corner_slot  (c,) the UV of each corner: old ones by their numbers, then those that are added; -1 for none
    moved        the new values of old UVs, by their numbers
    added_line   after which line each of the new ones stands; added_uv their values
    """

    def __init__(self, obj, uv, changed):
        self._obj, self._count = obj, len(obj.vt)
        self.moved, self.added_line, self.added_uv = {}, [], []
        self.corner_slot = obj.corner_vt.copy()
        old = np.where((obj.corner_vt >= 0)[:, None], obj.vt[obj.corner_vt] if self._count else np.nan, np.nan)
        self._moving = changed[obj.corner_face] & ~(old == uv).all(axis=1) & ~np.isnan(uv).any(axis=1)
        self._place(uv)

    def _place(self, uv):
        obj = self._obj
        stays = np.zeros(self._count, dtype=bool)
        stays[[number for line in obj.others for number in references(obj, line)]] = True
        kept = ~self._moving & (obj.corner_vt >= 0)
        stays[obj.corner_vt[kept]] = True
        free = np.zeros(self._count, dtype=bool)
        free[obj.corner_vt[self._moving & (obj.corner_vt >= 0)]] = True
        free &= ~stays
        corners = np.flatnonzero(self._moving)
        keys = [
            (vertex, *pair)
            for vertex, pair in zip(obj.corner_vertex[corners].tolist(), (uv[corners] + 0).tolist(), strict=True)
        ]
        line = obj.face_line[obj.corner_face[corners]].tolist()
        place = self._shared(kept, set(keys))
        vt_line, own = obj.vt_line.tolist(), obj.corner_vt[corners].tolist()

        def is_above(slot, face_line):
            return (vt_line[slot] if slot < self._count else self.added_line[slot - self._count]) < face_line

        for key, slot, face_line in zip(keys, own, line, strict=True):
            if slot >= 0 and free[slot] and not (key in place and is_above(place[key], face_line)):
                free[slot] = False
                self.moved[slot] = key[1:]
                place[key] = slot
        pools = self._pools(free)
        groups = np.searchsorted(obj.object_line, line).tolist()
        before = (obj.data_line[np.searchsorted(obj.data_line, line) - 1] if len(obj.data_line) else []).tolist()
        for number, (key, face_line) in enumerate(zip(keys, line, strict=True)):
            if key in place and is_above(place[key], face_line):
                continue
            pool = pools.get(groups[number])
            if pool and vt_line[pool[-1]] < face_line:
                slot = pool.pop()
                self.moved[slot] = key[1:]
            else:
                slot = self._count + len(self.added_uv)
                self.added_line.append(before[number])
                self.added_uv.append(key[1:])
            place[key] = slot
        self.corner_slot[corners] = [place[key] for key in keys]

    def _shared(self, kept, keys):
        """The UVs that stay, by their points and values, where a corner that changes has the same ones."""
        obj = self._obj
        vertices = np.zeros(obj.corner_vertex.max(initial=-1) + 1, dtype=bool)
        vertices[[key[0] for key in keys]] = True
        corners = np.flatnonzero(kept & vertices[obj.corner_vertex])
        place = {}
        for corner in corners.tolist():
            slot = int(obj.corner_vt[corner])
            key = (int(obj.corner_vertex[corner]), *(obj.vt[slot] + 0).tolist())
            if key in keys:
                place.setdefault(key, slot)
        return place

    def _pools(self, free):
        """The lines that nobody needs any more, of each object, the first ones last."""
        pools = {}
        slots = np.flatnonzero(free)[::-1]
        for slot, group in zip(
            slots.tolist(), np.searchsorted(self._obj.object_line, self._obj.vt_line[slots]).tolist(), strict=True
        ):
            pools.setdefault(group, []).append(slot)
        return pools


def _renumber(obj, slots, lines):
    """Give the faces and other lines the numbers that their UVs have now."""
    all_lines = np.concatenate([obj.vt_line, np.array(slots.added_line, dtype=np.int64)])
    order = np.argsort(all_lines, kind="stable")
    position = np.empty(len(order) + 1, dtype=np.int64)
    position[order] = np.arange(len(order))
    position[-1] = -1
    sorted_lines = all_lines[order]
    corner_line = obj.face_line[obj.corner_face]
    number = position[slots.corner_slot]
    relative = np.where(obj.raw[:, 1] != 0, obj.raw[:, 1], obj.raw[:, 0]) < 0
    text = np.where(relative, number - np.searchsorted(sorted_lines, corner_line), number + 1)
    text[slots.corner_slot < 0] = 0
    start = np.cumsum(obj.sizes) - obj.sizes
    for face in np.unique(obj.corner_face[text != obj.raw[:, 1]]).tolist():
        line = obj.face_line[face]
        lines[line] = _with_indices(lines[line], text[start[face] : start[face] + obj.sizes[face]].tolist())
    if slots.added_line:
        for line in obj.others:
            below = int(np.searchsorted(sorted_lines, line))
            raw = [int(match[2] or 0) for match in _slashed(obj.lines[line])]
            numbers = [position[each] for each in references(obj, line)]
            new = iter(
                [
                    each - below if is_negative else each + 1
                    for each, is_negative in zip(numbers, [each < 0 for each in raw if each], strict=True)
                ]
            )
            lines[line] = _with_indices(lines[line], [next(new) if each else 0 for each in raw], only_slashed=True)


def references(obj, line):
    """The numbers, from 0, of the UVs that a line of another kind than a face uses."""
    known = int(np.searchsorted(obj.vt_line, line))
    raw = [int(match[2] or 0) for match in _slashed(obj.lines[line])]
    found = [each - 1 if each > 0 else known + each for each in raw if each]
    return [each for each in found if 0 <= each < len(obj.vt)]


def _slashed(line):
    return [match for match in _CORNER.finditer(line.split(b"#")[0]) if match[2] is not None]


def _with_indices(line, numbers, only_slashed=False):
    """The line with other texture indices, one for each corner; 0 leaves out the index."""
    code, hash_sign, comment = line.partition(b"#")
    numbers = iter(numbers)

    def corner(match):
        if only_slashed and match[2] is None:
            return match[0]
        number = next(numbers)
        if not number:
            return match[0]
        return b"%s/%d%s" % (match[1], number, match[3] or b"")

    return _CORNER.sub(corner, code) + hash_sign + comment


def _with_uv(line, values):
    """The `vt` line with other values, and all else as it is."""
    words = list(_WORD.finditer(line.split(b"#")[0]))[1:3]
    first, last = words[0], words[-1]
    between = line[first.end() : last.start()] if len(words) == 2 else b" "
    return line[: first.start()] + _number(values[0]) + between + _number(values[1]) + line[last.end() :]


def _number(value):
    """The shortest text that reads back as the same 32-bit float."""
    return np.format_float_positional(np.float32(value), unique=True, trim="0").encode()
