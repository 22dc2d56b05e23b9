# SPDX-License-Identifier: GPL-3.0-or-later
"""What is unknown at the vertices of a graph, and where the entries of matrices on it go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array

from .pieces import first_of_parts
from .triangles import parts


class Unknowns:
    """The unknowns of one coordinate, numbered in the order in which they are eliminated.

    Parameters
    ----------
    order : (n,), the vertices in that order
    held : (n,) bool, vertices whose coordinate is no unknown
    partner : (n,), for every vertex the one that it moves together with, itself if with none; None for nobody
    """

    def __init__(self, order: np.ndarray, held: np.ndarray, partner: np.ndarray | None = None):
        self.tied = partner is not None and bool((partner != np.arange(len(order))).any())
        if partner is not None and self.tied:
            leader = first_of_parts(len(order), np.arange(len(order)), partner)
            stuck = np.bincount(leader, held, len(order)) > 0  # who is tied to a held vertex is held as well
            held = held | stuck[leader]
            leads = leader == np.arange(len(order))
        else:
            leader, leads = np.arange(len(order)), True
        self.held = held
        self.sequence = order[(~held & leads)[order]]
        self.number = np.full(len(order), -1)
        self.number[self.sequence] = np.arange(len(self.sequence))
        self.number = self.number[leader]
        self.leader = leader

    def __len__(self):
        return len(self.sequence)

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) at the vertices, added up for every unknown."""
        if not self.tied:
            return values[self.sequence]
        result = np.zeros((len(self), *values.shape[1:]))
        free = ~self.held
        np.add.at(result, self.number[free], values[free])
        return result

    def spread(self, values: np.ndarray, out: np.ndarray) -> None:
        """Add the unknowns' values to those (n, ...) of their vertices."""
        if not self.tied:
            out[self.sequence] += values
        else:
            free = ~self.held
            out[free] += values[self.number[free]]


class Pattern:
    """Where the entries of matrices on one graph go.

    A matrix is given by its entries (i, j), (j, i) for the edges, (k,) each, and (i, i) for the vertices, (n,).
    """

    def __init__(self, unknowns: Unknowns, edges: np.ndarray):
        self.size = size = len(unknowns)
        k = len(edges)
        number = unknowns.number.astype(np.int32)  # half as much to read from far apart
        i, j = number[edges.T]
        inner = np.flatnonzero((i >= 0) & (j >= 0)).astype(np.int32)
        free = np.flatnonzero(number >= 0).astype(np.int32)
        i, j, own = i[inner], j[inner], number[free]
        entry = np.concatenate([inner, k + inner, 2 * k + free])
        row, column = np.concatenate([i, j, own]), np.concatenate([j, i, own])
        self._slot = None
        if unknowns.tied:  # several entries may fall into one place
            key, self._slot = np.unique(column * np.int64(size) + row, return_inverse=True)
            self._entry = entry
            self.indices = (key % max(size, 1)).astype(np.int32)
            count = np.bincount(key // max(size, 1), minlength=size)
            self.indptr = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        else:
            pattern = coo_array((entry, (row, column)), shape=(size, size)).tocsc()
            self._entry, self.indices, self.indptr = pattern.data, pattern.indices, pattern.indptr
        nothing = np.empty(len(self.indices))
        self._places: tuple[np.ndarray, np.ndarray] | None = None  # of entries in blocks, and which are to be turned
        self._empty = csc_array((nothing, self.indices, self.indptr), shape=(self.size, self.size))

    def matrix(self, forward: np.ndarray, backward: np.ndarray, diagonal: np.ndarray) -> csc_array:
        entries = np.concatenate([forward, backward, diagonal])[self._entry]
        if self._slot is not None:
            entries = np.bincount(self._slot, entries, len(self.indices))
        matrix = copy(self._empty)  # checked once
        matrix.data = entries
        return matrix

    def block_matrix(
        self, beside: Sequence[np.ndarray], own: Sequence[np.ndarray], earlier: bsr_array | None = None
    ) -> bsr_array:
        """The symmetric matrix of 2 by 2 blocks [[m + d, s - a], [s + a, m - d]], where no vertices are tied.

        `beside` is (m, d, s, a), (k,) each, of the blocks (i, j), and `own` (m, d, s), (n,) each, of the blocks (i, i),
        which are symmetric.  An `earlier` matrix is overwritten: fresh memory takes longer.
        """
        k = len(beside[0])
        rows = [np.concatenate(both) for both in zip(beside, (*own, np.zeros(len(own[0]))), strict=True)]
        if earlier is None:
            blocks, shape = np.empty((len(self._entry), 2, 2)), (2 * self.size, 2 * self.size)
            earlier = bsr_array((blocks, self.indices, self.indptr), shape=shape)
        blocks = earlier.data
        if self._places is None:
            ahead = self._entry < k
            self._places = np.where(ahead, self._entry, self._entry - k), ahead
        for part in parts(len(self._entry)):
            place, ahead, block = *(each[part] for each in self._places), blocks[part]
            m, d, s, a = (row[place] for row in rows)
            # The pattern is by columns, and what stands there is taken for rows: transpose.
            np.negative(a, out=a, where=ahead)
            block[:, 0, 0], block[:, 1, 1] = m + d, m - d
            block[:, 0, 1], block[:, 1, 0] = s - a, s + a
        return earlier


def places(order: np.ndarray) -> np.ndarray:
    """The place (n,) that everything has in an `order` (n,)."""
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    return place


def solved_each(
    unknowns: Sequence[Unknowns], solves: Sequence[Callable[[np.ndarray], np.ndarray]]
) -> Callable[[np.ndarray, np.ndarray], None]:
    """A function of right-hand sides (n, c) and values (n, c) that adds to these what `solves` makes of those: one
    function of the unknowns of both coordinates, or one of those of each."""

    def solve(sources, values):
        each = [slice(None)] if len(unknowns) == 1 else [slice(0, 1), slice(1, 2)]
        for columns, its, one in zip(each, unknowns, solves, strict=True):
            if len(its):
                its.spread(one(its.gathered(sources[:, columns])), values[:, columns])

    return solve
