# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps to begin with."""

import numpy as np
from scipy.interpolate import RBFInterpolator

from .certificate import are_crossed, crossing_sides
from .chart import Surface
from .domain import Fixed, Held
from .loops import followers
from .pieces import starts_of
from .triangles import corners_of, normals, sums_by_parts
from .weights import cotangent, mean_value, uniform

_ROUNDEST = 0.5  # share of a circle's bends that outlines take on at most not to cross themselves,
_HALVINGS = 3  # of the range in which the least such share is looked for
_REACH = 4  # lengths of what lies between two crossing sides, to which it bends around them
_SEVERAL = 500  # pairs of crossing sides that are looked at
_SAMPLE = 1000  # points that lead the others, at most
_WEIGHTS = {"UNIFORM": uniform, "HARMONIC": cotangent, "MEAN_VALUE": mean_value}


def weighted_map(domain: Held, initial: str) -> np.ndarray:
    """The map (n, 2) of a domain by the fixed weights that `initial` names, with what is held in its place."""
    make = _WEIGHTS[initial]
    return domain.constrained.solve(domain.triangles.joined([make(chart) for chart in domain.charts]))


def fit(points: np.ndarray, chosen: np.ndarray, targets: np.ndarray, mirror: bool = False) -> np.ndarray:
    """The points (n, 2) moved by the similarity that brings the `chosen` ones, (n,) bool, nearest to `targets` (n, 2).

    With `mirror` it may be a mirrored similarity, if that brings them nearer.
    """
    z, target = (xy[:, 0] + 1j * xy[:, 1] for xy in (points, targets))
    best = min(
        (_fit(candidate, chosen, target) for candidate in ((z, z.conj()) if mirror else (z,))),
        key=lambda found: found[0],
    )[1]
    return np.column_stack([best.real, best.imag])


def _fit(z, chosen, target):
    """How far the chosen points stay from their targets, and all points moved; points are complex numbers (n,)."""
    centred, wanted = z - z[chosen].mean(), target[chosen] - target[chosen].mean()
    size = np.vdot(centred[chosen], centred[chosen]).real
    factor = (np.vdot(centred[chosen], wanted) / size if size > 0 else 0) or 1.0  # it rotates and scales
    fitted = factor * centred + target[chosen].mean()
    return np.linalg.norm(fitted[chosen] - target[chosen]), fitted


