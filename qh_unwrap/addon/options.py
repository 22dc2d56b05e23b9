# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's meshes need beside the core's `Settings`, written down once like those; needs no Blender."""

from dataclasses import dataclass

from ..core.settings import Choice, check_all, setting

_PLACEMENT = (
    Choice(
        "ORIGINAL",
        "Original",
        "Where the islands were, as large, as turned and as mirrored as before; new ones stand upright in the 0 to 1"
        " square, or in a tile beside it if that is taken",
    ),
    Choice(
        "PACK",
        "Pack",
        "All islands get the same texel density and are packed into the 0 to 1 square by Blender, which may take a"
        " minute; into a tile beside it if pinned islands lie there",
    ),
    Choice("UNIT", "Unit Square", "Each island fills the 0 to 1 square"),
)

_MARGIN_METHOD = (
    Choice("SCALED", "Scaled", "The margin shrinks with the islands"),
    Choice("ADD", "Add", "The margin is what it says, before the islands are scaled to fit"),
    Choice("FRACTION", "Fraction", "The margin is this part of the square, exactly; slow"),
)

_TEXEL_DENSITY = (
    Choice("PLACED", "As Placed", "What the placement makes of it"),
    Choice("KEEP", "Keep", "Each island keeps the density that it has; new ones get the mean of the others"),
    Choice("GIVEN", "Given", "All islands get the pixels per metre that are given, though they may not fit the square"),
)


_NEEDED = Choice(
    "NEEDED",
    "Where Needed",
    "Open what is closed or has handles along short seams in creases and folds; what can be unwrapped stays whole",
)
_DISTORTION = Choice(
    "DISTORTION",
    "Until Distortion",
    "Open it, and go on cutting where it stretches most, until its mean distortion is no larger than the one given",
)
_CUT = (
    Choice("NEVER", "Never", "Cut at the seams that are marked, and nowhere else; closed islands are left as they are"),
    _NEEDED,
    _DISTORTION,
)


@dataclass(frozen=True)
class MeshOptions:
    """What counts of a mesh, and where its islands go.  Values are checked; raises `SettingsError`."""

    placement: str = setting(
        "ORIGINAL", "Placement", "Where the islands go; what pins or a kept boundary hold stays", choices=_PLACEMENT
    )
    margin_method: str = setting("SCALED", "Margin Method", "How the margin is measured", choices=_MARGIN_METHOD)
    margin: float = setting(
        0.005, "Margin", "Space around the islands that are packed", range=(0.0, 1.0), soft_range=(0.0, 0.1)
    )
    rotate: bool = setting(False, "Rotate", "Packing may turn islands by right angles; otherwise they stay as upright")
    texel_density: str = setting(
        "PLACED",
        "Texel Density",
        "How large islands are in the image; what pins or a kept boundary hold stays",
        choices=_TEXEL_DENSITY,
    )
    pixels_per_metre: float = setting(
        512.0, "Pixels per Metre", "The texel density to get", range=(1e-3, 1e7), soft_range=(1.0, 4096.0)
    )
    image_size: int = setting(
        1024, "Image Size", "Pixels along a side of the image where the material has none", range=(1, 1_000_000)
    )
    correct_aspect: bool = setting(
        True, "Correct Aspect", "Make up for an image that is not square, the one in the faces' material"
    )
    correct_scale: bool = setting(
        True,
        "Correct Scale",
        "Unwrap the mesh as its object shows it, with a scale that is not applied; otherwise as if the scale were 1",
    )
    use_subsurf_data: bool = setting(
        False,
        "Use Subsurf",
        "Unwrap the mesh as its Subdivision Surface modifier smooths it; the modifier may stand anywhere, others do"
        " not count",
    )
    use_weights: bool = setting(
        False, "Importance Weights", "Give the regions of a vertex group more room in the map, and so more texels"
    )
    weight_group: str = setting("uv_importance", "Weight Group", "The vertex group with the importance weights")
    weight_factor: float = setting(
        4.0,
        "Weight Factor",
        "How many times as large faces of weight 1 become as those of weight 0; 1 changes nothing",
        range=(1e-3, 1e4),
        soft_range=(0.1, 10.0),
    )
    weld: bool = setting(
        False,
        "Weld",
        "Unwrap as if vertices at the same place were one, where files split them along sharp edges and the cuts of UV"
        " maps; the mesh stays as it is. What a shape key parts is not welded, nor are the two sides of a card",
    )

    cut: str = setting(
        "NEVER", "Cut", "Whether new seams are marked: those of Quasi-Harmonic Seams, with its settings", choices=_CUT
    )

    def __post_init__(self):
        check_all(self)


@dataclass(frozen=True)
class SeamOptions:
    """What counts where seams are marked, beside the core's `SeamSettings`.  Values are checked as well."""

    until: str = setting("DISTORTION", "Cut", "How far to cut", choices=(_NEEDED, _DISTORTION))
    vertex_group: str = setting(
        "", "Spare", "The vertex group that seams keep away from; edges between vertices of weight 1 are not cut"
    )
    unwrap: bool = setting(True, "Unwrap", "Unwrap the faces as well, with the settings of Quasi-Harmonic Unwrap")

    def __post_init__(self):
        check_all(self)


_QUANTITY = (
    Choice(
        "STRETCH",
        "Stretch",
        "How far the image is drawn out on the model, compared with the whole island; 1 is not at all",
    ),
    Choice("ANGLE", "Angle", "How much longer than wide a square of the image becomes on the model; 1 is not at all"),
    Choice("AREA", "Area", "How much of the image a face gets, compared with the whole island"),
    Choice(
        "DENSITY",
        "Texel Density",
        "Pixels of the material's image along a metre, compared with all that is shown; as if there were one of 1024"
        " pixels where there is none",
    ),
)


@dataclass(frozen=True)
class HeatSettings:
    """What a heatmap shows.  Values are checked as well."""

    quantity: str = setting("STRETCH", "Show", "What the colors mean", choices=_QUANTITY)
    limit: float = setting(
        2.0,
        "Full Color",
        "The ratio at which the color is strongest",
        range=(1.001, 1000.0),
        soft_range=(1.05, 10.0),
    )

    def __post_init__(self):
        check_all(self)
