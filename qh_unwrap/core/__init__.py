# SPDX-License-Identifier: GPL-3.0-or-later
"""Quasi-harmonic maps of surfaces to the plane (Zayer, Roessl, Seidel 2005), on NumPy and SciPy alone.

`unwrap` makes UVs, `distortion` measures them, `Settings` says how; errors are `UnwrapError`.
"""

from .chart import Surface
from .distortion import Distortion, distortion
from .errors import UnwrapError
from .obtuse import has_positive_weights, refine_obtuse
from .report import Report, Result, Shape, State
from .session import Unwrapper
from .settings import Settings
from .topology import Topology
from .unwrapping import unwrap, unwrap_islands, unwrap_steps

__all__ = [
    "Distortion",
    "Report",
    "Result",
    "Settings",
    "Shape",
    "State",
    "Surface",
    "Topology",
    "UnwrapError",
    "Unwrapper",
    "distortion",
    "has_positive_weights",
    "refine_obtuse",
    "unwrap",
    "unwrap_islands",
    "unwrap_steps",
]
