# SPDX-License-Identifier: GPL-3.0-or-later
"""From a surface and settings to UVs and a report of them."""

from dataclasses import dataclass, field, replace

import numpy as np

from .boundary import held_vertices, outer_loop
from .distortion import Distortion, checked_uv, measure
from .errors import PinError
from .initial import initial_map
from .quasi_harmonic import energy, iterate
from .settings import Settings
from .solver import Dirichlet
from .surface import Surface
from .validity import enclosed_area, is_injective


@dataclass(frozen=True, eq=False)
class Report:
    """What an unwrap did."""

    before: Distortion | None
    """Of the UVs that were given, if any."""
    initial: Distortion
    """Of the initial map."""
    after: Distortion
    """Of the result."""
    iterations: int
    converged: bool
    """The last iteration moved no vertex by more than the tolerance."""
    changes: tuple[float, ...]
    """For every iteration, the largest movement of a vertex by the layout's diameter."""
    injective: bool
    """Certified in 32-bit floats: no triangle is flipped and no two overlap."""
    mirrored: bool
    """The given UVs were mirrored and the result is too; flips are counted the other way round."""
    warnings: tuple[str, ...]

    def to_dict(self):
        """As plain numbers, lists and dictionaries, without the arrays over triangles."""
        names = ("iterations", "converged", "injective", "mirrored")
        return {
            "before": self.before and self.before.to_dict(),
            "initial": self.initial.to_dict(),
            "after": self.after.to_dict(),
            **{name: getattr(self, name) for name in names},
            "changes": list(self.changes),
            "warnings": list(self.warnings),
        }


@dataclass(frozen=True, eq=False)
class Result:
    """New UVs (n, 2) and the report on them."""

    uv: np.ndarray = field(repr=False)
    report: Report


def unwrap(vertices, triangles, settings=None, uv=None, pinned=None):
    """Unwrap a surface.

    Parameters
    ----------
    vertices : (n, 3), any unit
    triangles : (m, 3), consistently wound; one piece, manifold, with a boundary and without handles
    settings : Settings
    uv : (n, 2), the current UVs: needed to keep the boundary or to start from them, else only measured
    pinned : (n,) bool: vertices that stay where `uv` has them (boundary KEEP), or four corners (RECTANGLE)

    Returns a `Result`: `.uv` (n, 2) within the unit square, or in the frame of `uv` for the boundary KEEP, and
    `.report`.  Raises a subclass of `UnwrapError`.
    """
    steps = unwrap_steps(vertices, triangles, settings, uv, pinned)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def unwrap_steps(vertices, triangles, settings=None, uv=None, pinned=None):
    """Like `unwrap`, as a generator that yields a `State` after each iteration and returns the `Result`."""
    settings = settings or Settings()
    surface = Surface(vertices, triangles)
    uv = None if uv is None else checked_uv(surface, uv)
    pinned = None if pinned is None else _checked_pins(surface, pinned)

    # A mirrored outline is unwrapped as seen in a mirror.
    mirrored = settings.boundary == "KEEP" and uv is not None and enclosed_area(uv[outer_loop(surface, uv)]) < 0
    mirror = np.array([-1.0, 1.0]) if mirrored else np.ones(2)
    given = None if uv is None else uv * mirror

    held, values, warnings = held_vertices(surface, settings, given, pinned)
    solid = surface if settings.boundary == "KEEP" else surface.filled(air=not settings.fill_holes)
    added = len(solid.vertices) - len(surface.vertices)
    dirichlet = Dirichlet(solid.vertices, solid.edges, np.pad(held, (0, added)), np.pad(values, ((0, added), (0, 0))))
    start = initial_map(solid, _chosen_start(settings, surface, given), dirichlet, _extended(surface, given, added))

    n = len(surface.vertices)
    changes, best, least = [], None, np.inf
    for state in iterate(solid, dirichlet, settings, start):
        if state.iteration:
            changes.append(state.change)
        # Repairs make the energy rise and fall: keep the best valid map from then on.
        if state.valid and (best is None or not state.repaired):
            best, least = state, energy(solid, state.uv, settings.balance)
        elif state.valid and (value := energy(solid, state.uv, settings.balance)) < least:
            best, least = state, value
        if state.iteration:
            yield replace(state, uv=state.uv[:n] * mirror)
    chosen = best if best is not None and state.repaired else state

    if surface.degenerate.any():
        warnings += (f"{surface.degenerate.sum()} faces have zero area",)
    report = Report(
        before=None if given is None else measure(surface, given),
        initial=measure(surface, start[:n]),
        after=measure(surface, chosen.uv[:n]),
        iterations=len(changes),
        converged=bool(changes) and changes[-1] <= settings.tolerance,
        changes=tuple(changes),
        injective=is_injective(chosen.uv[:n], surface.triangles, surface.loops),
        mirrored=bool(mirrored),
        warnings=warnings,
    )
    return Result(chosen.uv[:n] * mirror, report)


def _checked_pins(surface, pinned):
    pinned = np.asarray(pinned)
    if pinned.shape != (len(surface.vertices),) or pinned.dtype != bool:
        raise PinError(f"the pins must be True or False for each of the {len(surface.vertices)} vertices")
    return pinned


def _chosen_start(settings, surface, uv):
    if settings.initial != "AUTO":
        return settings.initial
    if settings.boundary == "KEEP":
        now = measure(surface, uv)
        if not now.flips and not now.collapsed:
            return "CURRENT"
    return "MEAN_VALUE"


def _extended(surface, uv, added):
    """The UVs of the filled surface: each hole's centre at the mean of its outline."""
    if uv is None or not added:
        return uv
    return np.vstack([uv, *(uv[loop].mean(axis=0) for loop in surface.loops[1:])])
