# SPDX-License-Identifier: GPL-3.0-or-later
"""Templates for the schedulers of farms, with the flags with which to unwrap."""

import json
from pathlib import Path

from ..addon.failures import UsageError

_FOLDER = Path(__file__).with_name("templates")


def openjd(flags):
    """A job template for Open Job Description, version 2023-09, whose tasks unwrap with these flags."""
    text = _FOLDER.joinpath("openjd.json").read_text(encoding="utf-8")
    if any("{{" in flag for flag in flags):
        raise UsageError("flags with {{ cannot be written into a job template")
    template = json.loads(text)
    if flags:
        action = template["steps"][0]["script"]["actions"]["onRun"]
        action["args"] += flags
        text = json.dumps(template, indent=2) + "\n"
    return text


def flamenco(flags):
    """A job type for Flamenco 3, whose tasks unwrap with these flags."""
    text = _FOLDER.joinpath("flamenco.js").read_text(encoding="utf-8")
    return text.replace("const FLAGS = [];", f"const FLAGS = {json.dumps(flags)};")


PRINTED = {"openjd": openjd, "flamenco": flamenco}
