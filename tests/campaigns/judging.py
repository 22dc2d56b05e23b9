# SPDX-License-Identifier: GPL-3.0-or-later
"""What a stored UV map is worth, by Blender's own triangles alone: it shares no code with the add-on.

How faces hang together is found out once more, with loops and dictionaries, from what the documentation says: islands
end at seams, at the selection and where more than two faces meet; of faces with the same corners one counts, and its
twins share its UVs; faces that are inside out are turned.
"""

from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from ..core.overlaps import faults

FLAT = 1e-6  # height of a triangle by its longest side, up to which it counts as without area in space
TOUCH = 1e-6  # of the smaller triangle's area, up to which two triangles of a valid map may overlap


@dataclass(frozen=True)
class Link:
    """Two faces that hang together across an edge; their corners at its two ends."""

    faces: tuple[int, int]
    corners: tuple[tuple[int, int], tuple[int, int]]  # (one, other) at one end, and at the other end
    agree: bool  # the faces run along it in opposite ways

    def is_joined(self, uv):
        return all((uv[one] == uv[other]).all() for one, other in self.corners)


@dataclass(frozen=True)
class Surface:
    """The chosen faces of a mesh."""

    points: np.ndarray  # (n, 3), as the object shows them
    corner_vertex: list  # (c,)
    corner_edge: list  # (c,)
    face_start: list  # (f + 1,), the last is c
    seam: np.ndarray  # (e,) bool
    triangles: np.ndarray  # (t, 3) corners, as Blender draws them
    triangle_face: np.ndarray  # (t,)
    chosen: np.ndarray  # (f,) bool

    def corners_of(self, face):
        return range(self.face_start[face], self.face_start[face + 1])

    def _vertices_of(self, face):
        return tuple(self.corner_vertex[c] for c in self.corners_of(face))

    @cached_property
    def twins(self):
        """{face: the one that it lies on} of the chosen faces that are doubled."""
        uses = np.bincount(self.corner_edge, minlength=len(self.seam))
        found, first = {}, {}
        for face in np.flatnonzero(self.chosen).tolist():
            vertices = self._vertices_of(face)
            forward, backward = _from_least(vertices), _from_least(vertices[::-1])
            twin = first.setdefault(min(forward, backward), face)
            if twin == face:
                continue
            edges = [self.corner_edge[c] for c in self.corners_of(face)]
            # Two faces back to back, on which nothing else hangs, are a pillow that a seam opens.
            is_reversed = _from_least(self._vertices_of(twin)) != forward
            if not (is_reversed and (uses[edges] == 2).all() and self.seam[edges].any()):
                found[face] = twin
        return found

    @cached_property
    def links(self):
        """Those between chosen faces that are not doubled, of each face."""
        at_edge = {}
        for face in np.flatnonzero(self.chosen).tolist():
            if face not in self.twins:
                corners = list(self.corners_of(face))
                for c, following in zip(corners, corners[1:] + corners[:1], strict=True):
                    at_edge.setdefault(self.corner_edge[c], []).append((face, c, following))
        found = {}
        for edge, uses in at_edge.items():
            if len(uses) == 2 and not self.seam[edge]:
                (one, a, b), (other, c, d) = uses
                agree = self.corner_vertex[a] != self.corner_vertex[c]
                link = Link((one, other), ((a, d), (b, c)) if agree else ((a, c), (b, d)), agree)
                found.setdefault(one, []).append(link)
                found.setdefault(other, []).append(link)
        return found

    def walk(self, faces, taken=lambda link: True):
        """From every face over the links that are `taken`: the number of the part of each face, 1 or -1 where it has to
        be turned to be wound like the first of its part, and whether that came out the same on all ways."""
        part, turn, sound = {}, {}, True
        for start in faces:
            if start in part:
                continue
            part[start], turn[start] = start, 1
            waiting = [start]
            while waiting:
                face = waiting.pop()
                for link in self.links.get(face, ()):
                    if taken(link):
                        other = sum(link.faces) - face
                        wanted = turn[face] if link.agree else -turn[face]
                        if other not in part:
                            part[other], turn[other] = start, wanted
                            waiting.append(other)
                        sound &= turn[other] == wanted
        return part, turn, sound

    @cached_property
    def islands(self):
        """Sets of faces, doubled ones with their twins."""
        single = [face for face in np.flatnonzero(self.chosen).tolist() if face not in self.twins]
        part, _, _ = self.walk(single)
        found = {}
        for face in single:
            found.setdefault(part[face], set()).add(face)
        for face, twin in self.twins.items():
            found[part[twin]].add(face)
        return list(found.values())

    def wound(self, faces, uv):
        """The island's triangles (t, 3), doubled ones left out, all wound alike, and the part of each, (t,).

        What is one-sided is wound alike in as far as its UVs hang together.
        """
        single = [face for face in sorted(faces) if face not in self.twins]
        part, turn, sound = self.walk(single)
        if not sound:
            part, turn, _ = self.walk(single, lambda link: link.is_joined(uv))
        its = np.isin(self.triangle_face, single)
        owner = self.triangle_face[its].tolist()
        backward = np.array([turn[face] < 0 for face in owner])
        triangles = np.where(backward[:, None], self.triangles[its][:, ::-1], self.triangles[its])
        return triangles, np.array([part[face] for face in owner])

    def has_area(self, triangles):
        corners = self.points[np.array(self.corner_vertex)[triangles]]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return area > FLAT * sides.max(axis=1) ** 2

    def why_invalid(self, faces, uv):
        """What is wrong with an island's map, but for rounding; nothing if it is valid."""
        triangles, part = self.wound(faces, uv)
        solid = self.has_area(triangles)
        if not np.isfinite(uv[triangles]).all():
            return "not finite"
        sign = orientation(uv[triangles])[solid]
        side = _majority(sign, part[solid])
        if (sign * side <= 0).any():
            return f"{(sign * side < 0).sum()} flipped and {(sign == 0).sum()} collapsed"
        overlapping = 0
        for one, other in faults(uv, triangles[solid])[2]:
            corners = uv[triangles[solid][[one, other]]].astype(float)
            overlapping += shared_area(*corners) > TOUCH * min(map(_area, corners))
        return f"{overlapping} pairs of triangles overlap" if overlapping else ""

    def flips(self, faces, uv):
        """How many of an island's triangles that have area in space are flipped or collapsed in its map."""
        triangles, part = self.wound(faces, uv)
        solid = self.has_area(triangles)
        sign = orientation(uv[triangles])[solid]
        return int((sign * _majority(sign, part[solid]) <= 0).sum())

    def why_uncertain(self, faces, uv):
        """What is wrong with an island's certificate: a kind and a text for each fault."""
        triangles, part = self.wound(faces, uv)
        solid = self.has_area(triangles)
        sign = orientation(uv[triangles])
        side = sign * _majority(sign, part)
        found = []
        for kind, its in (("has flipped", (side < 0) & solid), ("has collapsed", (side == 0) & solid)):
            if its.any():
                found.append((f"{kind} triangles", f"{its.sum()} of {len(triangles)}, such as {triangles[its][0]}"))
        its = self._doubled(faces, uv, _majority(sign, part)[0]) if len(set(part)) == 1 else []
        if len(its):
            found.append(("has flipped or collapsed doubled triangles", f"{len(its)}, such as {its[0]}"))
        if ((side < 0) & ~solid).any():
            found.append(("has flipped triangles without area", f"{((side < 0) & ~solid).sum()} of {len(triangles)}"))
        pairs = faults(uv, triangles)[2]
        if len(pairs):
            share = [shared_area(*uv[triangles[pair]].astype(float)) for pair in pairs[:20]]
            overlap = f"{len(pairs)} pairs, such as {triangles[pairs[0]].tolist()}, by {max(share):.3g}"
            found.append(("has overlapping triangles", overlap))
        return found + self._apart(faces, uv)

    def _doubled(self, faces, uv, side):
        """The triangles (t, 3) of doubled faces that are not wound as the others, of which most have the `side`."""
        _, turn, sound = self.walk([face for face in sorted(faces) if face not in self.twins])
        found = []
        if not sound:  # which way its faces are turned depends on where it was cut
            return found
        for face in sorted(set(faces) & set(self.twins)):
            twin = self.twins[face]
            alike = _from_least(self._vertices_of(face)) == _from_least(self._vertices_of(twin))
            triangles = self.triangles[self.triangle_face == face]
            triangles = triangles[self.has_area(triangles)]
            wanted = side * turn[twin] * (1 if alike else -1)
            found += triangles[orientation(uv[triangles]) != wanted].tolist()
        return found

    def _apart(self, faces, uv):
        """Links that are torn, where the island is not one-sided, and doubled faces that do not lie on their twins."""
        single = [face for face in faces if face not in self.twins]
        found = []
        if self.walk(single)[2]:
            torn = {link.corners[0] for face in single for link in self.links.get(face, ()) if not link.is_joined(uv)}
            if torn:
                found.append(("is torn", f"at {len(torn)} edges, such as at the corners {min(torn)}"))
        for face in set(faces) & set(self.twins):
            at = {self.corner_vertex[c]: c for c in self.corners_of(self.twins[face])}
            if any((uv[c] != uv[at[self.corner_vertex[c]]]).any() for c in self.corners_of(face)):
                found.append(("has a doubled face apart from its twin", f"face {face}"))
        return found

    def holes(self, faces):
        """How many an island has that is a disk with holes, with sound faces, none doubled and none cut alike; None
        of any other.
        """
        _, turn, sound = self.walk(sorted(faces))
        if not sound or any(face in self.twins for face in faces):
            return None
        vertex = self._uv_vertices(faces)
        sides = []
        for face in faces:
            corners = list(self.corners_of(face))[:: turn[face]]
            if len({self.corner_vertex[c] for c in corners}) < len(corners):
                return None
            around = [vertex[c] for c in corners]
            sides += zip(around, around[1:] + around[:1], strict=True)
        if len(set(sides)) < len(sides):
            return None
        loops = _loops({one: other for one, other in set(sides) if (other, one) not in set(sides)})
        euler = len(set(vertex.values())) - len({frozenset(side) for side in sides}) + len(faces)
        its = np.isin(self.triangle_face, sorted(faces))
        with_area = set(self.triangle_face[its][self.has_area(self.triangles[its])].tolist())
        if euler != 2 - loops or loops == 0 or with_area != set(faces) or self.is_cut_alike(faces):
            return None
        return loops - 1

    def is_cut_alike(self, faces):
        """Whether Blender draws two of an island's faces with a diagonal between the same vertices, or with a side of
        a third: of the triangles beside it one is flipped in any map."""
        single = [face for face in faces if face not in self.twins]
        vertex = self._uv_vertices(single)
        triangles = self.triangles[np.isin(self.triangle_face, single)].tolist()
        sides = Counter(frozenset((vertex[t[k - 1]], vertex[t[k]])) for t in triangles for k in range(3))
        return max(sides.values()) > 2

    def is_joined(self, faces, uv):
        """Whether an island's UVs hang together wherever its faces do."""
        return all(link.is_joined(uv) for face in faces for link in self.links.get(face, ()))

    def _uv_vertices(self, faces):
        """{corner: a number, the same for those that links join} of an island's corners."""
        parent = {c: c for face in faces for c in self.corners_of(face)}

        def root(c):
            while parent[c] != c:
                c = parent[c]
            return c

        for face in faces:
            for link in self.links.get(face, ()):
                for one, other in link.corners:
                    parent[root(one)] = root(other)
        return {c: root(c) for c in parent}


