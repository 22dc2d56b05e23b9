# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting of the search for seams: name, default, range and description, written down once."""

from dataclasses import dataclass

from .settings import Choice, check_all, setting

_AXES = (
    Choice("NONE", "None", "Seams need not be symmetric"),
    Choice("X", "X", "Seams come in pairs left and right of the plane across X, or lie on it"),
    Choice("Y", "Y", "Seams come in pairs on both sides of the plane across Y, or lie on it"),
    Choice("Z", "Z", "Seams come in pairs above and below the plane across Z, or lie on it"),
)
_VIEWS = (
    Choice("NONE", "Nowhere", "Seams may lie on any side"),
    Choice("-Y", "Front", "Seams keep out of the front view, that against Y"),
    Choice("Y", "Back", "Seams keep out of the back view"),
    Choice("X", "Right", "Seams keep out of the right view, that against X"),
    Choice("-X", "Left", "Seams keep out of the left view"),
    Choice("Z", "Top", "Seams keep out of the top view"),
    Choice("-Z", "Bottom", "Seams keep out of the bottom view"),
)


@dataclass(frozen=True)
class SeamSettings:
    """Where seams are to go.  Values are checked when the object is made; raises `SettingsError`."""

    distortion: float = setting(
        1.025,
        "Distortion",
        "Cut until the mean distortion of the unwrapped model is no larger than this. 1 is none at all; less means"
        " more seams. Smart UV Project ends at about 1.03 on organic models, with several times the seams",
        range=(1.0001, 100.0),
        soft_range=(1.01, 1.5),
    )
    charts: int = setting(
        1,
        "Charts",
        "Split every piece into at most so many charts: at closed lines of sharp edges first, then at necks and where"
        " it is long and thin",
        range=(1, 1000),
        soft_range=(1, 30),
    )
    split_angle: float = setting(
        50.0,
        "Split Angle",
        "The least angle, in degrees, between two faces at an edge where a piece may be split into charts",
        range=(1.0, 180.0),
    )
    creases: float = setting(
        1.0,
        "Creases",
        "How much seams like to follow creases, and folds more than ridges; 0 takes the shortest ways",
        range=(0.0, 100.0),
        soft_range=(0.0, 5.0),
    )
    marks: float = setting(
        1.0,
        "Marks",
        "How much seams like to follow edges that are marked: sharp ones, and the borders of materials",
        range=(0.0, 100.0),
        soft_range=(0.0, 5.0),
    )
    hide_from: str = setting("NONE", "Hide From", "The view in which seams are least welcome", choices=_VIEWS)
    symmetry: str = setting(
        "NONE", "Symmetry", "Where the model is symmetric, so are its seams, across this axis", choices=_AXES
    )

    def __post_init__(self) -> None:
        check_all(self)
