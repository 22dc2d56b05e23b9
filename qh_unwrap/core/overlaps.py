# SPDX-License-Identifier: GPL-3.0-or-later
"""Which islands lie on top of each other in the plane, of any number of islands and in little time."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

import numpy as np

from .certificate import near_boxes
from .layouts import Layout, pairs_within
from .stepping import finished, mapped

ENOUGH = 20  # others that an island lies on, after which no more are looked for
_LEFT = 0.9  # of the work after each portion, by and large


def new_overlaps(
    now: Sequence[np.ndarray], before: Sequence[np.ndarray | None], sheet: Sequence[int]
) -> Generator[float, None, list[list[int]]]:
    """Which islands lie on which others, and did not before.

    now     the islands' UVs, as triangles (t, 3, 2)
    before  the same as it was, None for an island that lay nowhere
    sheet   numbers: islands of different ones never lie on each other

    A generator: yields the share that is done, from 0 to 1, and returns for every island the numbers of others,
    ascending.  Once an island has `ENOUGH`, no more are looked for.

    Islands that lay in one stack before are not compared.  Of the other pairs, most are decided by a glance at some
    samples of the plane, and only the rest triangle by triangle.
    """
    lists: list[list[int]] = [[] for _ in now]
    found = np.zeros(len(now), dtype=int)
    layout, old = Layout(now), Layout([np.empty((0, 3, 2)) if each is None else each for each in before])
    share = 0.0
    for one, other in _candidates(layout, _stacks(before, old.first_sample, sheet), np.asarray(sheet)):
        yield (share := 1 - _LEFT * (1 - share))
        open_ = (np.minimum(found[one], found[other]) < ENOUGH) & ~old.share_sample(one, other)
        one, other = one[open_], other[open_]
        lie = layout.share_sample(one, other)
        unsure = np.flatnonzero(~lie)
        lie[unsure] = yield from _at(share, layout.share_area(one[unsure], other[unsure]))
        one, other = one[lie], other[lie]
        lay = yield from _at(share, old.share_area(one, other))
        for i, j in zip(one[~lay].tolist(), other[~lay].tolist(), strict=True):
            if len(lists[i]) < ENOUGH or len(lists[j]) < ENOUGH:
                for island, its in ((i, j), (j, i)):
                    if len(lists[island]) < ENOUGH:
                        lists[island].append(its)
                        found[island] += 1
    return [sorted(each) for each in lists]


def overlapping(islands: Sequence[np.ndarray]) -> list[tuple[int, int]]:
    """The pairs (i, j), i < j, of islands, each given as triangles (t, 3, 2), that share some area."""
    layout = Layout(islands)
    found: list[tuple[int, int]] = []
    for one, other in _candidates(layout, np.arange(len(islands)), np.zeros(len(islands), int)):
        shared = finished(layout.share_area(one, other))
        found += zip(np.minimum(one, other)[shared].tolist(), np.maximum(one, other)[shared].tolist(), strict=True)
    return sorted(found)


def overlap(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether triangles (s, 3, 2) share some area with triangles (t, 3, 2)."""
    return bool(overlapping([one, other]))


def _at(share, steps):
    """The same steps, each of which yields the `share`."""
    return mapped(lambda _: share, steps)


def _stacks(before, first_sample, sheet):
    """The number of each island's stack, (n,): those in one lay on each other before, or in the very same place."""
    numbers = {}

    def key(island):
        if first_sample[island] >= 0:
            return sheet[island], int(first_sample[island])
        return island if before[island] is None else (sheet[island], before[island].tobytes())

    return np.array([numbers.setdefault(key(k), len(numbers)) for k in range(len(before))], dtype=int)


def _candidates(layout: Layout, stack: np.ndarray, sheet: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pairs of islands, (k,) each, of different stacks but of one sheet, whose boxes share some area.

    `stack` and `sheet` (n,) are numbers; all islands of a stack are of one sheet.
    """
    order = np.argsort(stack, kind="stable")
    first = np.searchsorted(stack[order], np.arange(stack.max(initial=-1) + 1))
    if len(first) < 2:
        return
    size = np.diff(first, append=len(stack))
    low, high = np.minimum.reduceat(layout.low[order], first), np.maximum.reduceat(layout.high[order], first)
    for some, others in near_boxes(low, high, sheet[order][first]):
        for pair, (place, other_place) in pairs_within(size[some], size[others]):
            one, other = order[first[some[pair]] + place], order[first[others[pair]] + other_place]
            meet = ((layout.low[one] < layout.high[other]) & (layout.low[other] < layout.high[one])).all(axis=1)
            if meet.any():
                yield one[meet], other[meet]
