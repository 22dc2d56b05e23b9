# SPDX-License-Identifier: GPL-3.0-or-later
"""Boundary loops: which of them is a piece's outline, and how long closed polygons are."""

from collections.abc import Sequence

import numpy as np

from .pieces import starts_of
from .topology import Topology


def followers(loops: Sequence[np.ndarray]) -> np.ndarray:
    """The vertex that follows each of all closed loops' vertices, which are taken loop after loop."""
    loop, first = np.concatenate(loops), starts_of(loops)
    result = np.roll(loop, -1)
    result[np.append(first[1:], len(loop)) - 1] = loop[first]
    return result


def sorted_loops(vertices: np.ndarray, topology: Topology) -> tuple[list[np.ndarray], np.ndarray]:
    """The outline of every piece, by pieces, then the holes, the widest first; and the piece of each.

    The outline is the loop that reaches farthest from its middle: a ragged hole may well be longer.  Of several that
    reach as far, it is the lowest, whatever the vertices' numbers are.
    """
    loops, piece = topology.loops, topology.loop_piece
    if len(loops) == topology.piece_count:  # one for each piece
        order = np.argsort(piece)
        return [loops[k] for k in order], piece[order]
    rank = [_rank(vertices[loop]) for loop in loops]
    order = np.array(sorted(range(len(loops)), key=lambda k: (piece[k], *rank[k], loops[k][0])))
    is_outline = np.diff(piece[order], prepend=-1) > 0
    order = np.concatenate([order[is_outline], order[~is_outline]])
    return [loops[k] for k in order], piece[order]


def _rank(points):
    """Numbers by which loops with these points (n, 3) are sorted: how far they reach, then where their middle is."""
    middle = points.mean(axis=0)
    width = np.linalg.norm(points - middle, axis=1).max()
    # Rounded, so that rounding errors do not tell equal ones apart
    return -round(float(width), 9), *np.round(middle[::-1], 6).tolist()


def edge_lengths(points: np.ndarray) -> np.ndarray:
    """Lengths of the sides of a closed polygon (n, d); side i runs from point i to i + 1."""
    return np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)


def perimeter(points: np.ndarray) -> float:
    """Length of the closed polygon (n, d)."""
    return float(edge_lengths(points).sum())
