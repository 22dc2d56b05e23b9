# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np

from qh_unwrap.core import Surface, repair
from qh_unwrap.core.domain import Fixed, Held
from qh_unwrap.core.pieces import joined
from qh_unwrap.core.repair import Repair
from qh_unwrap.core.weights import cotangent

from . import shapes


def marked(monkeypatch, rounds):
    """What is marked after a repair of as many grids as there are `rounds`, in so many of which each has a flip."""
    vertices, triangles, vertex_starts, triangle_starts = joined(
        *zip(*[shapes.grid(16, 16)] * len(rounds), strict=True)
    )
    surface = Surface(vertices, triangles, vertex_starts, triangle_starts)
    held = np.zeros((len(vertices), 2), bool)
    held[np.concatenate(surface.loops)] = True
    domain = Held(surface, Fixed(held, vertices[:, :2]))
    solved, solve = [0], domain.constrained.solve

    def counted(weights):
        solved[0] += 1
        return solve(weights)

    def wrong_triangles(chart, _uv):
        wrong = np.zeros(len(chart.triangles), bool)
        wrong[triangle_starts[np.array(rounds) >= solved[0]] + 200] = True
        return wrong

    monkeypatch.setattr(domain.constrained, "solve", counted)
    monkeypatch.setattr(repair, "wrong_triangles", wrong_triangles)
    monkeypatch.setattr(repair, "wrong_pieces", lambda *_: np.array(rounds) >= solved[0])
    mending = Repair(True, len(rounds))
    mending.solve(domain, domain.triangles.joined([cotangent(surface)]), vertices[:, :2])
    return np.split(mending._marked, vertex_starts[1:])


def test_a_piece_that_is_mended_is_left_alone_while_others_are_not(monkeypatch):
    together = marked(monkeypatch, [1, 4])
    for its, rounds in zip(together, ([1], [4]), strict=True):
        np.testing.assert_array_equal(its, *marked(monkeypatch, rounds))
    assert 0 < together[0].sum() < together[1].sum()
