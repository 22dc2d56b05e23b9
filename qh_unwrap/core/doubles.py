# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces on top of others with the same corners."""

from dataclasses import dataclass

import numpy as np

from .pieces import first_and_last


@dataclass(frozen=True)
class Doubles:
    """Faces that lie on another one, their twin, which has the same vertices in the same or in the reverse order."""

    faces: np.ndarray  # (d,)
    twin_faces: np.ndarray  # (d,) what each lies on
    is_reversed: np.ndarray  # (d,) bool, whether it looks the other way than its twin
    corners: np.ndarray  # (k,) of all these faces
    twins: np.ndarray  # (k,) the corners of their twins at the same vertices

    def among(self, count: int) -> np.ndarray:
        """Which of `count` faces are doubled, (count,) bool."""
        found = np.zeros(count, dtype=bool)
        found[self.faces] = True
        return found


def find_doubles(
    corner_vertex: np.ndarray, corner_edge: np.ndarray, face_start: np.ndarray, seam: np.ndarray, selected: np.ndarray
) -> Doubles:
    """The doubled faces.  Of several faces on each other one is the twin of the rest: the first that is selected, or
    else the first.

    corner_vertex, corner_edge  (c,) vertex and edge of each corner
    face_start                  (f,) first corner of each face, ascending
    seam                        (e,) bool, one per edge
    selected                    (f,) bool

    A pillow, two faces that nothing else hangs on, back to back, is opened by a seam if it has one: these are not
    doubled.
    """
    suspects = _suspects(corner_edge, face_start, len(seam))
    sizes = np.diff(face_start, append=len(corner_vertex))[suspects]
    found = [_NONE]
    for size in np.unique(sizes):
        faces = suspects[sizes == size]
        corners, ahead = _from_least(face_start[faces][:, None] + np.arange(size), corner_vertex)
        group = np.unique(corner_vertex[corners], axis=0, return_inverse=True)[1].ravel()
        order = np.lexsort((faces, ~selected[faces], group))
        twin = np.empty(len(faces), dtype=np.intp)  # of each face, its place among `faces`
        twin[order] = order[np.searchsorted(group[order], group[order])]
        is_reversed = ahead != ahead[twin]
        doubled = twin != np.arange(len(faces))
        if doubled.any():
            doubled &= ~(is_reversed & _is_cut_open(corner_edge, seam, corners))
        its, others = corners[doubled].ravel(), corners[twin[doubled]].ravel()
        found.append(Doubles(faces[doubled], faces[twin[doubled]], is_reversed[doubled], its, others))
    return Doubles(*(np.concatenate([getattr(each, name) for each in found]) for name in vars(_NONE)))


_NONE = Doubles(*(np.zeros(0, kind) for kind in (np.intp, np.intp, bool, np.intp, np.intp)))


def _suspects(corner_edge, face_start, edge_count):
    """The faces, by number, that share their least and their greatest edge with some other face, and a few more."""
    if not len(face_start):
        return np.zeros(0, dtype=np.intp)
    least, greatest = np.minimum.reduceat(corner_edge, face_start), np.maximum.reduceat(corner_edge, face_start)
    first, last = (each[least] for each in first_and_last(np.arange(len(least)), least, edge_count))
    crowded = np.bincount(least, minlength=edge_count)[least] > 2
    return np.flatnonzero((first != last) & (crowded | (greatest[first] == greatest[last])))


def _from_least(corners, corner_vertex):
    """The faces' corners, (k, s), from the one at the least vertex towards the lesser of its neighbours, and whether
    that is the way in which they were given, (k,) bool."""
    size = corners.shape[1]
    first, steps = corner_vertex[corners].argmin(axis=1)[:, None], np.arange(size)
    onward, back = (np.take_along_axis(corners, (first + way * steps) % size, axis=1) for way in (1, -1))
    ahead = corner_vertex[onward[:, 1]] < corner_vertex[back[:, 1]]
    return np.where(ahead[:, None], onward, back), ahead


def _is_cut_open(corner_edge, seam, corners):
    """Which faces, given by their corners (k, s), have a seam and share all their edges with one face, (k,) bool."""
    edges = corner_edge[corners]
    uses = np.bincount(corner_edge, minlength=len(seam))
    return (uses[edges] == 2).all(axis=1) & seam[edges].any(axis=1)
