# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker process: takes one asset after another in JSON lines on its standard input, and answers in JSON lines."""

import argparse
import base64
import faulthandler
import json
import os
import sys
import time
import traceback
from pathlib import Path

from .. import single
from ..addon import outcome as words
from ..addon import stopping, streams, writing
from .asset import Asset
from .entry import Entry
from .ledger import digest

_SLACK = 60  # seconds after the time limit: by then, whoever watches over it has ended it or is no more
_IDLE = 900  # seconds without an asset


def serve():
    """Do what is asked for until nobody asks any more; returns the exit code."""
    streams.open_standard_streams()
    answers = os.dup(1)
    os.dup2(2, 1)  # what Blender prints is no answer

    def answer(**values):
        os.write(answers, json.dumps(values).encode() + b"\n")

    try:
        with stopping.stoppable():
            try:
                import bpy
            except ImportError:
                answer(lacking="bpy")
                return 2
            answer(ready=bpy.app.version_string)
            while True:
                faulthandler.dump_traceback_later(_IDLE, exit=True)
                line = sys.stdin.readline()
                if not line:
                    return 0
                asset = Asset.of(json.loads(line))
                _watch(asset.timeout)
                answer(entry=_entry(asset).to_dict())
    except stopping.Stopped as stop:
        return stop.exit_code
    finally:
        faulthandler.cancel_dump_traceback_later()


def _watch(timeout):
    """End the process if it hangs, also in Blender, and nobody is left to end it."""
    faulthandler.cancel_dump_traceback_later()
    if timeout:
        faulthandler.dump_traceback_later(timeout + _SLACK, exit=True)


def _entry(asset):
    """Unwrap an asset; returns its `Entry`.  Raises `Stopped` if a signal comes."""
    start = time.perf_counter()
    output = Path(asset.output)
    entry = Entry.begun(asset, ticket=asset.ticket)
    entry.input_digest = digest(Path(asset.input))
    args = argparse.Namespace(**asset.options)
    args.input, args.output, args.json, args.preview = asset.input, output, None, None
    args.overwrite = asset.check_replaced
    writing.Staging.ticket = f"{asset.ticket}-"
    record = single.carried_out(args)
    if record.exit_code > 128:
        raise stopping.Stopped(record.exit_code - 128)
    if record.done:
        entry.stretch = words.mean_after(record.done, "l2_stretch")
        entry.energy = words.mean_after(record.done, "symmetric_dirichlet")
    entry.preview = base64.b64encode(_picture(record)).decode()
    entry.output_digest = digest(output) if output in record.files else ""
    details = record.to_dict()
    entry.status, entry.exit_code, entry.error = (details.pop(name) for name in ("status", "exit_code", "error"))
    for long in ("islands", "cuts", "settings"):
        details.pop(long)
    entry.details = details
    entry.seconds = round(time.perf_counter() - start, 3)
    return entry


def _picture(record):
    from ..addon import thumbnail

    try:
        return thumbnail.png(record.outcomes, record.places) if record.done else b""
    except Exception:  # which is no reason to call the asset's outcome into question
        traceback.print_exc()
        return b""
