# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be wrong with the input, one type per cause; each message says what, where and what to do."""

import numpy as np


class UnwrapError(ValueError):
    """Base of every error that the core raises about its input."""


class OutOfMemoryError(UnwrapError):
    """The memory does not suffice."""


class SingularError(UnwrapError):
    """The equations for the island have no solution."""


class InternalError(UnwrapError):
    """Something unforeseen went wrong with one island; its traceback is printed."""


class SettingsError(UnwrapError):
    """A setting is out of its range, or two settings exclude each other."""


class UVError(UnwrapError):
    """UVs are needed and missing, or have the wrong shape or values."""


class PinError(UnwrapError):
    """Pins are given where the chosen boundary cannot honour them."""


class BoundaryError(UnwrapError):
    """The outline cannot go where the settings want it, or a triangulator of the caller's returned no triangulation."""


class BorderError(BoundaryError):
    """The outline is to stay, and cannot be that of any map; `fault` says why."""

    def __init__(self, fault: str, cure: str):
        super().__init__(f"{fault}: {cure}")
        self.fault = fault


class SurfaceError(UnwrapError):
    """The triangles do not make a surface that can be unwrapped.

    `triangles` holds the indices (k,) of the triangles at fault; it is empty where no single ones are.
    """

    def __init__(self, message: str, triangles: np.ndarray | tuple[()] = ()):
        super().__init__(message)
        self.triangles = triangles


class ShapeError(SurfaceError):
    """The arrays have the wrong shape or type, or there is nothing in them."""


class NotFiniteError(SurfaceError):
    """A coordinate is NaN or infinite."""


class IndexRangeError(SurfaceError):
    """A triangle refers to a vertex that does not exist."""


class LooseVertexError(SurfaceError):
    """A vertex belongs to no triangle."""


class DegenerateError(SurfaceError):
    """A triangle uses one vertex twice, or the whole surface has no area."""


class DuplicateError(SurfaceError):
    """Two triangles have the same three vertices."""


class NonManifoldEdgeError(SurfaceError):
    """An edge has more than two triangles."""


class WindingError(SurfaceError):
    """Neighbouring triangles are wound in opposite directions."""


class NonManifoldVertexError(SurfaceError):
    """The triangles around a vertex do not form one fan."""


class DisconnectedError(SurfaceError):
    """The surface has several pieces."""


class ClosedError(SurfaceError):
    """The surface has no boundary."""


class GenusError(SurfaceError):
    """The surface has a handle, like a torus."""
