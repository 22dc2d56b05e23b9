# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a batch is: for a person, for a program (JSON), and for a scheduler of Open Job Description."""

import json
from pathlib import Path

from .. import console

FORMATS = ("json", "openjd")


def teller(args):
    """What tells of the batch as the flags want it."""
    if args.progress == "json":
        return _Json()
    return _OpenJobDescription() if args.progress == "openjd" else _Person(args)


class _Person:
    """A bar on a terminal, a line for each file that is not good, or with --verbose for each, and a summary."""

    def __init__(self, args):
        self._args = args
        self._bar = console.Bar(wanted=not args.quiet)

    def begin(self, count):
        pass

    def tell(self, entry, done, count):
        if not entry.is_good or self._args.verbose:
            self._bar.close()
            console.show(_line(entry, done, count), error=not entry.is_good)
        self._bar(done / count)

    def end(self, exit_code, summary):
        self._bar.close()
        if not self._args.quiet:
            console.show(summary)

    def fail(self, exit_code, error):
        self._bar.close()
        console.show(f"qh-unwrap: error: {error}", error=True)


class _Json:
    """An object in each line of the standard output."""

    def begin(self, count):
        self._show(event="begin", count=count)

    def tell(self, entry, done, count):
        names = ("input", "output", "status", "error", "attempts", "seconds", "host")
        self._show(event="file", done=done, count=count, **{name: getattr(entry, name) for name in names})

    def end(self, exit_code, summary):
        self._show(event="end", exit_code=exit_code, summary=summary)

    def fail(self, exit_code, error):
        self._show(event="error", exit_code=exit_code, error=str(error))

    def _show(self, **values):
        console.show(json.dumps(values))


class _OpenJobDescription:
    """The lines that a scheduler reads in what a task prints."""

    _first = ""  # file that is not good

    def begin(self, count):
        self._show("status", f"0 of {count} files")

    def tell(self, entry, done, count):
        console.show(_line(entry, done, count))
        if not (entry.is_good or self._first):
            self._first = f"; first: {Path(entry.input).name}: {entry.error or entry.status}"
        self._show("progress", f"{100 * done / count:.1f}")
        self._show("status", f"{done} of {count} files")

    def end(self, exit_code, summary):
        self._show("fail" if exit_code else "status", summary + self._first)

    def fail(self, exit_code, error):
        self._show("fail", error)

    def _show(self, name, text):
        console.show(f"openjd_{name}: {' '.join(str(text).split())}")  # which has to be one line


def _line(entry, done, count):
    width = len(str(count))
    text = f"[{done:{width}}/{count}] {Path(entry.input).name}: {entry.status}, {entry.seconds:.2f} s"
    return f"{text}: {entry.error}" if entry.error else text
