# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting of relaxing and of straightening: name, default, range and description, written down once."""

from dataclasses import dataclass

from .settings import Choice, Settings, check_all, setting, setting_of

_DIRECTIONS = (
    Choice("BOTH", "U and V", "UVs move in any direction"),
    Choice("U", "U Only", "UVs keep their V: straight rows stay straight and even out along themselves"),
    Choice("V", "V Only", "UVs keep their U: straight columns stay straight and even out along themselves"),
)
_SHAPES = (
    Choice("LINES", "Edges to Lines", "The selected edges become straight, each loop of them along U or along V"),
    Choice(
        "RECTANGLE",
        "Quads to Rectangle",
        "The selected quads become an upright rectangle with straight rows, as wide and as high as they are in space."
        " Four pinned vertices of their border are its corners, else those are found",
    ),
)
_ALONG = (
    Choice("AUTO", "Automatic", "Each loop of edges along that axis which it runs along more"),
    Choice("U", "U", "All of them level"),
    Choice("V", "V", "All of them upright"),
)


def _steps(default: int) -> int:
    return setting(
        default,
        "Steps",
        "At most this many steps to the least distortion; pressing again goes on from there",
        range=(1, 1000),
        soft_range=(1, 100),
    )


@dataclass(frozen=True)
class RelaxSettings:
    """How to relax UVs in place.  Values are checked when the object is made; raises `SettingsError`."""

    direction: str = setting("BOTH", "Direction", "In which direction UVs may move", choices=_DIRECTIONS)
    move_outline: bool = setting(
        False,
        "Move Outline",
        "Let the outlines of islands move where they are selected, but not over other islands; else they stay where"
        " they are",
    )
    balance: float = setting_of(Settings, "balance")
    steps: int = _steps(30)
    blend: float = setting(
        1.0, "Blend", "How far to go from the UVs as they are (0) to the relaxed ones (1)", range=(0.0, 1.0)
    )

    def __post_init__(self) -> None:
        check_all(self)


@dataclass(frozen=True)
class StraightenSettings:
    """How to straighten UVs.  Values are checked when the object is made; raises `SettingsError`."""

    shape: str = setting("LINES", "Shape", "What becomes straight", choices=_SHAPES)
    along: str = setting("AUTO", "Along", "The axis that edges become straight along", choices=_ALONG)
    move_outline: bool = setting(
        True,
        "Move Outline",
        "Let the outlines of islands move, but not over other islands; else they stay where they are, but for what"
        " becomes straight",
    )
    balance: float = setting_of(Settings, "balance")
    steps: int = _steps(30)

    def __post_init__(self) -> None:
        check_all(self)
