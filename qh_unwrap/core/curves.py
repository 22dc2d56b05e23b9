# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 11 of the paper: how several maps distort every triangle, in angles and in areas."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .distortion import Distortion
from .settings import Settings

_EXACTLY = Settings(boundary="CIRCLE", tolerance=0.0, refine=0, repair=False)

FIGURE_11 = {
    "discrete conformal": replace(_EXACTLY, initial="HARMONIC", iterations=0),
    "stretch minimisation": replace(_EXACTLY, weights="STRETCH", iterations=3),
    "quasi-harmonic": replace(_EXACTLY, balance=0.5, iterations=5),
    "balance 0.25": replace(_EXACTLY, balance=0.25, iterations=6, repair=True),
}
"""The maps of the figure: the paper's three (stretch minimisation is that of Yoshizawa et al. 2004), and our default
balance."""


@dataclass(frozen=True, eq=False)
class Curves:
    """The distortion of every triangle of a map, (m,) each, in the order of the triangles; ideal 1."""

    angle: np.ndarray = field(repr=False)
    """The ratio of the larger to the smaller stretch."""
    area: np.ndarray = field(repr=False)
    """The area on the surface by that in the map, each as a part of its island's."""

    @property
    def ascending(self) -> "Curves":
        """The same values from the smallest to the largest."""
        return Curves(np.sort(self.angle), np.sort(self.area))


def curves(distortions: Sequence[Distortion]) -> Curves:
    """The `Curves` of a map of several islands, at least one, from the `Distortion` of each."""
    angle = np.concatenate([each.triangle_angle for each in distortions])
    log_area = np.concatenate([each.triangle_log_area for each in distortions])
    return Curves(angle, np.exp(-log_area))
