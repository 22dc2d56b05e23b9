# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles of any UVs lie on others, exactly, and in little time however tangled they are."""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from .certificate import as_stored, turn
from .layouts import pairs_within
from .pieces import starts_of_numbers
from .triangles import boxes_of

_FEW = 200  # pairs of triangles in a box that are compared without halving it
_UNKNOWN = 4  # triangles in a box that are not known to be covered, which are compared with all others there
_FRUITFUL = 0.05  # of the triangles that are looked at by chance, those that must turn out covered for another look
_TRIES = 0.5  # comparisons by chance for each triangle that meets a box, which always pay
_OF_ALL = 0.05  # of all pairs in boxes that cannot be halved, those that are compared by chance first
_CHEAP = 5000  # comparisons that cost no less than fewer
_SPREAD = 1.3  # times as many triangles as meet a box, that meet its halves at most, or else they are not worth it
_ROUNDED = 4 * float(np.finfo(np.float32).eps)  # of a coordinate, by which moving an island may round it
_SURE = 1e-15  # of the terms of a sum of products, what rounding may take of it


class Covered(NamedTuple):
    """What lies on what."""

    triangles: np.ndarray  # (m,) bool, those that share some area with another one
    pairs: np.ndarray  # (k, 2) pairs of groups that share some area, the smaller first; at least one of each that does


def covered(
    corners: np.ndarray, sheet: np.ndarray, group: np.ndarray | None = None, rounding: bool = False
) -> Generator[float, None, Covered]:
    """The triangles that share some area with another one, exactly, in 32-bit floats.

    corners  (m, 3, 2) the UVs of triangles, wound in either direction; those without area cover nothing
    sheet    (m,) numbers from 0: triangles of different sheets are not compared
    group    (m,) numbers from 0: triangles of one group are not compared; by default all are
    rounding whether triangles that lie in each other no deeper than rounding may take them count as apart

    A generator that yields the share that is done, from 0 to 1.
    """
    if not len(corners) or (group is not None and not np.ptp(group)):
        return Covered(np.zeros(len(corners), dtype=bool), np.zeros((0, 2), dtype=np.int64))
    # Where much lies on each other, most of it is found by comparing triangles of one place by chance.  What is left
    # is compared with everything near: boxes are halved until only few triangles meet them.
    search = _Search(corners, group, rounding)
    share, boxes = 0.0, search.open(search.roots(sheet))
    while len(boxes.triangle):
        yield (share := share + 0.1 * (1 - share))
        search.compare_by_chance(boxes)
        boxes = search.open(boxes)
        work = search.work(boxes)
        few = work <= np.maximum(_FEW, _UNKNOWN * boxes.counts())
        search.compare(boxes.chosen(few))
        many = boxes.chosen(~few)
        halves = many.halved(search.low, search.high)
        stuck = halves.counts().reshape(-1, 2).sum(axis=1) > _SPREAD * many.counts()
        rest = many.chosen(stuck)
        search.compare_by_chance(rest, _OF_ALL)
        search.compare(rest)
        boxes = halves.chosen(np.repeat(~stuck, 2))
    return Covered(search.found, search.pairs())


