# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's meshes need beside the core's `Settings`, written down once like those; needs no Blender."""

import dataclasses
from dataclasses import dataclass

from ..core.settings import Choice, check, setting

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
    weld: bool = setting(
        False,
        "Weld",
        "Unwrap as if vertices at the same place were one, where files split them along sharp edges and the cuts of UV"
        " maps; the mesh stays as it is. What a shape key parts is not welded, nor are the two sides of a card",
    )

    def __post_init__(self):
        for field in dataclasses.fields(self):
            check(field, getattr(self, field.name))
