# SPDX-License-Identifier: GPL-3.0-or-later
"""What there is to tell of a run on a file: the command line's JSON, which docs/report.schema.json describes.

Needs no Blender, so that there is a report if Blender is missing.
"""

import math
import platform
from time import perf_counter

import numpy as np
import scipy

from .. import __version__
from . import outcome as words

FORMAT = 1  # grows when something that was there changes its meaning or goes
OK, PARTIAL, USAGE, FAILED = 0, 1, 2, 3
_STATUS = {None: "running", OK: "ok", PARTIAL: "partial", USAGE: "usage error", FAILED: "failed"}


class Record:
    """A run: what is known of it so far."""

    def __init__(self):
        self.input = self.output = None
        self.settings = None
        self.strict = False
        self.blender = None
        self.outcomes = []
        self.places = []  # of every outcome its mesh, map and materials, as a dictionary
        self.skipped = {}  # names of objects by the reason
        self.warnings = []  # what Blender says of the files
        self.losses = []  # what the format of the output does not hold: `losses.Loss`
        self.cuts = []  # the new seams of each mesh, as a dictionary
        self.check = None  # what a check found in all islands together, as a dictionary
        self.published = None  # the published measures of all islands together
        self.write = None  # "patch" or "export"
        self.not_patched = None  # why it is an export where a patch was to be
        self.files = []
        self.is_kept = False  # in a file, for the time being
        self.exit_code = None
        self.error = None
        self._start = perf_counter()
        self._times = dict(read=0.0, unwrap=0.0, write=0.0)
        self._part = None

    def begin(self, part):
        """From now on, time is spent on this part: "read", "unwrap", "check" or "write"; None for none of them."""
        now = perf_counter()
        if self._part:
            name, since = self._part
            self._times[name] = self._times.get(name, 0.0) + now - since
        self._part = (part, now) if part else None

    def fail(self, code, error):
        self.exit_code, self.error = code, str(error)

    @property
    def done(self):
        """What was unwrapped."""
        return [outcome for outcome in self.outcomes if not outcome.error]

    @property
    def failed(self):
        """How many islands count as failed, in a check those with faults."""
        if self.check is not None:
            return sum(not each.is_clean for each in self.outcomes)
        return sum(bool(each.error or (self.strict and not each.injective)) for each in self.outcomes)

    def judge(self):
        """Set the exit code by what became of the islands."""
        if self.check is None and not self.done:
            self.fail(FAILED, "nothing could be unwrapped")
        else:
            self.exit_code = PARTIAL if self.failed else OK

    def warn(self, texts):
        self.warnings += [text for text in texts if text not in self.warnings]

    def warning_sentences(self):
        return [f"Blender warns: {text}" for text in self.warnings]

    def sentences(self):
        """A line for each reason to skip objects, for an export in place of a patch, for each kind of what is not
        written, and for each warning."""
        skipped = [f"skipped: {words.told_of(reason, names)}" for reason, names in self.skipped.items()]
        exported = [f"exported, not patched: {self.not_patched}"] if self.not_patched else []
        return [*skipped, *exported, *(loss.message for loss in self.losses), *self.warning_sentences()]

    def to_dict(self):
        """JSON-ready; what is infinite, as the energy of flipped faces, is None, since JSON knows no such number."""
        return _finite(self._to_dict())

    def _to_dict(self):
        done = self.done
        return dict(
            format=FORMAT,
            status="faults" if self.check and self.exit_code == PARTIAL else _STATUS.get(self.exit_code, "stopped"),
            exit_code=self.exit_code,
            error=self.error,
            input=self.input,
            output=self.output,
            files=[str(path) for path in self.files],
            write=self.write,
            not_patched=self.not_patched,
            times={name: round(seconds, 3) for name, seconds in self._times.items()}
            | dict(total=round(perf_counter() - self._start, 3)),
            versions=dict(
                qh_unwrap=__version__,
                blender=self.blender,
                python=platform.python_version(),
                numpy=np.__version__,
                scipy=scipy.__version__,
            ),
            settings=self.settings,
            totals=dict(
                objects=len({outcome.obj for outcome in self.outcomes}),
                islands=len(self.outcomes),
                certified=sum(outcome.injective for outcome in done),
                failed=self.failed,
                flips=sum(outcome.after.flips for outcome in done),
                collapsed=sum(outcome.after.collapsed for outcome in done),
                faces=sum(outcome.faces for outcome in self.outcomes),
            ),
            skipped=[dict(reason=reason, objects=names) for reason, names in self.skipped.items()],
            not_written=[loss._asdict() for loss in self.losses],
            warnings=self.warnings,
            cuts=self.cuts,
            check=self.check,
            published=self.published and self.published.to_dict(),
            islands=self._islands(),
        )

    def _islands(self):
        islands = []
        for outcome, place in zip(self.outcomes, self.places, strict=True):
            values = outcome.to_dict()
            names = dict(object=values.pop("object"), island=values.pop("island"))
            islands.append(names | place | dict(certified=outcome.injective) | values)
        return islands


def _finite(value):
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
