# SPDX-License-Identifier: GPL-3.0-or-later
"""Quasi-harmonic maps of surfaces to the plane (Zayer, Roessl, Seidel 2005), on NumPy and SciPy alone.

`unwrap` makes UVs, `distortion` measures them, `Settings` says how; errors are `UnwrapError`.
"""

from .distortion import Distortion, distortion
from .errors import UnwrapError
from .quasi_harmonic import State
from .refinement import has_positive_weights, refine_obtuse
from .settings import Settings
from .surface import Surface
from .together import unwrap_together
from .unwrapping import Report, Result, unwrap, unwrap_steps

__all__ = [
    "Distortion",
    "Report",
    "Result",
    "Settings",
    "State",
    "Surface",
    "UnwrapError",
    "distortion",
    "has_positive_weights",
    "refine_obtuse",
    "unwrap",
    "unwrap_steps",
    "unwrap_together",
]