def _from_least(vertices):
    least = vertices.index(min(vertices))
    return vertices[least:] + vertices[:least]


def _loops(following):
    """How many loops {vertex: the one after it} makes."""
    following, count = dict(following), 0
    while following:
        first, vertex = following.popitem()
        while vertex != first:
            vertex = following.pop(vertex)
        count += 1
    return count


def _majority(sign, part):
    """1 or -1 for each triangle (t,): the sign that most of its part have."""
    side = np.ones(len(sign), dtype=int)
    for number in np.unique(part):
        its = part == number
        side[its] = 1 if sign[its].sum() >= 0 else -1
    return side


def orientation(corners):
    """The signs (t,) of the areas of triangles (t, 3, 2) of 32-bit floats, exactly."""
    a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
    (x, y), (u, v) = (b - a).T, (c - a).T
    area, error = x * v - y * u, 1e-15 * (np.abs(x * v) + np.abs(y * u))
    sign = np.sign(area).astype(int)
    for k in np.flatnonzero(np.abs(area) <= error):
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(value) for value in point[k].tolist()] for point in (a, b, c))
        exact = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        sign[k] = (exact > 0) - (exact < 0)
    return sign


def _area(polygon):
    x, y = (polygon - polygon[0]).T
    return abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2


def shared_area(one, other):
    """The area that two triangles (3, 2) share, in floating point."""
    a, b, c = other if orientation(other[None])[0] > 0 else other[::-1]
    origin = one[0].copy()
    polygon = one - origin
    for start, end in ((a, b), (b, c), (c, a)):
        x, y = end - start
        height = x * (polygon - (start - origin))[:, 1] - y * (polygon - (start - origin))[:, 0]
        clipped = []
        for k in range(len(polygon)):
            if height[k - 1] * height[k] < 0:
                share = height[k - 1] / (height[k - 1] - height[k])
                clipped.append(polygon[k - 1] + share * (polygon[k] - polygon[k - 1]))
            if height[k] >= 0:
                clipped.append(polygon[k])
        if len(clipped) < 3:
            return 0.0
        polygon = np.array(clipped)
    return _area(polygon)
