# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of the islands, for the report line, the panel and the command line; needs no Blender."""

import re
from dataclasses import dataclass

import numpy as np

from ..core import Distortion
from ..core.overlaps import ENOUGH
from ..core.published import PublishedMeasures

_ENDLESS = 1e30  # what is larger comes of triangles without area
_NAMES = 5  # that are told; further ones are counted


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
    overlaps: tuple[str, ...] = ()  # some of what it lies on since it was unwrapped
    more_overlaps: int = 0  # others that it lies on as well; where there are many, not all are counted
    overlap_cure: str = ""
    warnings: tuple[str, ...] = ()
    error: str = ""
    needs_cut: bool = False  # failed because it is closed or has a handle
    cut_edges: int = 0  # that were marked as seams in it
    texel_density: float | None = None  # pixels of its image along a metre of its surface
    published: tuple[PublishedMeasures, int] | None = None  # and its place among these
    is_check: bool = False  # of UVs as they were found, with all that follows
    faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what is no fault
    mirrored: bool = False  # as a whole
    stacked: int = 0  # others whose faces coincide with its own

    @property
    def faces(self):
        """How many there are."""
        return len(self.face_indices)

    @property
    def name(self):
        """Its name: "Cube", with a number if the mesh has others."""
        return self.obj if self.alone else f"{self.obj}, island {self.number}"

    @property
    def label(self):
        """Its name and size: "Cube (6 faces)"."""
        return f"{self.name} ({count(self.faces, 'face')})"

    @property
    def overlaps_itself(self):
        """Or touches itself, though nothing is flipped."""
        return not (self.error or self.injective or self.after.flips or self.after.collapsed)

    @property
    def overlap(self):
        """What it lies on, and the cure; nothing if it lies on nothing."""
        if not self.overlaps:
            return ""
        more = len(self.overlaps) - 1 + self.more_overlaps
        least = "at least " if more + 1 >= ENOUGH else ""  # no more were looked for
        now = "" if self.is_check else " now"
        return f"it lies on {self.overlaps[0]}{f' and {least}{more} more' if more else ''}{now}: {self.overlap_cure}"

    @property
    def remarks(self):
        """Its faults, warnings and notes, and whether it overlaps itself."""
        itself = self.overlaps_itself and not self.is_check  # which tells it as a fault
        return [*self.faults, *self.warnings, *self.notes, *(["it overlaps itself"] if itself else [])]

    def messages(self):
        """All that there is to say about it, as sentences that begin with "it" or stand for themselves."""
        return [*self.remarks, *([self.overlap] if self.overlaps else [])]

    def sentence(self, text):
        """One of its messages with its name: "Cube (6 faces) is closed: ..." of "it is closed: ..."."""
        return f"{self.label} {text[3:]}" if text.startswith("it ") else f"{self.label}: {text}"

    @property
    def is_clean(self):
        """Unwrapped, with nothing flipped, collapsed or on top of anything."""
        return not self.error and self.injective and not self.overlaps and not self.faults

    @property
    def rank(self):
        """How much it needs a look, the smaller the more: failed, flipped or collapsed, on top of something, clean."""
        if self.error:
            return 0
        return 1 if self.after.flips or self.after.collapsed else 3 if self.is_clean else 2

    def to_dict(self):
        """JSON-ready."""
        values = dict(object=self.obj, island=self.number, faces=self.faces)
        if self.error:
            return values | dict(error=self.error)
        if self.is_check:
            its = dict(faults=list(self.faults), mirrored=self.mirrored, stacked=self.stacked)
            values |= dict(after=self.after.to_dict()) | its
        else:
            values |= dict(
                before=self.before and self.before.to_dict(),
                after=self.after.to_dict(),
                iterations=self.iterations,
                cut_edges=self.cut_edges,
                converged=self.converged,
            )
        return values | dict(
            injective=self.injective,
            overlaps=list(self.overlaps),
            more_overlaps=self.more_overlaps,
            warnings=self.messages(),
            texel_density=self.texel_density,
            published=self.published_measures(),
        )

    def published_measures(self):
        """Its measures by a published benchmark, None where it has no area or nobody asked for them."""
        if not self.published:
            return None
        measures, k = self.published
        its = measures.of(k)
        return its and its.to_dict()


latest: list[Outcome] = []  # of the latest run


def last_report():
    """What became of every island of the latest run, in Blender or by the command line: a list of dictionaries.

    Each has `object`, `island` (its number), `faces` (how many), `face_indices` and either `error` or `before`,
    `after`, `iterations`, `converged`, `injective`, `overlaps` (some of what it lies on now), `more_overlaps` (how many
    more were found), `warnings` and `texel_density`, as in the command line's JSON.  After a check of UVs, it has
    `faults`, `mirrored`, `stacked` and `published` as well, and nothing of the run.
    """
    return [outcome.to_dict() | dict(face_indices=outcome.face_indices.tolist()) for outcome in latest]


