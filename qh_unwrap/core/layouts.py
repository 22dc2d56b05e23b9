# SPDX-License-Identifier: GPL-3.0-or-later
"""A layout: islands in the plane as triangles, and which of them share some area."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

_DEPTH = 1e-5  # depth, relative to the size of the smaller triangle, up to which two triangles merely touch
_PORTION = 400_000  # pairs that are looked at together, about: it bounds the memory
_ROW = 16  # samples in a row of the grid that covers a layout
_CENTRES = 128  # samples within islands
_FEW = 64  # pairs of triangles that are compared at once, without sorting them out any further
_SHRINKING = 0.75  # of those pairs that halving a box must leave at most, or else it is not worth it


class Layout:
    """Islands in the plane, each given as triangles (t, 3, 2); one without any lies nowhere."""

    def __init__(self, islands: Sequence[np.ndarray]):
        size = np.array([len(island) for island in islands], dtype=int)
        self._triangles = np.concatenate([np.empty((0, 3, 2)), *islands])
        self._island = np.repeat(np.arange(len(islands)), size)
        self._low, self._high = self._triangles.min(axis=1), self._triangles.max(axis=1)
        # The corners of the islands' boxes, (n, 2) each.
        self.low, self.high = np.full((len(islands), 2), np.inf), np.full((len(islands), 2), -np.inf)
        present = np.flatnonzero(size)
        if len(present):
            starts = (np.cumsum(size) - size)[present]
            self.low[present] = np.minimum.reduceat(self._low, starts)
            self.high[present] = np.maximum.reduceat(self._high, starts)

    def share_sample(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Which pairs of islands, (k,) each, both contain one of some samples of the plane, (k,) bool.

        These share some area.  Of those that share much of it, few are not among them.
        """
        _, most, others = self._samples
        shared = most[one] & most[other] != 0
        left = np.flatnonzero(~shared)
        shared[left] = (others[one[left]] & others[other[left]]).any(axis=1)
        return shared

    @property
    def first_sample(self) -> np.ndarray:
        """Of the samples that each island contains the one that most islands contain, (n,), or -1 for none: those with
        the same share some area."""
        return self._samples[0]

    def share_area(self, one: np.ndarray, other: np.ndarray) -> Generator[None, None, np.ndarray]:
        """Which pairs of islands, (k,) each, share some area, (k,) bool.  A generator that yields between its steps.

        Triangles are compared that meet the box which the two islands' boxes have in common.  Where these are many,
        that box is halved, again and again.
        """
        found = np.zeros(len(one), dtype=bool)
        low, high = np.maximum(self.low[one], self.low[other]), np.minimum(self.high[one], self.high[other])
        pairs = np.flatnonzero((low < high).all(axis=1))
        if not len(pairs):
            return found
        sides = [self._may_meet(each[pairs], low[pairs], high[pairs]) for each in (one, other)]
        count = sum(last - first for first, last in sides)
        for part in _portions(count):
            pair = pairs[part]
            boxes = _Boxes(pair, low[pair], high[pair], [])
            boxes.sides = [self._meeting(boxes, first[part], last[part]) for first, last in sides]
            while len(boxes.pair):
                yield
                boxes = yield from self._compared(boxes, found)
        return found

    def _compared(self, boxes, found):
        """Compare the triangles that meet the boxes where they are few; returns the halves of the other boxes."""
        work = boxes.work()
        many = work > _FEW
        halves = self._halves(boxes.chosen(many))
        left = halves.work()
        shrinking = left.reshape(-1, 2).sum(axis=1) <= _SHRINKING * work[many]
        many[many] = shrinking
        yield from self._compare(boxes.chosen(~many), found)
        return halves.chosen(np.repeat(shrinking, 2) & (left > 0) & ~found[halves.pair])

    def _compare(self, boxes, found):
        """Note in `found`, (k,) bool, of which pairs of islands the triangles that meet the boxes share some area."""
        for box, one, other in boxes.pairs_of_triangles():
            yield
            left = np.flatnonzero(~found[boxes.pair[box]])
            box, one, other = box[left], one[left], other[left]
            meet = ((self._low[one] < self._high[other]) & (self._low[other] < self._high[one])).all(axis=1)
            box, one, other = box[meet], one[meet], other[meet]
            shared = _share_area(self._triangles[one], self._triangles[other])
            found[boxes.pair[box[shared]]] = True

    def _halves(self, boxes):
        """Both halves of each box, one after the other, with the triangles that meet them."""
        halves = _Boxes(np.repeat(boxes.pair, 2), np.repeat(boxes.low, 2, axis=0), np.repeat(boxes.high, 2, axis=0), [])
        rows, axis = np.arange(len(boxes.pair)), np.argmax(boxes.high - boxes.low, axis=1)
        middle = (boxes.low + boxes.high)[rows, axis] / 2
        halves.high[2 * rows, axis] = halves.low[2 * rows + 1, axis] = middle
        for box, triangle in boxes.sides:
            both = np.repeat(2 * box, 2) + np.tile((0, 1), len(box)), np.repeat(triangle, 2)
            box, triangle = (each[self._meet(halves, *both)] for each in both)
            order = np.argsort(box, kind="stable")
            halves.sides.append((box[order], triangle[order]))
        return halves

    def _meet(self, boxes, box, triangle):
        """Whether each triangle shares some area with the box beside it, (k,) bool."""
        low, high = self._low[triangle], self._high[triangle]
        return ((low < boxes.high[box]) & (boxes.low[box] < high)).all(axis=1)

    def _meeting(self, boxes, first, last):
        """The triangles between those places (k,) of their order that meet the boxes (k,): boxes, and triangles."""
        found = [np.empty((2, 0), dtype=int)]
        for box, place in _in_ranges(first, last):
            triangle = self._order[0][place]
            found.append(np.stack([box, triangle])[:, self._meet(boxes, box, triangle)])
        return tuple(np.concatenate(found, axis=1))

    def _may_meet(self, island, low, high):
        """Between which places of their order, (k,) each, the islands' triangles lie that may meet the boxes."""
        _, place, least, apart, width = self._order
        base, slack = island * apart - least, 1e-9 * apart  # more than rounding takes
        first = np.searchsorted(place, base + low[:, 0] - width[island] - slack)
        return first, np.searchsorted(place, base + high[:, 0] + slack)

    @cached_property
    def _order(self):
        """The triangles in the order of their islands and, in each, where they begin; the values of that order, which
        start at `least` and are `apart` from island to island; and the widest triangle of each island."""
        least = self._low[:, 0].min()
        apart = 3 * (self._high[:, 0].max() - least) + 1e-30
        place = self._island * apart + (self._low[:, 0] - least)
        order = np.argsort(place, kind="stable")
        width = np.zeros(len(self.low))
        np.maximum.at(width, self._island, (self._high - self._low)[:, 0])
        return order, place[order], least, apart, width

    @cached_property
    def _samples(self):
        """The samples that each island contains, those first that most islands contain: the number of its first one,
        (n,), and a bit for each, the first 64 (n,) and the others (n, w)."""
        count = len(self.low)
        if not len(self._triangles):
            return np.full(count, -1), np.zeros(count, dtype=np.uint64), np.zeros((count, 0), dtype=np.uint64)
        points = self._sample_points()
        contains = np.zeros((len(self.low), len(points)), dtype=bool)
        first, last = (np.searchsorted(points[:, 0], each[:, 0]) for each in (self._low, self._high))
        for triangle, point in _in_ranges(first, last):
            high = points[point, 1]
            near = (self._low[triangle, 1] < high) & (high < self._high[triangle, 1])
            triangle, point = triangle[near], point[near]
            inside = _contain(self._triangles[triangle], points[point])
            contains[self._island[triangle[inside]], point[inside]] = True
        contains = contains[:, np.argsort(-contains.sum(axis=0), kind="stable")]
        bits = np.ascontiguousarray(np.packbits(contains, axis=1)).view(np.uint64)
        return np.where(contains.any(axis=1), contains.argmax(axis=1), -1), bits[:, 0].copy(), bits[:, 1:]

    def _sample_points(self):
        """Points (64 w, 2) from left to right: some all over the layout, some the centres of triangles."""
        random = np.random.default_rng(0)
        low, high = self._low.min(axis=0), self._high.max(axis=0)
        cells = np.stack(np.meshgrid(np.arange(_ROW), np.arange(_ROW)), axis=-1).reshape(-1, 2)
        everywhere = low + (cells + random.random(cells.shape)) * (high - low) / _ROW
        chosen = np.linspace(0, len(self._triangles) - 1, _CENTRES).astype(int)
        points = np.concatenate([everywhere, self._triangles[chosen].mean(axis=1)])
        return points[np.argsort(points[:, 0])]


