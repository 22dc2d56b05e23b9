# SPDX-License-Identifier: GPL-3.0-or-later
"""What methods made of the same faces, as a table and as a figure; needs no Blender."""

from dataclasses import dataclass

import numpy as np

from ..core.curves import Curves
from .figure import Look, distortion_figure

MEASURES = ("l2_stretch", "angle", "area")  # of a row, in the order of its columns
HEAD = ("method", "stretch", "angle", "area", "flips", "overlaps", "seconds")


@dataclass(frozen=True, eq=False)
class Row:
    """What one method made of the faces: means over the surface, as in a report, and counts."""

    name: str
    look: Look
    seconds: float | None
    error: str = ""
    l2_stretch: float = np.nan
    angle: float = np.nan
    area: float = np.nan
    flips: int = 0  # triangles, those without area in the map included
    overlaps: int = 0  # faces that lie on others
    curves: Curves | None = None

    @property
    def cells(self):
        """Its texts, one for each column."""
        seconds = "" if self.seconds is None else f"{self.seconds:.2f}"
        if self.error:
            return self.name, *("–" for _ in HEAD[1:-1]), seconds
        measures = (_number(getattr(self, name)) for name in MEASURES)
        return self.name, *measures, str(self.flips), str(self.overlaps), seconds


@dataclass(frozen=True)
class Comparison:
    """The rows of all methods, and what they were tried on."""

    title: str
    rows: tuple

    @property
    def remarks(self):
        """What went wrong, a sentence for each method that failed."""
        return [f"{row.name}: {row.error}" for row in self.rows if row.error]

    @property
    def lines(self):
        """The table as lines of text, all columns in line."""
        cells = [HEAD, *(row.cells for row in self.rows)]
        widths = [max(len(row[column]) for row in cells) for column in range(len(HEAD))]
        for first, *others in cells:
            numbers = (text.rjust(width) for text, width in zip(others, widths[1:], strict=True))
            yield "  ".join((first.ljust(widths[0]), *numbers)).rstrip()

    @property
    def figure(self):
        """The `Figure` of the curves, None if no method has any."""
        methods = [(row.name, row.look, row.curves) for row in self.rows if row.curves is not None]
        return distortion_figure(self.title, methods) if methods else None


def _number(value):
    return f"{value:.3f}" if value < 1000 else f"{value:.1e}"


class Latest:
    """The latest comparison, for the panel."""

    comparison = None


latest = Latest()