def sentences(outcomes):
    """All that there is to say about what was unwrapped, a line for each kind of message."""
    return [line for line, _ in findings(outcomes)]


def error_sentences(outcomes):
    """What kept islands from being unwrapped, a line for each kind of error."""
    return [line for line, _ in error_findings(outcomes)]


def findings(outcomes):
    """The same as `sentences`, each with the first outcome that it is said of."""
    done = [outcome for outcome in outcomes if not outcome.error]
    yield from _lines((outcome, text) for outcome in done for text in outcome.remarks)
    lying = [outcome for outcome in done if outcome.overlaps]
    if not lying:
        return
    first, *others = lying
    if [outcome.label for outcome in others] in ([], list(first.overlaps)):
        yield first.sentence(first.overlap), first
    else:
        where = f"first: {first.name} on {first.overlaps[0]}"
        now = "" if first.is_check else " now"
        yield f"{len(lying)} islands lie on others{now} ({where}): {first.overlap_cure}", first


def error_findings(outcomes):
    """The same as `error_sentences`, each with the first outcome that it is said of."""
    yield from _lines((outcome, outcome.error) for outcome in outcomes if outcome.error)


def _lines(remarks):
    """A line for each kind among pairs of outcomes and texts, which names the first of those that it is said of, and
    that one."""
    kinds, kind_of = {}, {}
    for outcome, text in remarks:
        kind = kind_of.get(text) or kind_of.setdefault(text, _kind(text))
        kinds.setdefault(kind, []).append((outcome, text))
    for (first, text), *others in kinds.values():
        yield f"{len(others) + 1} islands (first: {first.name}): {text}" if others else first.sentence(text), first


def _kind(text):
    """The same for texts that differ in their numbers alone: "1 face has ..." and "2 faces have ..."."""
    return re.sub(r"\d\S*( \w+)?", "#", text).replace(" have ", " has ").replace(" are ", " is ")


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
        flips, collapsed = (sum(getattr(outcome.after, name) for outcome in done) for name in ("flips", "collapsed"))
        parts.append(f"{count(len(done), 'island')}, stretch {stretch}, {faults(flips, collapsed)}")
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


def check_summary(outcomes):
    """The same of a check: "3 islands, stretch 1.090, no flips; 1 island needs a look"."""
    done = [outcome for outcome in outcomes if not outcome.error]
    parts = [summary(done)] if done else []
    unclean = sum(not outcome.is_clean for outcome in done)
    if unclean:
        parts.append(f"{count(unclean, 'island')} {'needs' if unclean == 1 else 'need'} a look")
    without = sum(outcome.faces for outcome in outcomes if outcome.error)
    if without:
        parts.append(f"{count(without, 'face')} could not be checked")
    return "; ".join(parts)


def faults(flips, collapsed):
    """How many triangles are flipped or collapsed: "no flips", "2 flips, 908 collapsed" or "908 collapsed"."""
    parts = [count(flips, "flip")] if flips or not collapsed else []
    return ", ".join([*parts, *([f"{collapsed} collapsed"] if collapsed else [])])


def change(before, after, name):
    """One measure of a `Distortion` before, if there was one, and after: "1.310 → 1.090"."""
    new = _shown(getattr(after, name))
    return f"{_shown(getattr(before, name))} → {new}" if before else new


def mean_change(outcomes, name):
    """The same of several that are done, in the mean over their surface; without "before" where one has none."""
    after = _shown(mean_after(outcomes, name))
    if not all(outcome.before for outcome in outcomes):
        return after
    return f"{_shown(_mean(outcomes, [getattr(outcome.before, name) for outcome in outcomes]))} → {after}"


def mean_after(outcomes, name):
    """One measure of several that are done, in the mean over their surface."""
    return float(_mean(outcomes, [getattr(outcome.after, name) for outcome in outcomes]))


def shown_density(outcomes):
    """The texel density of several, from the least to the largest: "512.0", "256.0 – 512.0", "-" for none."""
    known = [f"{outcome.texel_density:.1f}" for outcome in outcomes if outcome.texel_density]
    if not known:
        return "-"
    least, most = min(known, key=float), max(known, key=float)
    return least if least == most else f"{least} – {most}"


def told_of(reason, names):
    """What there is to say of objects: "2 objects without faces: Cube, Plane"."""
    return f"{count(len(names), 'object')} {reason}: {listed(names)}"


def listed(names):
    """The first of the names, and how many others there are."""
    more = len(names) - _NAMES
    return ", ".join(names[:_NAMES]) + (f" and {more} more" if more > 0 else "")


def count(number, noun):
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def _shown(value):
    if value > _ENDLESS:
        return "∞"
    return f"{value:.3f}" if value < 1e4 else f"{value:.1e}"


def _mean(outcomes, values):
    """Mean over the surface; of all alike where there is no area."""
    areas = np.array([outcome.area for outcome in outcomes])
    return np.average(values, weights=areas if areas.any() else None)
