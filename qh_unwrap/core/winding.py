# SPDX-License-Identifier: GPL-3.0-or-later
"""Which faces have to be turned, so that all that hang together are wound alike, and where that cannot be."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from .pieces import components, first_and_last


def agreed(one: np.ndarray, other: np.ndarray, opposed: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The faces to turn, (f,) bool, and the links to cut, (k,) bool, for winding to agree across every other link.

    The k-th link joins the faces `one[k]` and `other[k]`; they are `opposed`, (k,) bool, where both run along their
    edge the same way.  `part` (f,) is the part of each face, as the links join them.

    The fewer faces of a part are turned; of as many, those wound unlike its first face.  A part that is one-sided, like
    a Möbius band, has no winding: it is cut at the links where a walk from its first face meets itself turned over.
    Such cuts do not take a part apart.
    """
    count = len(part)
    if not opposed.any():
        return np.zeros(count, bool), np.zeros(len(one), bool)
    side = _sides(count, one, other, opposed)
    first = first_and_last(np.arange(count), part, part.max() + 1)[0]
    one_sided = side[:count] == side[count:]
    cut = one_sided[one]
    if cut.any():
        walked = np.flatnonzero(cut)
        walked = walked[_walk(count, one[walked], other[walked], np.unique(first[part[one_sided]]))]
        kept = np.union1d(np.flatnonzero(~cut), walked)
        side = _sides(count, one[kept], other[kept], opposed[kept])
        cut = side[one] != side[other + count * opposed]
    turned = side[:count] != side[first[part]]
    too_many = 2 * np.bincount(part, turned) > np.bincount(part)
    return turned ^ too_many[part], cut


def _sides(count, one, other, opposed):
    """The sides (2 f,) of faces, those that they show first and their backs after them, of which what hangs together
    has the same number: a walker comes from a face to its back where the surface is one-sided, and only there."""
    here = np.concatenate([one, one + count])
    there = np.concatenate([other + count * opposed, other + count * ~opposed])
    return components(2 * count, here, there)[1]


def _walk(count, one, other, starts):
    """Links, by number, over which a walk by the shortest ways comes from the faces `starts` to all that they reach."""
    root = np.full(len(starts), count)  # a place of its own, from which all walks set out at once
    here, there = np.concatenate([one, other, root]), np.concatenate([other, one, starts])
    links = coo_array((np.ones(len(here)), (here, there)), shape=(count + 1, count + 1)).tocsr()
    before = breadth_first_order(links, count)[1]
    taken = np.flatnonzero((before[one] == other) | (before[other] == one))
    low, high = np.minimum(one, other)[taken], np.maximum(one, other)[taken]
    return taken[np.unique(low * np.int64(count) + high, return_index=True)[1]]  # between two faces one is enough
