# SPDX-License-Identifier: GPL-3.0-or-later
"""What a seam along a tube would bring."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from .cuttable import Cuttable, Polygons
from .errors import UnwrapError
from .islands import Island
from .paths import Paths
from .report import Result, Shape
from .settings import Settings
from .unwrapping import unwrap_islands


def unwrapped_along_a_seam(
    polygons: Polygons, island: Island, settings: Settings | None = None
) -> Generator[float, None, Result | None]:
    """The `Result` of an island with two boundary loops after the shortest cut from one to the other.

    A generator: yields the share that is done.  Returns None where there are not two loops, or no edges between them.
    """
    try:
        mesh = Cuttable(polygons, island)
    except UnwrapError:
        return None
    whole = mesh.opened(np.zeros(len(mesh.edges), bool))
    loop = np.full(len(mesh.points), -1)
    loop[whole.origin] = whole.loop
    if loop.max() != 1:
        return None
    paths = Paths(len(mesh.points), mesh.edges, mesh.lengths, mesh.inner, np.flatnonzero(loop == 0))
    ends = np.flatnonzero(loop == 1)
    end = ends[np.argmin(paths.distance[ends])]
    if not np.isfinite(paths.distance[end]):
        return None
    cut = np.zeros(len(mesh.edges), bool)
    cut[paths.to(end)] = True
    opened = mesh.opened(cut)
    (result,) = yield from unwrap_islands([Shape(mesh.points[opened.origin], opened.triangles)], settings)
    return None if isinstance(result, UnwrapError) else result
