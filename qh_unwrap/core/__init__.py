# SPDX-License-Identifier: GPL-3.0-or-later
"""Quasi-harmonic maps of surfaces to the plane (Zayer, Roessl, Seidel 2005), on NumPy and SciPy alone.

`unwrap` makes UVs, `distortion` measures them, `Settings` says how; `relax_islands` and `straighten_islands` better
those that there are; `cut_open` and `cut_to` find seams, `SeamSettings` says where; errors are `UnwrapError`.
"""

from .chart import Surface
from .cuttable import Polygons
from .distortion import Distortion, distortion
from .edge_costs import Wishes
from .errors import UnwrapError
from .obtuse import has_positive_weights, refine_obtuse
from .relax_settings import RelaxSettings, StraightenSettings
from .relaxing import relax_islands, straighten_islands
from .report import Report, Result, Shape, State
from .seam_settings import SeamSettings
from .seams import SeamResult, SeamState, cut_open, cut_to
from .searching import ChartSeams
from .session import Unwrapper
from .settings import Settings
from .topology import Topology
from .unwrapping import unwrap, unwrap_islands, unwrap_steps

__all__ = [
    "ChartSeams",
    "Distortion",
    "Polygons",
    "RelaxSettings",
    "Report",
    "Result",
    "SeamResult",
    "SeamSettings",
    "SeamState",
    "Settings",
    "Shape",
    "State",
    "StraightenSettings",
    "Surface",
    "Topology",
    "UnwrapError",
    "Unwrapper",
    "Wishes",
    "cut_open",
    "cut_to",
    "distortion",
    "has_positive_weights",
    "refine_obtuse",
    "relax_islands",
    "straighten_islands",
    "unwrap",
    "unwrap_islands",
    "unwrap_steps",
]