class _Boxes(NamedTuple):
    """Boxes of the plane, and which triangles meet them."""

    low: np.ndarray  # (b, 2)
    high: np.ndarray  # (b, 2)
    box: np.ndarray  # (e,) ascending
    triangle: np.ndarray  # (e,)

    @property
    def starts(self) -> np.ndarray:
        """Where the triangles of each box begin, (b,)."""
        return starts_of_numbers(self.box, len(self.low))

    def counts(self, weights: np.ndarray | None = None) -> np.ndarray:
        """How many triangles meet each box, (b,), or the sum of their weights (e,)."""
        return np.bincount(self.box, weights, len(self.low)).astype(np.int64)

    def chosen(self, mask: np.ndarray) -> _Boxes:
        """Those of the boxes that the mask (b,) holds."""
        its = mask[self.box]
        number = np.cumsum(mask) - 1
        return _Boxes(self.low[mask], self.high[mask], number[self.box[its]], self.triangle[its])

    def halved(self, low: np.ndarray, high: np.ndarray) -> _Boxes:
        """Both halves of each box, as far as there are triangles in it, one after the other.

        Triangles reach from `low` to `high`, (m, 2) each; none of the boxes is without.
        """
        starts = self.starts
        box_low = np.maximum(self.low, np.minimum.reduceat(low[self.triangle], starts)) if len(starts) else self.low
        box_high = np.minimum(self.high, np.maximum.reduceat(high[self.triangle], starts)) if len(starts) else self.high
        new_low, new_high = np.repeat(box_low, 2, axis=0), np.repeat(box_high, 2, axis=0)
        rows, axis = np.arange(len(box_low)), np.argmax(box_high - box_low, axis=1)
        middle = (box_low + box_high)[rows, axis] / 2
        new_high[2 * rows, axis] = new_low[2 * rows + 1, axis] = middle
        its_axis, its_middle = axis[self.box], middle[self.box]
        in_first = low[self.triangle, its_axis] < its_middle
        in_second = high[self.triangle, its_axis] > its_middle
        in_first |= ~in_second
        # What was before a triangle in the order of the boxes' first halves stays before it.
        box = np.concatenate([2 * self.box[in_first], 2 * self.box[in_second] + 1])
        order = np.argsort(box, kind="stable")
        triangle = np.concatenate([self.triangle[in_first], self.triangle[in_second]])
        return _Boxes(new_low, new_high, box[order], triangle[order])


class _Search:
    def __init__(self, corners, group, rounding):
        stored = as_stored(corners)
        way = turn(*stored.swapaxes(0, 1))
        self.corners = np.where((way < 0)[:, None, None], stored[:, ::-1], stored)
        self.group = group
        self.low, self.high = boxes_of(stored)
        self.found = np.zeros(len(stored), dtype=bool)
        # How deep triangles may lie in others and count as apart, None for not at all
        self._slack = _ROUNDED * np.maximum(np.abs(self.low), np.abs(self.high)).max(axis=1) if rounding else None
        self._solid = np.flatnonzero(way)
        self._random = np.random.default_rng(0)
        self._keys = [np.zeros(0, dtype=np.int64)]

    def roots(self, sheet):
        """A box for each sheet that has triangles."""
        order = self._solid[np.argsort(sheet[self._solid], kind="stable")]
        present, box = np.unique(sheet[order], return_inverse=True)
        starts = starts_of_numbers(box, len(present))
        if not len(present):
            return _Boxes(np.zeros((0, 2)), np.zeros((0, 2)), box, order)
        low, high = np.minimum.reduceat(self.low[order], starts), np.maximum.reduceat(self.high[order], starts)
        return _Boxes(low, high, box, order)

    def open(self, boxes):
        """The boxes in which pairs are left to compare."""
        left = self.work(boxes) > 0
        if self.group is not None and len(left):
            group, starts = self.group[boxes.triangle], boxes.starts
            some = boxes.counts() > 0
            several = np.zeros(len(left), dtype=bool)
            first = starts[some]
            several[some] = np.minimum.reduceat(group, first) < np.maximum.reduceat(group, first)
            left &= several
        return boxes.chosen(left)

    def work(self, boxes):
        """How many pairs of triangles are left to compare in each box, (b,)."""
        count = boxes.counts()
        return np.where(count > 1, count, 0) * boxes.counts(~self.found[boxes.triangle])

    def compare_by_chance(self, boxes, share=0.0):
        """Compare each triangle with any other one in its box, again and again while it pays, or has taken less than
        that share of what it takes to compare all."""
        count, starts = boxes.counts(), boxes.starts
        if not (count > 1).any():
            return
        place = np.arange(len(boxes.box)) - starts[boxes.box]
        tries = 0
        while True:
            unknown = np.flatnonzero(~self.found[boxes.triangle] & (count > 1)[boxes.box])
            its = count[boxes.box[unknown]]
            step = 1 + (self._random.random(len(unknown)) * (its - 1)).astype(np.int64)
            other = starts[boxes.box[unknown]] + (place[unknown] + step) % its
            found = self._compare_pairs(boxes.triangle[unknown], boxes.triangle[other])
            tries += max(len(unknown), _CHEAP)
            if found <= _FRUITFUL * len(unknown) and tries >= max(len(boxes.box) * _TRIES, share * its.sum()):
                return

    def compare(self, boxes):
        """Compare all triangles in each box with those that are not known to be covered."""
        unknown = ~self.found[boxes.triangle]
        some = boxes.chosen(boxes.counts(unknown) > 0)
        unknown = ~self.found[some.triangle]
        its_own = np.flatnonzero(unknown)
        first = np.cumsum(some.counts(unknown)) - some.counts(unknown)
        for box, (one, other) in pairs_within(some.counts(unknown), some.counts()):
            self._compare_pairs(some.triangle[its_own[first[box] + one]], some.triangle[some.starts[box] + other])

    def _compare_pairs(self, one, other):
        """Note which pairs of triangles share some area, and return how many."""
        chosen = one != other
        if self.group is not None:
            chosen &= self.group[one] != self.group[other]
        chosen &= ~(self.found[one] & self.found[other])
        for axis in range(2):
            low, high = self.low[:, axis], self.high[:, axis]
            chosen &= (low[one] < high[other]) & (low[other] < high[one])
        one, other = one[chosen], other[chosen]
        if not len(one):
            return 0
        slack = None if self._slack is None else np.maximum(self._slack[one], self._slack[other])
        shared = share_area(self.corners[one], self.corners[other], slack)
        one, other = one[shared], other[shared]
        self.found[one] = self.found[other] = True
        if self.group is not None:
            a, b = self.group[one].astype(np.int64), self.group[other].astype(np.int64)
            self._keys.append(np.unique(np.minimum(a, b) * (self.group.max() + 1) + np.maximum(a, b)))
        return len(one)

    def pairs(self):
        """(k, 2), the pairs of groups that were found to share some area."""
        keys = np.unique(np.concatenate(self._keys))
        count = 1 if self.group is None or not len(self.group) else int(self.group.max()) + 1
        return np.column_stack(np.divmod(keys, count))


