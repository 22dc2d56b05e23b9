# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting's name, default, range and description, written down once.

The operator, the panel, the command line and the Python API are all made from these fields.
"""

import dataclasses
import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from .errors import SettingsError


@dataclass(frozen=True)
class Choice:
    """One value of an enumerated setting."""

    identifier: str
    label: str
    description: str


def setting(
    default: str | bool | int | float,
    label: str,
    description: str,
    *,
    range: tuple[float, float] | None = None,
    soft_range: tuple[float, float] | None = None,
    choices: Sequence[Choice] = (),
) -> Any:
    """The dataclass field of one setting, with all that its users need to know of it in `metadata`.

    `range` has the least and the largest number, `soft_range` those that a slider shows.  The default has the setting's
    own type; a text without `choices` is any name.
    """
    metadata = dict(label=label, description=description, range=range, soft_range=soft_range or range, choices=choices)
    return dataclasses.field(default=default, metadata=metadata)


_INITIAL = (
    Choice(
        "AUTO",
        "Automatic",
        "The UVs themselves where outline or pins are kept and nothing is flipped; for a free outline the best of"
        " several maps; else mean value",
    ),
    Choice("UNIFORM", "Uniform", "Each vertex at the average of its neighbours (Tutte)"),
    Choice("HARMONIC", "Harmonic", "Angle preserving with the boundary held (cotangent weights)"),
    Choice("MEAN_VALUE", "Mean Value", "Free of flips on a convex boundary, whatever the mesh (Floater 2003)"),
    Choice("RINGS", "Rings", "In rings around the tips: tubes, horns and trees with one opening do not shrink away"),
    Choice("CONFORMAL", "Conformal", "Angle preserving with a natural outline, opened where that would cross itself"),
    Choice("PROJECTION", "Projection", "Flat view on the plane of best fit; foldovers correct themselves"),
    Choice("CURRENT", "Current UVs", "Start from the UVs that the mesh has"),
)

_BOUNDARY = (
    Choice("FREE", "Free", "The island finds its own outline, without overlaps; pinned vertices stay"),
    Choice("CIRCLE", "Circle", "The outline becomes a circle"),
    Choice(
        "RECTANGLE", "Rectangle", "The outline becomes a rectangle; pin four outline vertices to choose its corners"
    ),
    Choice("OUTLINE", "Convex Outline", "The outline becomes the convex hull of its flat view"),
    Choice("KEEP", "Keep", "The outline stays where the UVs have it, and so do pinned vertices"),
)

_WEIGHTS = (
    Choice("COTANGENT", "Cotangent", "Least distortion: finite elements with the full tensor (eq. 12)"),
    Choice("MEAN_VALUE", "Mean Value", "Never flips on a convex boundary; balance up to 0.5 (appendix A)"),
    Choice("MEAN_VALUE_SCALAR", "Mean Value, Area Only", "Mean value weights that correct areas only (eq. 15)"),
    Choice("STRETCH", "Stretch", "For comparison: stretch minimisation of Yoshizawa et al. 2004"),
)


def setting_of(owner: type, name: str) -> Any:
    """A field like that with this name in another dataclass of settings, to stand in one more of them."""
    field = next(field for field in dataclasses.fields(owner) if field.name == name)
    return dataclasses.field(default=field.default, metadata=dict(field.metadata))


@dataclass(frozen=True)
class Settings:
    """How to unwrap.  Values are checked when the object is made; raises `SettingsError`."""

    boundary: str = setting("FREE", "Boundary", "The shape of the island's outline", choices=_BOUNDARY)
    aspect: float = setting(
        1.0,
        "Aspect",
        "Width by height of the rectangle; 0 takes it from the island's own sides",
        range=(0.0, 100.0),
        soft_range=(0.0, 10.0),
    )
    iterations: int = setting(
        6,
        "Iterations",
        "At most this many improvements of the initial map, before it is refined",
        range=(0, 1000),
        soft_range=(0, 30),
    )
    balance: float = setting(
        0.25,
        "Balance",
        "From even areas (0) to true angles (1). 0.25 distorts textures least; 0.5 is the published quasi-harmonic map",
        range=(0.0, 1.0),
    )
    weights: str = setting("COTANGENT", "Weights", "How the improvement is computed", choices=_WEIGHTS)
    initial: str = setting("AUTO", "Start", "The map that is improved", choices=_INITIAL)
    refine: int = setting(
        30,
        "Refine",
        "At most this many steps from there to the least distortion (cotangent weights); 0 keeps the quasi-harmonic"
        " map itself, or with 0 iterations the initial map",
        range=(0, 1000),
        soft_range=(0, 100),
    )
    repair: bool = setting(True, "Repair Flips", "Turn flipped faces over (cotangent weights)")
    fill_holes: bool = setting(
        True,
        "Fill Holes",
        "Treat holes as if they were closed, so that they keep their shape; else they take any shape",
    )
    tensor_power: float = setting(
        1.0,
        "Tensor Power",
        "Strength of each improvement, the power of the tensor; 1 is exact for strips, 2 hardly converges",
        range=(0.01, 2.0),
    )
    tolerance: float = setting(
        1e-3,
        "Tolerance",
        "Without refinement, stop when no vertex moves by more than this part of the layout's size",
        range=(0.0, 1.0),
        soft_range=(0.0, 0.01),
    )

    def __post_init__(self) -> None:
        check_all(self)

    def check_together(self) -> None:
        """Raise `SettingsError` where settings exclude each other."""
        for excluded, text in _EXCLUDED:
            if excluded(self):
                raise SettingsError(text.format(self))


# Tests of settings for what excludes each other, and the message of each, formatted with the settings
_EXCLUDED: tuple[tuple[Callable[[Settings], bool], str], ...] = (
    (
        lambda its: its.weights == "MEAN_VALUE" and its.balance > 0.5,
        "mean value weights diverge for a balance above 0.5: lower it, or use the weights COTANGENT",
    ),
    (
        lambda its: its.weights == "MEAN_VALUE_SCALAR" and its.balance == 1,
        "area-only weights change nothing at balance 1: lower it, or take the start MEAN_VALUE with 0 iterations",
    ),
    (
        lambda its: its.boundary == "FREE" and its.weights != "COTANGENT",
        "a free boundary needs the weights COTANGENT, not {0.weights}: change them, or choose the boundary CIRCLE",
    ),
)


def check_all(settings: Any) -> None:
    """Raise `SettingsError` if a field of these settings, a dataclass of fields made by `setting`, has a value that it
    cannot have."""
    for field in dataclasses.fields(settings):
        check(field, getattr(settings, field.name))


def check(field: dataclasses.Field, value: Any) -> None:
    """Raise `SettingsError` if the setting of a `field` made by `setting` cannot have this value."""
    meta, kind = field.metadata, type(field.default)
    if meta["choices"]:
        names = [choice.identifier for choice in meta["choices"]]
        if value not in names:
            raise SettingsError(f"{field.name} is {value!r}: choose one of {', '.join(names)}")
    elif kind is str:
        if not isinstance(value, str):
            raise SettingsError(f"{field.name} is {value!r}: choose a name")
    elif kind is bool:
        if value not in (True, False):
            raise SettingsError(f"{field.name} is {value!r}: choose True or False")
    else:
        low, high = meta["range"]
        is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
        # NaN lies in no range.
        if not (is_number and low <= value <= high and (kind is not int or value == int(value))):
            wanted = "a whole number" if kind is int else "a number"
            raise SettingsError(f"{field.name} is {value!r}: choose {wanted} from {low} to {high}")
