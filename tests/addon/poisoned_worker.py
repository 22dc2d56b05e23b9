# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker process for which some files are poison: their names say how they end or hamper it."""

import os
import signal
import sys
import time
from pathlib import Path

from qh_unwrap import single
from qh_unwrap.addon import writing
from qh_unwrap.farm import process


def carried_out(args, unwrap=single.carried_out):
    path = Path(args.input)
    kind = path.stem.partition("_")[0]
    seen = path.with_suffix(".seen")
    if kind == "once" and not seen.exists():
        seen.touch()
        kind = "crash"
    if kind == "crash":
        with writing.Staging(overwrite=True) as staging:
            staging.write_text(Path(args.output), "half")
            print("it went wrong", file=sys.stderr, flush=True)
            os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))
    if kind == "hang":
        while True:
            time.sleep(1)
    if kind == "eat":
        eaten = []
        while True:
            eaten.append(b"x" * 50_000_000)
            time.sleep(0.002)
    if kind == "slow":
        time.sleep(0.5)
    return unwrap(args)


single.carried_out = carried_out
sys.exit(process.serve())