def led(points: np.ndarray, held: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The points (n, 2) after their `held` coordinates, (n, 2) bool, went to `values` (n, 2), and the others with them.

    They follow smoothly wherever they lie in between, so that what is mapped one to one mostly stays so.
    """
    result = np.where(held, values, points)
    for axis in range(2):
        rows = np.flatnonzero(held[:, axis])
        rows = rows[:: -(-len(rows) // _SAMPLE) or 1]
        _, first = np.unique(points[rows], axis=0, return_index=True)
        rows = rows[np.sort(first)]
        offsets = values[rows, axis] - points[rows, axis]
        if offsets.any():
            try:
                follow = RBFInterpolator(points[rows], offsets, kernel="linear", degree=0)
            except np.linalg.LinAlgError:  # where points lie too close together
                continue
            free = ~held[:, axis]
            result[free, axis] += follow(points[free])
    return result


def project(surface: Surface) -> np.ndarray:
    """The projection of every piece on its least-squares plane, seen from the side that its faces look to, (n, 2)."""

    def moments(corner_vertex):
        corners = corners_of(surface.vertices, corner_vertex.T)
        normal = normals(corners).T
        share = np.linalg.norm(normal, axis=0)
        # The second moments of a triangle are those of its corners and of three times its centre, each a twelfth.
        x, y, z = (np.vstack([along, along.sum(axis=0)]) for along in corners.T)
        pairs = (x, x), (x, y), (x, z), (y, y), (y, z), (z, z)
        second = [share * (one * other).sum(axis=0) / 12 for one, other in pairs]
        return np.array([*normal, share, *(share * along[3] / 3 for along in (x, y, z)), *second])

    total = sums_by_parts(moments, surface.triangle_starts, surface.triangles.T)
    normal, middle, second = total[:3], total[4:7] / total[3], total[7:] / total[3]
    xx, xy, xz, yy, yz, zz = second - middle[[0, 0, 0, 1, 1, 2]] * middle[[0, 1, 2, 1, 2, 2]]
    axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).T)[1]
    across, right = axes[:, :, 0], axes[:, :, 2]  # the least and the most extent
    back = (normal.T * across).sum(axis=1) < 0
    across = np.where(back[:, None], -across, across)
    # Of the two ways round, take that with the farther end to the right: a rotated surface has the same map.
    piece, starts = surface.vertex_piece, surface.vertex_starts
    along = np.einsum("ij,ij->i", surface.vertices, right[piece])
    left = np.maximum.reduceat(along, starts) < -np.minimum.reduceat(along, starts)
    right = np.where(left[:, None], -right, right)
    along = np.where(left[piece], -along, along)
    up = np.cross(across, right)
    return np.array([along, np.einsum("ij,ij->i", surface.vertices, up[piece])]).T


def conformal(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """The conformal map of every piece with the lengths of its outline, (n, 2): a flattening of Sawhney, Crane 2017.

    Of all conformal maps of a disk it has the least area distortion: its scale factors exp(u) are 1 along the outline.
    u solves Yamabe's equation, and its flux out of the outline tells how much the map's outline bends at each vertex.
    Holes are closed meanwhile.

    Where the outline would cross itself, it bends as much more like a circle as it needs to be free of that, up to half
    way.  Also returns which pieces were so opened, (p,) bool: their maps are nearly conformal only.
    """
    loop = np.concatenate(surface.outlines)
    fixed = Fixed(np.zeros((len(surface.vertices), 2), bool), np.zeros((len(surface.vertices), 2)))
    fixed.held[loop] = True
    solid = Held(surface, fixed, surface.plugs(solid=True))
    n = len(solid.vertex_piece)
    weights = solid.triangles.joined([cotangent(chart) for chart in solid.charts])
    angle_sums = np.sum([chart.angle_sums(n) for chart in solid.charts], axis=0)
    solve = solid.constrained.factor(weights)
    u = solve(np.zeros((n, 1)), (angle_sums - 2 * np.pi)[:, None])[:, 0]
    i, j = solid.triangles.edges.T
    flux = np.bincount(i, weights[0] * (u[i] - u[j]), n) + np.bincount(j, weights[1] * (u[j] - u[i]), n)
    places, opened = _Outlines(surface, np.pi - angle_sums[loop] + flux[loop]).uncrossed()
    outline = np.zeros((n, 2))
    outline[loop] = places
    return _turned_by_farthest(surface, solve(outline)[: len(surface.vertices)]), opened


class _Outlines:
    """The outlines of a surface's pieces in the plane, with the lengths that they have in space, or nearly.

    Their vertices, k in all, are taken outline after outline.

    bend  (k,), by how much each is to bend at each of its vertices, in radians
    """

    def __init__(self, surface: Surface, bend: np.ndarray):
        self._starts = starts_of(surface.outlines)
        loop = np.concatenate(surface.outlines)
        size = np.diff(self._starts, append=len(loop))
        self._piece = np.repeat(np.arange(len(size)), size)
        self._length = np.linalg.norm(surface.vertices[followers(surface.outlines)] - surface.vertices[loop], axis=1)
        self._before = np.arange(-1, len(loop) - 1)
        self._before[self._starts] = self._starts + size - 1
        self._bend, self._whole = bend, surface.outline_lengths
        self._circle = np.pi * (self._length + self._length[self._before]) / self._whole[self._piece]

    def at(self, share: np.ndarray) -> np.ndarray:
        """The places (k, 2) of outlines that bend by such a share, (k,), like circles instead, closed by the least
        change of their lengths."""
        more = share * (self._circle - self._bend)
        more -= np.add.reduceat(more, self._starts)[self._piece] * self._circle / (2 * np.pi)
        direction = np.cumsum(self._bend + more)  # of the side that follows each vertex
        along = np.column_stack([np.cos(direction), np.sin(direction)])
        gap = np.add.reduceat(self._length[:, None] * along, self._starts)
        stiffness = np.add.reduceat(self._length[:, None, None] * along[:, :, None] * along[:, None], self._starts)
        change = (np.linalg.pinv(stiffness) @ gap[:, :, None])[self._piece, :, 0]
        length = self._length * (1 - (along * change).sum(axis=1))
        # Closed, they end where the next one begins.
        return np.cumsum(length[:, None] * along, axis=0)[self._before]

    def uncrossed(self) -> tuple[np.ndarray, np.ndarray]:
        """The places (k, 2) of outlines that bend like circles as little as they must not to cross themselves, if that
        helps: around where they would, else everywhere; and which do so, (p,) bool."""
        share, opened = np.zeros(len(self._bend)), np.zeros(len(self._starts), bool)
        crossed = self._crossed(share, ~opened)
        for where in (self._around, np.ones_like) if crossed.any() else ():
            weight = where(share)
            least, most = np.zeros(len(opened)), np.where(crossed, _ROUNDEST, 0)
            most[self._crossed(most[self._piece] * weight, crossed)] = 0
            for _ in range(_HALVINGS if most.any() else 0):
                middle = (least + most) / 2
                enough = ~self._crossed(middle[self._piece] * weight, most > 0)
                least, most = np.where(enough, least, middle), np.where(enough, middle, most)
            share += most[self._piece] * weight
            opened |= most > 0
            crossed &= ~opened
            if not crossed.any():
                break
        return self.at(share), opened

    def _polygons(self, share):
        return np.split(self.at(share), self._starts[1:])

    def _crossed(self, share, asked):
        """Which of the pieces that are `asked` for cross themselves with such shares, (p,) bool."""
        result = np.zeros(len(asked), bool)
        which = np.flatnonzero(asked)
        if len(which):
            polygons = self._polygons(share)
            result[which] = are_crossed([polygons[k] for k in which], np.arange(len(which)))
        return result

    def _around(self, share):
        """How much every vertex belongs to what lies between sides that cross with such shares, from 0 to 1, (k,)."""
        weight = np.zeros(len(share))
        at = np.cumsum(self._length) - self._length
        found = 0
        for sides in crossing_sides(self._polygons(share), np.arange(len(self._starts))):
            for one, other in np.sort(np.column_stack(sides), axis=1)[: _SEVERAL - found].tolist():
                piece = self._piece[one]
                first, whole = self._starts[piece], self._whole[piece]
                its = slice(first, first + np.searchsorted(self._piece[first:], piece, "right"))
                # The shorter of both parts of the outline
                begin, length = at[one], at[other] - at[one]
                if length > whole / 2:
                    begin, length = at[other], whole - length
                away = np.abs((at[its] - begin - length / 2 + whole / 2) % whole - whole / 2) - length / 2
                weight[its] = np.maximum(weight[its], np.clip(1 - away / (_REACH * length), 0, 1))
            found += len(sides[0])
            if found >= _SEVERAL:
                break
        return weight


def _turned_by_farthest(surface, uv):
    """Every piece's map (n, 2) turned so that the vertex farthest from its middle lies to the right, whatever the
    vertices' numbers are.
    """
    piece, starts = surface.vertex_piece, surface.vertex_starts
    count = np.diff(starts, append=len(uv))
    z = uv @ np.array([1, 1j])
    z = z - (np.add.reduceat(z, starts) / count)[piece]
    distance = np.abs(z)
    is_farthest = distance >= (1 - 1e-6) * np.maximum.reduceat(distance, starts)[piece]  # of equal ones the first
    farthest = np.flatnonzero(is_farthest)
    farthest = farthest[np.diff(piece[farthest], prepend=-1) > 0]
    way = np.conj(z[farthest]) / np.maximum(distance[farthest], np.finfo(float).tiny)
    z = z * way[piece]
    return np.column_stack([z.real, z.imag])