@dataclass
class _Boxes:
    """Boxes, each of a pair of islands, and which of their triangles meet them."""

    pair: np.ndarray  # (b,)
    low: np.ndarray  # (b, 2)
    high: np.ndarray  # (b, 2)
    sides: list[tuple[np.ndarray, np.ndarray]]  # for either island the boxes (e,), ascending, and triangles (e,)

    def counts(self) -> list[np.ndarray]:
        """How many triangles of either island meet each box, (b,) each."""
        return [np.bincount(box, minlength=len(self.pair)) for box, _ in self.sides]

    def work(self) -> np.ndarray:
        """How many pairs of triangles meet each box, (b,)."""
        one, other = self.counts()
        return one * other

    def chosen(self, mask: np.ndarray) -> _Boxes:
        """Those of the boxes that the mask (b,) holds."""
        number = np.cumsum(mask) - 1
        sides = [(number[box[mask[box]]], triangle[mask[box]]) for box, triangle in self.sides]
        return _Boxes(self.pair[mask], self.low[mask], self.high[mask], sides)

    def pairs_of_triangles(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield boxes, and a triangle of either island that meets them, (k,) each, until all pairs have come."""
        (_, one), (_, other) = self.sides
        first, second = (np.cumsum(count) - count for count in self.counts())
        for box, place in pairs_within(*self.counts()):
            yield box, one[first[box] + place[0]], other[second[box] + place[1]]


def pairs_within(one: np.ndarray, other: np.ndarray) -> Iterator[tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]]:
    """Yield the pairs of members of pairs of groups with `one` and `other` (k,) members, some at a time.

    They come as the pairs of groups (p,), and the places (p,) of both members within their groups.
    """
    if (one == 1).all() and (other == 1).all():
        for part in _portions(one):
            yield part, (np.zeros_like(part), np.zeros_like(part))
        return
    total = np.cumsum(one * other)
    for begin in range(0, int(total[-1]) if len(total) else 0, _PORTION):
        number = np.arange(begin, min(begin + _PORTION, total[-1]))
        group = np.searchsorted(total, number, side="right")
        yield group, np.divmod(number - (total - one * other)[group], other[group])


def _portions(count):
    """Yield the places in `count` (k,), some at a time, whose values add up to about a portion."""
    yield from np.array_split(np.arange(len(count)), 1 + int(np.sum(count)) // _PORTION)


def _in_ranges(first, last):
    """Yield each number from `first` to `last` (k,), exclusive, and before it its place in these, some at a time."""
    count = np.maximum(last - first, 0)
    for part in _portions(count):
        own = count[part]
        start = np.cumsum(own) - own
        yield np.repeat(part, own), np.arange(own.sum()) + np.repeat(first[part] - start, own)


def _contain(triangles, points):
    """Whether the triangles (k, 3, 2) contain the points (k, 2), not only just, (k,) bool."""
    side = np.roll(triangles, -1, axis=1) - triangles
    to = points[:, None] - triangles
    across = side[..., 0] * to[..., 1] - side[..., 1] * to[..., 0]
    least = _DEPTH * np.linalg.norm(side, axis=2) * np.ptp(triangles, axis=1).max(axis=1)[:, None]
    return (across > least).all(axis=1) | (across < -least).all(axis=1)


def _share_area(one, other):
    """Which pairs of triangles, (k, 3, 2) each, share some area, (k,) bool.

    Two triangles share none if and only if some side of either has them on different sides of it.  So both are measured
    across each of the six sides: how far their ranges there overlap is how deep they lie in each other.
    """
    shared = np.ones(len(one), dtype=bool)
    least = _DEPTH * np.minimum(np.ptp(one, axis=1).max(axis=1), np.ptp(other, axis=1).max(axis=1))
    for sides in (np.roll(one, -1, axis=1) - one, np.roll(other, -1, axis=1) - other):
        length = np.linalg.norm(sides, axis=2)
        for side in range(3):
            normal = sides[:, side, ::-1] * (1, -1) / np.maximum(length[:, side], 1e-300)[:, None]
            first, second = (np.einsum("kcd,kd->kc", each, normal) for each in (one, other))
            depth = np.minimum(first.max(axis=1), second.max(axis=1)) - np.maximum(
                first.min(axis=1), second.min(axis=1)
            )
            shared &= (depth > least) | (length[:, side] == 0)
    return shared
