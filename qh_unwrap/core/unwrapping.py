# SPDX-License-Identifier: GPL-3.0-or-later
"""From a surface and settings to UVs and a report of them."""

from dataclasses import dataclass, field, replace

import numpy as np

from . import locality
from .boundary import held_vertices, outer_loop
from .descent import descend
from .distortion import Distortion, checked_uv, measure
from .errors import BoundaryError, PinError, SurfaceError, UVError
from .exterior import Exterior
from .initial import conformal, fit, initial_map, project
from .quasi_harmonic import Held, State, check_settings, energy, iterate, movement
from .settings import Settings
from .solver import Dirichlet
from .stepping import finished, mapped
from .surface import Surface, checked_arrays
from .triangles import box
from .validity import enclosed_area, invalid, is_injective

_HANDOVER = 0.9  # an iteration that lowers the energy by less than this part of it gives way to the refinement
ISOMETRIC = 1 + 1e-6  # the energy of a map that nothing could better visibly
# The starts to choose from, the cheapest first, and the energy that needs no further one
_STARTS = {"PROJECTION": 1 + 1e-3, "CONFORMAL": 2, "MEAN_VALUE": np.inf}


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
    """Those of the refinement included."""
    converged: bool
    """The last iteration moved no vertex by more than the tolerance, or the refinement no longer paid."""
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
    """New UVs (n, 2), the report on them, and the surface's boundary loops, the longest first."""

    uv: np.ndarray = field(repr=False)
    report: Report
    loops: list = field(repr=False)


def unwrap(vertices, triangles, settings=None, uv=None, pinned=None, triangulate=None):
    """Unwrap a surface.

    Parameters
    ----------
    vertices : (n, 3), any unit
    triangles : (m, 3), consistently wound; one piece, manifold, with a boundary and without handles
    settings : Settings
    uv : (n, 2), the current UVs: needed for pins, to keep the boundary or to start from them, else only measured
    pinned : (n,) bool, vertices that stay where `uv` has them (boundary FREE or KEEP), or four corners (RECTANGLE)
    triangulate : for the boundary FREE, a function of points (p, 2) and sides (s, 2), pairs of points, that returns
        the triangles (t, 3) of the points' constrained Delaunay triangulation, or None if it cannot keep the points

    Returns a `Result`: `.uv` (n, 2), within the unit square or, where `uv` holds anything, in its frame, and
    `.report`.  Raises a subclass of `UnwrapError`.
    """
    return finished(unwrap_steps(vertices, triangles, settings, uv, pinned, triangulate))


def unwrap_steps(vertices, triangles, settings=None, uv=None, pinned=None, triangulate=None):
    """Like `unwrap`, as a generator: yields the initial `State` and that after each iteration, returns the `Result`."""
    vertices, triangles = checked_arrays(vertices, triangles)
    n = len(vertices)
    if n <= locality.MANY or any(each is not None and np.shape(each)[:1] != (n,) for each in (uv, pinned)):
        return (yield from _steps(vertices, triangles, settings, uv, pinned, triangulate))
    mesh = locality.Sorted(vertices, triangles)
    steps = _steps(mesh.vertices, mesh.triangles, settings, mesh.sorted(uv), mesh.sorted(pinned), triangulate)
    try:
        result = yield from mapped(lambda state: replace(state, uv=mesh.restored(state.uv)), steps)
    except SurfaceError as error:
        error.triangles = mesh.own_triangles(np.asarray(error.triangles, dtype=int))
        raise
    return mesh.restored_result(result)


def _steps(vertices, triangles, settings, uv, pinned, triangulate):
    settings = settings or Settings()
    check_settings(settings)
    surface = Surface(vertices, triangles)
    n = len(surface.vertices)
    uv = None if uv is None else checked_uv(surface, uv)
    pinned = _checked_pins(surface, pinned)

    # Where the old UVs hold the new ones and are mirrored, unwrap as seen in a mirror.
    in_frame = uv is not None and (settings.boundary == "KEEP" or (settings.boundary == "FREE" and pinned.any()))
    mirrored = in_frame and enclosed_area(uv[outer_loop(surface, uv)]) < 0
    mirror = np.array([-1.0, 1.0]) if mirrored else np.ones(2)
    given = None if uv is None else uv * mirror
    placed = _in_unit_square if settings.boundary == "FREE" and not in_frame else np.asarray

    if settings.boundary == "FREE":
        domain, start, warnings = _free(surface, settings, given, pinned, triangulate)
    else:
        domain, start, warnings = _held(surface, settings, given, pinned)

    changes = []

    def seen(state):
        if state.iteration:
            changes.append(state.change)
        return replace(state, uv=state.uv[:n] * mirror)

    uv, converged = yield from mapped(seen, _improved(surface, domain, settings, start, placed))
    chosen = placed(uv[:n])

    report = Report(
        before=None if given is None else measure(surface, given),
        initial=measure(surface, start[:n]),
        after=measure(surface, chosen),
        iterations=len(changes),
        converged=converged,
        changes=tuple(changes),
        injective=is_injective(chosen, surface.triangles, surface.loops),
        mirrored=bool(mirrored),
        warnings=warnings + face_warnings(int(surface.degenerate.sum())),
    )
    return Result(chosen * mirror, report, surface.loops)


def face_warnings(flat):
    """What to say of so many faces without area."""
    return (f"{flat} {'face has' if flat == 1 else 'faces have'} zero area",) if flat else ()


