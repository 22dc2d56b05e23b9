# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of several shapes says of each what there is to say of it."""

import numpy as np
import pytest

from qh_unwrap.core import Result, Settings, Shape, Unwrapper, errors

from . import shapes


def finished(session):
    while session.step():
        pass
    return session


@pytest.fixture(scope="module")
def bump():
    vertices, triangles = shapes.bump(1)
    return vertices, triangles, vertices[:, :2]


def test_only_shapes_with_errors_have_no_state(bump):
    sound, without_uv = Shape(*bump), Shape(*bump[:2])
    session = finished(Unwrapper([Shape(*shapes.tetrahedron()), sound, without_uv, sound], Settings(boundary="KEEP")))
    kinds = [type(result) for result in session.results()]
    assert kinds == [errors.ClosedError, Result, errors.UVError, Result]
    assert [session.state(k) is not None for k in range(4)] == [False, True, False, True]


def test_an_outline_that_could_not_be_held_can_be_set_free(bump):
    session = finished(Unwrapper([Shape(*bump[:2])], Settings(boundary="KEEP")))
    assert type(session.results()[0]) is errors.UVError
    session.settings = Settings()
    (result,) = finished(session).results()
    assert isinstance(result, Result) and result.report.injective


def test_every_shape_has_its_own_pins(bump):
    shapes_of = [Shape(*shapes.tetrahedron()), Shape(*shapes.ring()), Shape(*bump), Shape(*bump)]
    session = finished(Unwrapper(shapes_of, Settings()))
    pinned = np.zeros(len(bump[0]), bool)
    pinned[[3, 20]] = True
    before = [session.state(k) for k in range(4)]
    target = before[2].uv.copy()
    target[[3, 20]] += [[0.02, -0.01], [-0.02, 0.01]]
    session.move(pinned, target, shape=2)
    after = finished(session).results()
    np.testing.assert_allclose(after[2].uv[pinned], target[pinned], rtol=0, atol=1e-12)
    assert after[2].report.injective and after[2].report.after.symmetric_dirichlet < 1.2
    np.testing.assert_allclose(after[3].uv, before[3].uv, rtol=0, atol=1e-3)
    with pytest.raises(errors.PinError):
        session.move(pinned, target, shape=0)


def test_bad_pins_are_refused_whatever_the_size(bump, monkeypatch):
    monkeypatch.setattr("qh_unwrap.core.locality.MANY", 50)
    session = finished(Unwrapper([Shape(*bump)]))
    uv = np.full(bump[2].shape, np.nan)
    for k in (0, 30, 100):
        pinned = np.arange(len(uv)) == k
        with pytest.raises(errors.UVError):
            session.move(pinned, uv)
        only_it = np.where(pinned[:, None], session.state().uv, np.nan)
        session.move(pinned, only_it)
    with pytest.raises(errors.PinError):
        session.move(np.zeros(3, bool), bump[2])
