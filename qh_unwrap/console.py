# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command line shows: a table, what there is to say, and how far it is.  Nothing here can make a run fail."""

import os
import sys
from time import perf_counter

from .addon import outcome as words

_MANY = 50  # islands: with more of them, the table has a row for each object
_PATIENCE = 2.0  # seconds without a bar
_WIDTH = 30  # of the bar
_HEAD = ("island", "faces", "stretch", "sym. Dirichlet", "angle", "area", "flips")
_MEASURES = ("l2_stretch", "symmetric_dirichlet", "angle", "area")
_PLAIN = {"→": "->", "–": "-", "∞": "inf"}  # where a terminal lacks signs


def show(text, *, error=False):
    """Print it with what signs the terminal has; if nobody listens, that is no fault."""
    stream = sys.stderr if error else sys.stdout
    if stream is None:
        return
    try:
        encoding = getattr(stream, "encoding", None) or "utf-8"
        try:
            text.encode(encoding)
        except UnicodeEncodeError:
            text = (
                text.replace("→", "->")
                .replace("–", "-")
                .replace("∞", "inf")
                .encode(encoding, "replace")
                .decode(encoding)
            )
        print(text, file=stream, flush=True)
    except (OSError, ValueError):  # a closed pipe, a full disk, a closed stream
        _silence(stream)


def _silence(stream):
    """Lead the stream to nowhere, lest Python complains of what is left in it when it ends."""
    try:
        handle = os.open(os.devnull, os.O_WRONLY)
        os.dup2(handle, stream.fileno())
        os.close(handle)
    except (OSError, ValueError):
        pass


def show_outcomes(outcomes, skipped, *, verbose=False, quiet=False):
    """Show a table, a line for each kind of message and each of `skipped`, and as errors a line for each kind."""
    done = [outcome for outcome in outcomes if not outcome.error]
    if done and not quiet:
        for line in _table(done, by_object=len(done) > _MANY and not verbose):
            show(line)
    if not quiet:
        for sentence in [*words.sentences(outcomes), *skipped]:
            show(sentence)
    for sentence in words.error_sentences(outcomes):
        show(sentence, error=True)


def _table(outcomes, by_object):
    last = "pixels per metre" if outcomes[0].is_check else "iterations"
    if by_object:
        groups = {}
        for outcome in outcomes:
            groups.setdefault(outcome.obj, []).append(outcome)
        head = ("object", "islands", *_HEAD[1:], last)
        rows = [(name, str(len(group)), *_numbers(group)) for name, group in groups.items()]
        total = ("total", str(len(outcomes)), *_numbers(outcomes))
    else:
        head = (*_HEAD, last)
        rows = [(f"{outcome.obj} {outcome.number}", *_numbers([outcome])) for outcome in outcomes]
        total = ("total", *_numbers(outcomes))
    rows = [head, *rows, *([total] if len(outcomes) > 1 else [])]
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    for row in rows:
        first, *others = (text.rjust(width) for text, width in zip(row, widths, strict=True))
        yield "  ".join((first.strip().ljust(widths[0]), *others))


def _numbers(outcomes):
    """What a row says of one island or of several: sums, means over the surface, and the most iterations, or of a check
    the texel density."""
    is_check = outcomes[0].is_check
    return (
        str(sum(outcome.faces for outcome in outcomes)),
        *(words.mean_change(outcomes, name) for name in _MEASURES),
        str(sum(outcome.after.flips for outcome in outcomes)),
        words.shown_density(outcomes) if is_check else str(max(outcome.iterations for outcome in outcomes)),
    )


class Bar:
    """How far a long run is, for somebody who looks at a terminal; nothing elsewhere."""

    def __init__(self, *, wanted=True):
        self._is_shown = wanted and sys.stderr is not None and sys.stderr.isatty()
        self._start = perf_counter()
        self._drawn = ""

    def __call__(self, share):
        """Show the share that is done, from 0 to 1."""
        if self._is_shown and perf_counter() - self._start > _PATIENCE:
            text = f"{'#' * int(_WIDTH * share):.<{_WIDTH}} {100 * share:3.0f} %"
            if text != self._drawn:
                self._drawn = text
                self._draw(f"\r{text}")

    def close(self):
        """Wipe it away."""
        if self._drawn:
            self._draw(f"\r{' ' * len(self._drawn)}\r")
            self._drawn = ""

    def _draw(self, text):
        try:
            sys.stderr.write(text)
            sys.stderr.flush()
        except (OSError, ValueError):
            self._is_shown, self._drawn = False, ""
