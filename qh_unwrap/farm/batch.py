# SPDX-License-Identifier: GPL-3.0-or-later
"""The course of a batch: plan, unwrap, report."""

import math
import os
import sys
import time
import traceback
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from .. import single
from ..addon import stopping, writing
from ..addon.document import FAILED, OK, PARTIAL, USAGE
from ..addon.failures import NO_BLENDER, FileError, UsageError
from . import child, cluster, plan, pool, report, telling
from .asset import CURE
from .ledger import Ledger
from .worker import Limits

_WRITTEN = ("ok", "partial")


def carried_out(args):
    """Do it, and tell of it; returns the exit code."""
    teller = telling.teller(args)
    try:
        return _run(args, teller)
    except UsageError as error:
        code, reason = USAGE, error
    except FileError as error:
        code, reason = FAILED, error
    except OSError as error:  # such as a full disk under the ledger
        code, reason = FAILED, f"cannot go on: {error}"
    except stopping.Stopped as stop:
        stopping.heard()
        code, reason = stop.exit_code, f"{stop}: --resume goes on with the rest"
    except Exception as error:  # a fault of ours
        traceback.print_exc()
        code, reason = FAILED, f"{type(error).__name__}: {error}"
    teller.fail(code, reason)
    return code


def _run(args, teller):
    start = time.monotonic()
    _check(args)
    todo = plan.planned(args)
    reports = [Path(os.path.abspath(path)) for path in args.report or ()]
    _check_reports(reports, args, todo)
    entries, placed, count = {}, {}, len(todo.order)
    teller.begin(count)
    for entry in todo.done:
        entries[entry.output] = entry
        teller.tell(entry, len(entries), count)
    try:
        for entry in _unwrapped(args, todo):
            entry = _checked(entry, placed, todo.folder)
            entries[entry.output] = entry
            teller.tell(entry, len(entries), count)
    finally:
        found = [entries[output] for output in todo.order if output in entries]
        are_written = _write(reports, found, teller)
    code = exit_code(found)
    if code == OK and not are_written:
        code = PARTIAL
    seconds = time.monotonic() - start
    before = f"; {len(todo.done)} of them before" if todo.done else ""
    each = f", {seconds / len(todo.assets):.3f} s each" if todo.assets else ""
    teller.end(code, f"{report.summary(found)}{before}; {seconds:.1f} s{each}")
    return code


def _write(reports, entries, teller):
    """Write the reports, whatever else happens, and say so if that fails; returns whether they are there."""
    stopping.hold()
    try:
        for path in reports if entries else ():
            report.write(path, entries)
    except FileError as error:
        teller.fail(PARTIAL, error)
        return False
    finally:
        stopping.release()
    return True


def exit_code(entries):
    """What the command line ends with: 0 if all are good, 1 if some were written, 3 if none was."""
    if all(entry.is_good for entry in entries):
        return OK
    return PARTIAL if any(entry.status in _WRITTEN for entry in entries) else FAILED


def _check(args):
    if args.output or args.json or args.preview:
        raise UsageError("-O FOLDER excludes --output, --json and --preview: --name and --report are for many files")
    for name, least in (("jobs", 1), ("timeout", 0), ("memory", 0)):
        value = getattr(args, name)
        if value is not None and not (least <= value < math.inf and value > 0):
            raise UsageError(f"--{name} is {value}: choose a number above 0")
    if args.dask and args.jobs is not None:
        raise UsageError("--dask excludes --jobs: as many files at a time are unwrapped as the cluster has threads")
    if args.dask:
        cluster.require()
    elif "bpy" not in sys.modules and find_spec("bpy") is None:
        raise UsageError(NO_BLENDER)
    elif args.memory and child.resident(os.getpid()) is None:
        raise UsageError("--memory needs psutil on this system: pip install 'qh-unwrap[farm]'")
    single.settings_of(args)


def _check_reports(paths, args, todo):
    if len(set(map(os.path.realpath, paths))) < len(paths):
        raise UsageError("--report names a file twice")
    taken = {os.path.realpath(path) for path in todo.order}
    taken |= {os.path.realpath(each) for asset in todo.assets for each in (asset.input, *asset.owned)}
    taken |= {os.path.realpath(args.list)} if args.list else set()
    for path in paths:
        if os.path.realpath(path) in taken:
            raise UsageError(f"the report {path} would replace a file of the batch: choose another name")
        report.check(path, overwrite=args.overwrite, resume=args.resume)


def _unwrapped(args, todo):
    """Yield the entries of what is to be done, as they come."""
    if not todo.assets:
        return
    todo.folder.mkdir(exist_ok=True)
    since = Ledger(todo.folder).prepare()
    for folder, ticket in todo.stale:
        writing.sweep(folder, ticket)
    for folder in {Path(asset.output).parent for asset in todo.assets}:
        folder.mkdir(parents=True, exist_ok=True)
    assets = [replace(asset, since=since) for asset in todo.assets]
    limits = Limits(args.timeout, args.memory and args.memory * 1e9)
    if args.dask:
        yield from cluster.unwrapped(assets, args.dask, limits)
    else:
        yield from pool.unwrapped(assets, args.jobs or 1, limits)


def _checked(entry, placed, folder):
    """The entry, as failed if one of its files replaced one of another asset that was written at the same time."""
    for path in entry.files:
        other = placed.setdefault(path, entry.output)
        if other != entry.output:
            entry = replace(entry, status="failed", exit_code=FAILED, error=f"{path} is of {other} as well: {CURE}")
            Ledger(folder).write(entry)
    return entry


def report_folder(folder, paths, *, overwrite):
    """Write reports of all that is in the ledger of a folder; returns the exit code and a summary."""
    ledger = Ledger(Path(os.path.abspath(folder)))
    if not ledger.is_there:
        raise UsageError(f"{folder} has no ledger: nothing was written to it with -O")
    for path in paths:
        report.check(path, overwrite=overwrite, resume=True)
    entries = ledger.entries()
    for path in paths:
        report.write(path, entries)
    return exit_code(entries), report.summary(entries)
