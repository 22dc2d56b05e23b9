# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of the islands, for the report line, the panel and the command line; needs no Blender."""

from dataclasses import dataclass

import numpy as np

from ..core import Distortion


@dataclass
class Outcome:
    """What became of one island: its numbers, or the error that it failed with."""

    obj: str
    number: int
    face_indices: np.ndarray  # (f,) of the mesh
    alone: bool = True  # the only one of its mesh
    area: float = 0.0
    before: Distortion | None = None
    after: Distortion | None = None  # of the UVs that Blender stores
    iterations: int = 0
    converged: bool = False
    injective: bool = False  # certified: it covers no place twice
    overlaps: tuple[str, ...] = ()  # what it lies on since it was unwrapped
    warnings: tuple[str, ...] = ()
    error: str = ""

    @property
    def faces(self):
        """How many there are."""
        return len(self.face_indices)

    @property
    def label(self):
        """Its name: "Cube (6 faces)", with a number if the mesh has others."""
        number = "" if self.alone else f", island {self.number}"
        return f"{self.obj}{number} ({count(self.faces, 'face')})"

    @property
    def overlaps_itself(self):
        """Or touches itself, though nothing is flipped."""
        return not (self.error or self.injective or self.after.flips or self.after.collapsed)

    def messages(self, known=()):
        """Its warnings, and what it lies on, but for what is `known`."""
        found = list(self.warnings)
        if self.overlaps_itself:
            found.append("it overlaps itself")
        news = [name for name in self.overlaps if name not in known]
        if news:
            others = f" and {len(news) - 1} more" if news[1:] else ""
            found.append(f"it lies on {news[0]}{others} now: pack them together")
        return found

    def sentence(self, text):
        """One of its messages with its name: "Cube (6 faces) is closed: ..." of "it is closed: ..."."""
        return f"{self.label} {text[3:]}" if text.startswith("it ") else f"{self.label}: {text}"

    @property
    def is_clean(self):
        """Unwrapped, with nothing flipped, collapsed or on top of anything."""
        return not self.error and self.injective and not self.overlaps

    def to_dict(self):
        """JSON-ready."""
        values = dict(object=self.obj, island=self.number, faces=self.faces)
        if self.error:
            return values | dict(error=self.error)
        return values | dict(
            before=self.before and self.before.to_dict(),
            after=self.after.to_dict(),
            iterations=self.iterations,
            converged=self.converged,
            injective=self.injective,
            overlaps=list(self.overlaps),
            warnings=self.messages(),
        )


latest: list[Outcome] = []  # of the latest run


def last_report():
    """What became of every island of the latest run, in Blender or by the command line: a list of dictionaries.

    Each has `object`, `island` (its number), `faces` (how many), `face_indices` and either `error` or `before`,
    `after`, `iterations`, `converged`, `injective`, `overlaps` and `warnings`, as in the command line's JSON.
    """
    return [outcome.to_dict() | dict(face_indices=outcome.face_indices.tolist()) for outcome in latest]


def sentences(outcomes):
    """All that there is to say about what was unwrapped; of two that lie on each other the former says so."""
    known = set()
    for outcome in outcomes:
        yield from map(outcome.sentence, outcome.messages(known))
        known.add(outcome.label)


def summary(outcomes):
    """What happened in one line: "3 islands, stretch 1.310 → 1.090, no flips; 1 skipped: ..."."""
    done = [outcome for outcome in outcomes if not outcome.error]
    failed = [outcome for outcome in outcomes if outcome.error]
    parts = []
    if done:
        stretch = _shown(_mean(done, [outcome.after.l2_stretch for outcome in done]))
        if all(outcome.before for outcome in done):
            before = _shown(_mean(done, [outcome.before.l2_stretch for outcome in done]))
            stretch = f"{before} → {stretch}"
        flips = sum(outcome.after.flips for outcome in done)
        parts.append(f"{count(len(done), 'island')}, stretch {stretch}, {count(flips, 'flip')}")
        overlapping = sum(bool(outcome.overlaps) for outcome in done)
        if overlapping:
            parts.append(f"{overlapping} on top of others")
        themselves = sum(outcome.overlaps_itself for outcome in done)
        if themselves:
            parts.append(f"{themselves} on top of {'itself' if themselves == 1 else 'themselves'}")
    if failed:
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        first = f"{failed[0].sentence(failed[0].error)}{more}"
        parts.append(f"{len(failed)} skipped: {first}" if done else first)
    return "; ".join(parts)


def change(before, after, name):
    """One measure of a `Distortion` before, if there was one, and after: "1.310 → 1.090"."""
    new = _shown(getattr(after, name))
    return f"{_shown(getattr(before, name))} → {new}" if before else new


def count(number, noun):
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _shown(value):
    return f"{value:.3f}" if value < 1e4 else f"{value:.1e}"


def _mean(outcomes, values):
    """Mean over the surface."""
    return np.average(values, weights=[outcome.area for outcome in outcomes])