def _improved(surface, domain, settings, start, placed):
    """Iterate and refine; yields a `State` before and after each step, returns the best map and whether it converged.

    Where it matters that a map is valid, it matters where `placed` puts it.
    """
    n = len(surface.vertices)
    refining = settings.refine and settings.iterations and settings.weights == "COTANGENT"
    best, least = None, np.inf
    for state in iterate(domain, settings, start, n):
        yield state
        # Repairs and new air make the energy rise and fall: keep the best valid map from then on.
        uneven = state.repaired or refining or settings.boundary == "FREE"
        if state.valid and not invalid(surface, placed(state.uv[:n])).any():
            value = energy(surface, state.uv[:n], settings.balance) if uneven else np.inf
            if refining and value <= ISOMETRIC:
                return state.uv, True
            enough = refining and state.iteration and value > (1 - _HANDOVER) * least
            if best is None or not uneven or value < least:
                best, least = state, value
            if enough:
                break
    last = state
    if best is not None and uneven:
        state = best
    uv, converged = state.uv, last.converged
    if refining and state.valid:
        refined = uv if state is last else domain.recalled(uv, n)
        steps = () if refined is None else descend(domain, settings.balance, settings.refine, refined)
        previous = uv[:n]
        for number, (refined, done) in enumerate(steps, start=last.iteration + 1):
            change = movement(previous, refined[:n])
            valid = not invalid(surface, placed(refined[:n])).any()
            yield State(number, refined, change, valid, bool(done.all()), state.repaired)
            previous = refined[:n]
            if valid:
                uv, converged = refined, bool(done.all())
    return uv, converged


def _in_unit_square(uv):
    low, size = box(uv)
    return (uv - low) / size.max()


def _checked_pins(surface, pinned):
    if pinned is None:
        return np.zeros(len(surface.vertices), bool)
    pinned = np.asarray(pinned)
    if pinned.shape != (len(surface.vertices),) or pinned.dtype != bool:
        raise PinError(f"the pins must be True or False for each of the {len(surface.vertices)} vertices")
    return pinned


def _held(surface, settings, uv, pinned):
    """The domain with its outline held, the initial map of it, and warnings."""
    held, values, warnings = held_vertices(surface, settings, uv, pinned)
    solid = surface if settings.boundary == "KEEP" else surface.filled(air=not settings.fill_holes)
    added = len(solid.vertices) - len(surface.vertices)
    dirichlet = Dirichlet(solid.order, solid.edges, np.pad(held, (0, added)), np.pad(values, ((0, added), (0, 0))))
    initial = settings.initial
    if initial == "AUTO":
        initial = "CURRENT" if settings.boundary == "KEEP" and _is_valid(surface, uv) else "MEAN_VALUE"
    if uv is not None and added:  # each hole's centre at the mean of its outline
        uv = np.vstack([uv, *(uv[loop].mean(axis=0) for loop in surface.loops[1:])])
    return Held(solid, dirichlet), initial_map(solid, initial, dirichlet, uv), warnings


def _free(surface, settings, uv, pinned, triangulate):
    """The same with the outline free."""
    if triangulate is None:
        raise BoundaryError("a free boundary needs a triangulator of the plane around it: pass triangulate")
    if pinned.any() and uv is None:
        raise UVError("pins need UVs, and there are none: unpin")
    exterior = Exterior(surface, triangulate, pinned)
    warnings = ()
    if settings.initial == "AUTO":
        start = uv if pinned.any() and _is_valid(surface, uv) else _best_start(surface, settings)
    else:
        start = _natural_start(surface, settings, settings.initial, uv)
    if pinned.any():
        start = np.where(pinned[:, None], uv, fit(start, pinned, uv))
    if not settings.iterations or (settings.refine and energy(surface, start, settings.balance) <= ISOMETRIC):
        return exterior, start, warnings  # which need no air
    with_air = exterior.renewed(start)
    if with_air is None:
        circle = _natural_start(surface, settings, "MEAN_VALUE", uv)
        start = np.where(pinned[:, None], uv, fit(circle, pinned, uv)) if pinned.any() else circle
        warnings = ("the start overlaps itself: begun with a circle",)
        with_air = exterior.renewed(start)
        if with_air is None:
            return _outline_as_it_is(surface, start, pinned)
    return exterior, with_air, warnings


def _outline_as_it_is(surface, start, pinned):
    """The domain, initial map and warnings where no air can be made around the outline: it stays, and the pins do."""
    held = pinned.copy()
    held[np.concatenate(surface.loops)] = True
    warning = "the outline stays as it is, too fine to be freed"
    if pinned.any():
        warning = "the pins make the outline cross itself: unpin some, or move them"
    return Held(surface, Dirichlet(surface.order, surface.edges, held, start)), start, (warning,)


def _natural_start(surface, settings, initial, uv):
    """The initial map as it is, or within a circle where it needs a boundary."""
    if initial == "CONFORMAL":
        return conformal(surface)
    if initial == "PROJECTION":
        return project(surface)
    if initial == "CURRENT" and uv is not None:
        return uv
    circle = replace(settings, boundary="CIRCLE", initial=initial)
    return _held(surface, circle, uv, np.zeros(len(surface.vertices), bool))[1][: len(surface.vertices)]


def _best_start(surface, settings):
    """Of the certified natural maps a good one, or that of least energy; if there is none, the last."""
    best, least = None, np.inf
    for initial, enough in _STARTS.items():
        start = _natural_start(surface, settings, initial, None)
        value = energy(surface, start, settings.balance)
        if value < least and is_injective(start, surface.triangles, surface.loops):
            best, least = start, value
        if least < enough:
            break
    return start if best is None else best


def _is_valid(surface, uv):
    now = measure(surface, uv)
    return not now.flips and not now.collapsed
