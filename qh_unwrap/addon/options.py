# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the islands go, written down once like the core's `Settings`; needs no Blender."""

import dataclasses
from dataclasses import dataclass

from ..core.settings import Choice, check, setting

_PLACEMENT = (
    Choice("ORIGINAL", "Original", "Where the islands were, as large and as turned as before; new ones are packed"),
    Choice("PACK", "Pack", "All islands get the same texel density and are packed into the 0 to 1 square"),
    Choice("UNIT", "Unit Square", "Each island fills the 0 to 1 square"),
)


@dataclass(frozen=True)
class Placement:
    """Where the islands go; a kept boundary never moves.  Raises `SettingsError`."""

    placement: str = setting("ORIGINAL", "Placement", "Where the islands go", choices=_PLACEMENT)
    margin: float = setting(
        0.005, "Margin", "Space around the islands that are packed", range=(0.0, 1.0), soft_range=(0.0, 0.1)
    )

    def __post_init__(self):
        for field in dataclasses.fields(self):
            check(field, getattr(self, field.name))
