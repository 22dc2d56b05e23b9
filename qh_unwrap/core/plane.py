# SPDX-License-Identifier: GPL-3.0-or-later
"""The plane around islands whose outlines are free: air takes part in the map, and is made anew where it is worn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from .air import Air, Triangulator, make_air, quality
from .bands import are_small
from .certificate import orientation
from .chart import Surface, air_chart
from .domain import Fixed, Triangles
from .ordering import local_order
from .systems import Constrained
from .triangles import corners_of, signed_areas

_WORN = 0.05  # air is renewed when a triangle keeps less than this part of its quality,
_IN_THE_WAY = 0.2  # or less than this where it may be what keeps steps short, or when one that was left out
_OPEN = 1e-3  # has come to this quality, and is
_GROWN = 0.05  # times as large as it would be without distortion
_SHORT = 2  # squared number of an island's sides on its boundary, relative to the number of its vertices


Walls = Sequence[np.ndarray | None] | None
"""For every piece segments (w, 2, 2) that it shall not cross, as `walls.clear_walls` returns them, or None."""


class Plane:
    """An island whose outline is free, with the air around it.

    The paper's map takes the plane to itself.  So the island's triangles carry their tensors, and those of the air, as
    far as a fixed circle, the identity.  Where all are positive, the whole plane is mapped one to one.

    Parameters
    ----------
    island : Surface
    uv : (n, 2), its map
    fixed : of its vertices: pins
    airs : the air around every piece, each numbered as if its piece were alone
    triangulate : makes new air
    walls : for every piece segments (w, 2, 2) that it shall not cross, or None
    """

    def __init__(
        self,
        island: Surface,
        uv: np.ndarray,
        fixed: Fixed,
        airs: Sequence[Air],
        triangulate: Triangulator,
        walls: Walls = None,
    ):
        self.island, self._fixed, self._triangulate, self._walls = island, fixed, triangulate, walls
        self._take(list(airs), uv)

    def _take(self, airs, uv, kept=None):
        """Go on with `airs` around the map `uv`, of which those of the pieces in `kept` (p,) bool are as they were."""
        self._airs = airs
        n, p = len(self.island.vertices), self.island.piece_count
        counts = np.array([len(air.points) for air in airs])
        starts = n + np.cumsum(counts) - counts
        order = np.empty(0, np.int64) if kept is None else self._order_of(kept, starts)
        self._air_starts = starts
        sizes = np.diff(self.island.vertex_starts, append=n)
        numbering = list(zip(sizes, self.island.vertex_starts, starts, strict=True))

        def numbered(triangles):
            joined = [
                np.where(each < size, each + first, each - size + start)
                for each, (size, first, start) in zip(triangles, numbering, strict=True)
            ]
            return np.concatenate(joined), np.repeat(np.arange(p), [len(each) for each in joined])

        self.vertex_piece = np.concatenate([self.island.vertex_piece, np.repeat(np.arange(p), counts)])
        triangles, piece = numbered([air.triangles for air in airs])
        self._air = air_chart(triangles, n + counts.sum(), piece, p)
        self._left_out = numbered([air.left_out for air in airs])
        self.charts = [self.island, self._air]
        self.triangles = Triangles(self.charts, n + int(counts.sum()))
        everything = self.start(uv)
        fixed = self._fixed.followed_by(np.concatenate([air.on_circle for air in airs]), everything[n:])
        order = self._order(everything, order, np.ones(p, bool) if kept is None else ~kept)
        self.constrained = Constrained(order, self.triangles.edges, *fixed, group=self.vertex_piece)
        self._quality = quality(corners_of(everything, self._air.triangles))

    def _order_of(self, pieces, starts):
        """The order in which the vertices of some `pieces` (p,) bool are eliminated, as they will be numbered when the
        pieces' air begins with the numbers `starts` (p,)."""
        order = self.constrained.order
        order = order[pieces[self.vertex_piece[order]]]
        shift = (starts - self._air_starts)[self.vertex_piece[order]]
        return order + np.where(order < len(self.island.vertices), 0, shift)

    def _order(self, uv, first, pieces):
        """The order in which to eliminate the vertices: the `first` ones, and then those of the other `pieces` (p,)
        bool; where it is by dissection, that of the island serves on."""
        n, dissection, edges = len(self.island.vertices), self.island.dissection, self.triangles.edges
        if dissection is None:
            return np.concatenate([first, self._local_order(pieces)])
        # Air is taken apart like the outline beside it.
        outline = np.unique(np.concatenate(self.island.loops))
        inner = outline[~dissection.separates(dissection.key[outline])]
        beside = inner if len(inner) else outline
        shift = 4 * np.ptp(uv, axis=0).max() * self.vertex_piece[:, None]  # no piece lies beside another
        like = beside[cKDTree((uv + shift)[beside]).query((uv + shift)[n:])[1]]
        return dissection.extended(like, edges[(edges >= n).any(axis=1)]).order

    def _local_order(self, pieces):
        """The same for the chosen `pieces` (p,) bool, where none is large: by the graph alone."""
        island, piece = self.island, self.vertex_piece
        n = len(island.vertices)
        # Little of what the air fills in reaches beyond a short outline: then the island's own order serves on.
        sides = np.bincount(island.loop_piece, [len(loop) for loop in island.loops])
        short = sides**2 <= _SHORT * np.diff(island.vertex_starts, append=n)
        order = island.order
        serves = pieces & short & ~are_small(n, island.vertex_piece)
        order = order[serves[piece[order]]]
        for chosen in (serves[piece] & (np.arange(len(piece)) >= n), (pieces & ~serves)[piece]):
            rows, number = np.flatnonzero(chosen), np.cumsum(chosen) - 1
            if len(rows):
                its = number[self.triangles.edges[chosen[self.triangles.edges].all(axis=1)]]
                order = np.concatenate([order, rows[local_order(len(rows), its, piece[rows])]])
        return order[np.argsort(piece[order], kind="stable")]

    def fix(self, fixed: Fixed, uv: np.ndarray) -> None:
        n = len(fixed.held)
        on_circle = np.concatenate([air.on_circle for air in self._airs])
        self._fixed = fixed
        self.constrained = self.constrained.refixed(*fixed.followed_by(on_circle, uv[n:]))

    def start(self, uv: np.ndarray) -> np.ndarray:
        """The island's map (n, 2) with the air's vertices where they were when the air was made."""
        return np.vstack([uv[: len(self.island.vertices)], *(air.points for air in self._airs)])

    def renewed(self, uv: np.ndarray, hindered: np.ndarray | bool = True) -> np.ndarray:
        now = quality(corners_of(uv, self._air.triangles))
        worn = np.zeros(self.island.piece_count, bool)
        least = np.where(hindered, _IN_THE_WAY, _WORN)
        least = least[self._air.piece] if least.ndim else least
        worn[self._air.piece[~(now > least * self._quality)]] = True
        worn |= self._opened(uv)
        return self._remade(uv, worn)[0] if worn.any() else uv

    def _opened(self, uv):
        """The pieces (p,) bool in which what air was left out of has opened, and must not be left empty.

        A hole that the start has drawn together is let grow first: it would be held back.
        """
        result = np.zeros(self.island.piece_count, bool)
        gaps, piece = self._left_out
        if len(gaps):
            opened = quality(corners_of(uv, gaps)) > _OPEN
            gaps, piece = gaps[opened], piece[opened]
        if len(gaps):
            opened = orientation(uv, gaps) > 0
            gaps, piece = gaps[opened], piece[opened]
            size = np.sqrt(np.abs(self.island.sums(signed_areas(corners_of(uv, self.island.triangles)))))
            on_rim = (gaps < len(self.island.vertices)).all(axis=1)
            true = _around(self.island.vertices, np.where(on_rim[:, None], gaps, 0))
            result[piece[_around(uv, gaps) >= _GROWN * size[piece] * true]] = True
        return result

    def recalled(self, uv: np.ndarray, earlier: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        chosen = pieces[self.island.vertex_piece][:, None]
        n = len(self.island.vertices)
        uv = np.vstack([np.where(chosen, earlier, uv[:n]), uv[n:]])
        return self._remade(uv, pieces) if pieces.any() else (uv, pieces)

    def _remade(self, uv, pieces):
        """The map with new air around the chosen pieces; where none can be made the old air serves on."""
        n = len(self.island.vertices)
        made = airs_around(self.island, uv[:n], self._triangulate, pieces, self._walls)
        failed = pieces & np.array([air is None for air in made])
        if (failed | ~pieces).all():
            return uv, failed
        kept = ~pieces | failed
        airs = [self._as_it_lies(k, uv) if kept[k] else made[k] for k in range(len(kept))]
        old_quality, old_piece = self._quality, self._air.piece
        self._take(airs, uv, kept)
        self._quality[kept[self._air.piece]] = old_quality[kept[old_piece]]  # that of when it was made
        return self.start(uv), failed

    def _as_it_lies(self, k, uv):
        n = len(self.island.vertices)
        return self._airs[k]._replace(points=uv[n:][self.vertex_piece[n:] == k])

    def weights(self, of_charts: Sequence[np.ndarray], uv: np.ndarray) -> np.ndarray:
        """The island's are multiplied by the factor that lets it press on the air as the air presses on it.

        Without it the island would grow or shrink for ever; where the map is an isometry it is 1.
        """
        island = self.island
        i, j = island.edges.T
        piece = island.vertex_piece[i]
        energy = np.bincount(piece, sum(of_charts[0][0] * (x[i] - x[j]) ** 2 for x in uv.T), island.piece_count)
        area = island.sums(signed_areas(corners_of(uv, island.triangles)))
        factor = np.where((area > 0) & (energy > 0), 2 * area / np.where(energy > 0, energy, 1), 1.0)
        return self.triangles.joined([of_charts[0] * factor[piece], *of_charts[1:]])

    def of(self, pieces: np.ndarray, uv: np.ndarray) -> tuple[Plane, np.ndarray]:
        number = self.island.numbering(pieces)
        chosen = pieces[self.island.vertex_piece]
        smaller = Plane(
            self.island.of(pieces, number),
            uv[: len(chosen)][chosen],
            self._fixed.of(chosen, number),
            [self._as_it_lies(k, uv) for k in np.flatnonzero(pieces)],
            self._triangulate,
            None if self._walls is None else [self._walls[k] for k in np.flatnonzero(pieces).tolist()],
        )
        smaller._quality = self._quality[pieces[self._air.piece]]
        return smaller, uv[pieces[self.vertex_piece]]


def _around(points, triangles):
    """The perimeters (t,) of triangles (t, 3) of points (n, d)."""
    corners = points[triangles]
    return np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).sum(axis=1)


def airs_around(
    island: Surface, uv: np.ndarray, triangulate: Triangulator, pieces: np.ndarray | None = None, walls: Walls = None
) -> list[Air | None]:
    """The air around every piece of an island with the map `uv` (n, 2), or of the chosen `pieces` (p,) bool, with walls
    in it; None where none can be made."""
    ends = np.append(island.vertex_starts, len(island.vertices))
    return [
        make_air(
            uv[ends[k] : ends[k + 1]],
            island.own_loops[k],
            triangulate,
            None if walls is None else walls[k],
        )
        if pieces is None or pieces[k]
        else None
        for k in range(island.piece_count)
    ]
