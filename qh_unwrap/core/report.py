# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes into an unwrap and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .distortion import Distortion


@dataclass(frozen=True, eq=False)
class Shape:
    """An island to unwrap.

    vertices   (n, 3), any unit
    triangles  (m, 3), consistently wound; one piece, manifold, with a boundary and without handles
    uv         (n, 2), its current UVs: needed for pins, to keep the boundary or to start from them, else only measured
    pinned     (n,) bool, or (n, 2) for U and V: what stays where `uv` has it (boundary FREE or KEEP), or four corners
               (RECTANGLE)
    partner    (n, 2) int, for U and V of every vertex the vertex that it keeps its distance from, itself for nobody
               (boundary FREE or KEEP, with `uv`)
    start      (n, 2), the map to begin with, if it is another one than `uv`: pins are led from it to where `uv` has
               them (boundary FREE, start AUTO); one with flips is not taken
    crossing   whether an outline that crosses itself is kept all the same (boundary KEEP)
    walls      (w, 2, 2), segments in the frame of `uv` that the outline must not cross (boundary FREE); those that
               cross it already, or each other, do not count
    face       (m,) int, the polygon that each triangle is a part of, where warnings are to speak of polygons
    importance (m,), positive: how many times as large each triangle shall be in the map as one of importance 1
    """

    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray | None = None
    pinned: np.ndarray | None = None
    partner: np.ndarray | None = None
    face: np.ndarray | None = None
    importance: np.ndarray | None = None
    start: np.ndarray | None = None
    crossing: bool = False
    walls: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class State:
    """The map of an island after a step."""

    iteration: int
    """0 for the initial map."""
    uv: np.ndarray = field(repr=False)
    """(n, 2)"""
    change: float
    """The largest movement of a vertex, relative to the layout's diameter; infinite for the initial map."""
    valid: bool
    """No triangle, air included, is flipped or collapsed in 32-bit floats."""
    converged: bool
    """No vertex moved by more than the tolerance, and none was held back; or a further refinement would not pay."""
    repaired: bool
    """Weights had to be changed, in this step or an earlier one, to turn flipped triangles back."""


@dataclass(frozen=True, eq=False)
class Report:
    """What an unwrap did."""

    before: Distortion | None
    """That of the UVs that were given, if any."""
    after: Distortion
    """That of the result."""
    iterations: int
    """How many there were, those of the refinement included."""
    converged: bool
    """The last iteration moved no vertex by more than the tolerance, or the refinement no longer paid."""
    changes: tuple[float, ...]
    """For every iteration, the largest movement of a vertex, relative to the layout's diameter."""
    injective: bool
    """It is certified in 32-bit floats that no triangle is flipped and no two overlap."""
    mirrored: bool
    """The given UVs were mirrored and the result is too; flips are counted the other way round."""
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers, lists and dictionaries, without the arrays over triangles."""
        names = ("iterations", "converged", "injective", "mirrored")
        return {
            "before": self.before and self.before.to_dict(),
            "after": self.after.to_dict(),
            **{name: getattr(self, name) for name in names},
            "changes": list(self.changes),
            "warnings": list(self.warnings),
        }


@dataclass(frozen=True, eq=False)
class Result:
    """New UVs (n, 2), the report on them, and the surface's boundary loops, the outline first."""

    uv: np.ndarray = field(repr=False)
    report: Report
    loops: list[np.ndarray] = field(repr=False)


def face_warnings(flat: np.ndarray, face: np.ndarray | None) -> tuple[str, ...]:
    """The warning, in a tuple, that faces have no area; an empty tuple for none.

    flat  (m,) bool, the triangles without area
    face  (m,) int, the face that each is a part of, None where each is one
    """
    count = int(flat.sum())
    if count and face is not None:
        faces, parts = np.unique(face, return_inverse=True)
        count = len(faces) - len(np.unique(parts[~flat]))
    return (f"{count} {'face has' if count == 1 else 'faces have'} zero area",) if count else ()