def share_area(one: np.ndarray, other: np.ndarray, slack: np.ndarray | None = None) -> np.ndarray:
    """Which pairs of triangles, (k, 3, 2) each and wound counter-clockwise, share some area, (k,) bool: exactly.

    Two share none if and only if a side of one has all of the other on its right or on its line.  With `slack` (k,),
    that may lie as far on the left as that.
    """
    left = np.arange(len(one))  # which pairs no side has parted yet
    for first, second in ((one, other), (other, one)):
        for side in range(3):
            its, points = first[left], second[left]
            ends = its[:, side], its[:, (side + 1) % 3]
            parted = _on_the_right(*ends, points) if slack is None else _nearly_right(*ends, points, slack[left])
            left = left[~parted]
    shared = np.zeros(len(one), dtype=bool)
    shared[left] = True
    return shared


def _on_the_right(start, end, points):
    """Which sides, from `start` to `end` (k, 2), have none of the points (k, 3, 2) on their left, (k,) bool."""
    first, second = _products(start, end, points)
    apart, doubt = first - second, _SURE * (np.abs(first) + np.abs(second))
    right = (apart <= doubt).all(axis=1)  # for all that rounding tells
    unsure = np.flatnonzero(right & (np.abs(apart) <= doubt).any(axis=1))
    for point in points[unsure].swapaxes(0, 1):
        right[unsure] &= turn(start[unsure], end[unsure], point) <= 0
    return right


def _nearly_right(start, end, points, slack):
    """The same where points may lie as far on the left as the slack (k,)."""
    first, second = _products(start, end, points)
    return (first - second <= (slack * np.linalg.norm(end - start, axis=1))[:, None]).all(axis=1)


def _products(start, end, points):
    """The two products whose difference tells on which side of a line points are, (k, 3) each."""
    along = end - start
    to = points - start[:, None]
    return along[:, :1] * to[..., 1], along[:, 1:] * to[..., 0]
