# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np

from qh_unwrap.core import Settings, Shape, unwrap_islands
from qh_unwrap.core.air import make_air
from qh_unwrap.core.certificate import orientation
from qh_unwrap.core.delaunay import triangulate
from qh_unwrap.core.stepping import finished
from qh_unwrap.core.walls import clear_walls

from . import shapes

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


def segments(*ends):
    return np.array(ends, float).reshape(-1, 2, 2)


def test_walls_that_meet_the_outline_or_each_other_are_none():
    apart = segments([2, 0, 2, 1], [2, 1, 3, 1], [1, 1, 2, 2])
    assert len(clear_walls(apart, [SQUARE])) == 3, "common ends do not count"
    assert len(clear_walls(np.vstack([apart, apart[:, ::-1]]), [SQUARE])) == 3, "each counts once"
    for crossing in (segments([0.5, 0.5, 2, 0.5]), segments([1, 0.5, 2, 0.5]), segments([0.2, 0, 0.8, 0])):
        assert not len(clear_walls(crossing, [SQUARE]))
    assert not len(clear_walls(segments([2, 0, 3, 1], [2, 1, 3, 0]), [SQUARE]))
    assert not len(clear_walls(segments([2, 0, 4, 0], [2, 0, 3, 0]), [SQUARE])), "one lies on the other"
    assert len(clear_walls(segments([2, 0, 3, 0], [3, 0, 4, 0]), [SQUARE])) == 2
    assert not len(clear_walls(np.empty((0, 2, 2)), [SQUARE]))


def test_the_air_has_the_walls_as_sides_and_their_ends_stay():
    uv = shapes.grid(4, 4)[0][:, :2]
    loop = np.array([0, 1, 2, 3, 4, 9, 14, 19, 24, 23, 22, 21, 20, 15, 10, 5])
    walls = segments([1.2, -0.2, 1.2, 0.6], [1.2, 0.6, 1.5, 0.7])
    points, stays, air, _ = make_air(uv, [loop], triangulate, walls)
    assert stays[-48:].all()
    everything = np.vstack([uv, points])
    assert (orientation(everything, air) > 0).all()
    ends = points[:-48][stays[:-48]]
    for wall in walls:
        assert (ends == wall[:, None]).all(axis=2).any(axis=1).all()
    edges = np.sort(np.concatenate([air[:, [0, 1]], air[:, [1, 2]], air[:, [2, 0]]]), axis=1)
    for a, b in walls:  # edges of the air cover it
        length = sum(np.linalg.norm(p - q) for p, q in _along(np.unique(edges, axis=0), everything, a, b))
        assert np.isclose(length, np.linalg.norm(b - a))


def _along(edges, points, a, b):
    """The ends of the edges that lie on the segment from a to b."""
    for p, q in points[edges]:
        parts = [complex(*(end - a)) / complex(*(b - a)) for end in (p, q)]
        if all(abs(part.imag) < 1e-9 and -1e-9 < part.real < 1 + 1e-9 for part in parts):
            yield p, q


def test_an_outline_does_not_cross_walls():
    """A square that was pressed flat between walls grows along them, and where it was."""
    vertices, triangles = shapes.grid(8, 8)
    uv = vertices[:, :2] * (1, 0.25)
    walls = segments([-3, -0.05, 4, -0.05], [-3, 0.3, 4, 0.3])
    settings = Settings(initial="CURRENT")
    free, walled = (
        finished(unwrap_islands([Shape(vertices, triangles, uv, walls=each)], settings))[0] for each in (None, walls)
    )
    assert free.report.after.symmetric_dirichlet < 1.0001
    assert walled.report.injective
    assert walled.uv[:, 1].min() > -0.05 and walled.uv[:, 1].max() < 0.3
    assert 1.01 < walled.report.after.symmetric_dirichlet < walled.report.before.symmetric_dirichlet
