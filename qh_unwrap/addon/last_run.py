# SPDX-License-Identifier: GPL-3.0-or-later
"""What there is to show of the latest run, worked out once, and the text that *Copy Report* copies."""

import dataclasses
import platform

import numpy as np
import scipy

from .. import __version__
from ..core import Settings
from .options import MeshOptions
from .outcome import error_findings, findings, latest, summary


class LastRun:
    """The latest run: its outcomes, those first that need a look, and what there is to say about them: lines, each with
    the first outcome that it is said of."""

    def __init__(self):
        self.outcomes = latest
        self.ordered, self.errors, self.lines, self.summary, self.settings = [], [], [], "", {}
        self.options, self.unwrap_settings = MeshOptions(), Settings()
        self.check, self._to_look_at = None, {}  # the `inspecting.Check` if it was one

    def remember(self, outcomes, settings, options):
        """Keep the outcomes of a run with these settings, of an unwrap or of anything else, and these mesh options."""
        self.outcomes[:] = outcomes
        self.settings = dataclasses.asdict(settings) | dataclasses.asdict(options)
        self.options, self.check = options, None
        self.unwrap_settings = settings if isinstance(settings, Settings) else Settings()
        self.work_out()

    def remember_check(self, outcomes, check):
        """Remember a check of UVs in place of an unwrap."""
        self.outcomes[:] = outcomes
        self.settings, self.check = {}, check
        faces = {}
        for outcome in outcomes:
            if not outcome.is_clean:
                faces.setdefault(outcome.obj, []).append(outcome.face_indices)
        self._to_look_at = {name: np.sort(np.concatenate(its)) for name, its in faces.items()}
        self.work_out()

    def work_out(self):
        """Work out anew what there is to show of the outcomes."""
        outcomes = self.outcomes
        self.ordered = sorted(outcomes, key=lambda outcome: outcome.rank)
        self.errors, self.lines, self.summary = (
            list(error_findings(outcomes)),
            list(findings(outcomes)),
            summary(outcomes),
        )

    def forget(self):
        self.outcomes.clear()
        self.__init__()

    @property
    def overlapping(self):
        """The outcomes of islands that lie on others since they were unwrapped."""
        return [each for each in self.outcomes if each.overlaps and not each.error and not each.is_check]

    @property
    def closed(self):
        """The outcomes of islands that were left as they were because they are closed or have handles."""
        return [outcome for outcome in self.outcomes if outcome.needs_cut]

    def find(self, obj, number):
        """The outcome of an island, given by its object's name and its number, None if there is none."""
        return next((each for each in self.outcomes if (each.obj, each.number) == (obj, number)), None)

    def found(self, kind):
        """The faces (k,) that the last check found, by the names of their objects.

        kind  "FLIPPED", "MIRRORED", "OVERLAPPING", "WORST", or "LOOK" for all of the islands that have a fault
        """
        return self._to_look_at if kind == 'LOOK' else self.check.faces[kind.lower()]

    def text(self, blender):
        """All of it for a report of a fault, with the versions of what took part and the settings."""
        versions = {
            "QH Unwrap": __version__,
            "Blender": blender,
            "Python": platform.python_version(),
            "NumPy": np.__version__,
            "SciPy": scipy.__version__,
        }
        lines = [
            f"{', '.join(f'{name} {version}' for name, version in versions.items())}, {platform.platform()}",
            f"Settings: {', '.join(f'{name}={value}' for name, value in self.settings.items())}",
            *(line for line, _ in (*self.errors, *self.lines)),
            self.summary,
        ]
        return "\n".join(lines) + "\n"


last_run = LastRun()
