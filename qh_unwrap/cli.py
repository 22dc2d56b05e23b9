# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: `qh-unwrap`, `python -m qh_unwrap` and `blender --command qh_unwrap`; and the same for Python.

Exit codes: 0 everything unwrapped, or no fault found; 1 something failed (the rest is written), or faults found;
2 wrong usage; 3 nothing could be done; 130 and 143 after SIGINT and SIGTERM.
"""

import argparse
import json
import os
import sys
from contextlib import suppress
from pathlib import Path

from . import asked, console, flags, single
from .addon import stopping
from .addon.document import FAILED, OK, PARTIAL, USAGE, Record
from .addon.failures import FileError, UsageError
from .farm import batch, process, templates

_command = None


def register():
    """Let `blender --command qh_unwrap` come here."""
    global _command
    import bpy

    _command = bpy.utils.register_cli_command("qh_unwrap", main)


def unregister():
    import bpy

    bpy.utils.unregister_cli_command(_command)


def main(argv=None):
    argv = sys.argv[1:] if argv is None else list(argv)
    with stopping.stoppable():
        if argv[:1] == ["farm"]:
            return _farm(argv[1:])
        try:
            args = flags.parsed(argv)
        except SystemExit as stop:  # argparse, after --help
            return stop.code
        except UsageError as error:
            args, record = _understood(argv), Record()
            record.fail(USAGE, error)
            single.finish(args, record)
        else:
            if args.output_folder is not None:
                return batch.carried_out(args)
            bar = console.Bar(wanted=not args.quiet)
            record = single.carried_out(args, bar)
            bar.close()
        with suppress(stopping.Stopped):  # all is done: who stops now has read enough
            _show(args, record)
        return record.exit_code


def _farm(argv):
    """What comes after the word `farm`."""
    try:
        if argv[:1] and argv[0] in templates.PRINTED and "--help" not in argv:
            console.show(templates.PRINTED[argv[0]](_for_tasks(argv[1:])).rstrip())
            return OK
        args = flags.farm_parser().parse_args(argv)
        if args.word == "worker":
            return process.serve()
        code, summary = batch.report_folder(args.folder, args.files, overwrite=args.overwrite)
    except SystemExit as stop:  # argparse, after --help
        return stop.code
    except (UsageError, FileError) as error:
        console.show(f"qh-unwrap: error: {error}", error=True)
        return USAGE if isinstance(error, UsageError) else FAILED
    console.show(summary)
    return code


def _for_tasks(argv):
    """The flags for the tasks of a job, which are right and leave alone what the job decides."""
    args = flags.parsed(["a.obj", "-O", "a", *argv])
    for name in ("list", "only", "report", "progress", "dask", "output", "json", "preview"):
        if getattr(args, name) is not None:
            raise UsageError(f"--{name} is not for the tasks of a job, which decides that itself")
    if args.input != ["a.obj"] or args.output_folder != Path("a"):
        raise UsageError("the job itself says which files are unwrapped, and to which folder: give other flags alone")
    single.settings_of(args)
    return argv


def unwrap_file(path, output=None, **options):
    """Unwrap a file as the command line does; see `qh_unwrap.unwrap_file`."""
    args = flags.parser().parse_args(["suzanne"])
    known = {name: value for name, value in vars(args).items() if name not in _NOT_IN_PYTHON}
    unknown = sorted(options.keys() - known.keys())
    if unknown:
        raise UsageError(f"there is no option {', '.join(unknown)}: use {', '.join(known)}")
    if str(options.get("json")) == "-":
        raise UsageError("json is the path of a file here: the report is what is returned")
    for name, value in options.items():
        if isinstance(known[name], bool) and value not in (True, False):
            raise UsageError(f"{name} is {value!r}: choose True or False")
        if name in _REPEATABLE and isinstance(value, str):
            value = [value]
        elif name == "cut":
            try:
                value = flags.cut(value)
            except argparse.ArgumentTypeError as error:
                raise UsageError(f"cut: {error}") from None
        elif name in ("json", "preview", "plot") and value is not None:
            value = Path(value)
        elif isinstance(value, str) and isinstance(known[name], str) and known[name]:  # a choice, and no free name
            value = value.upper()
        setattr(args, name, value)
    if args.uv_map is not None and args.texcoord is not None:
        raise UsageError("uv_map and texcoord exclude each other")
    args.input, args.output = os.fspath(path), Path(output) if output is not None else None
    record = single.carried_out(args)
    if record.exit_code == USAGE:
        raise UsageError(record.error)
    return record.to_dict()


_NOT_IN_PYTHON = ("input", "output", "quiet", "verbose", *flags.BATCH)
_REPEATABLE = ("object", "collection", "material")


def _understood(argv):
    """What counts of arguments that are wrong in some other place: where to write the report, and how."""
    parser = flags.Parser(add_help=False, allow_abbrev=False)
    parser.add_argument("--json", type=Path)
    for name in ("overwrite", "quiet", "verbose"):
        parser.add_argument(f"--{name}", action="store_true")
    try:
        args, others = parser.parse_known_args(argv)
    except UsageError:
        args, others = parser.parse_args([]), []
    if args.json and any(asked.is_same(args.json, each.partition("=")[2] or each) for each in others):
        args.json = None  # it names the input, or another file
    return args


def _show(args, record):
    if str(args.json) == "-":
        console.show(json.dumps(record.to_dict(), indent=2))
    else:
        is_written = record.exit_code in (OK, PARTIAL)
        told = record.outcomes if is_written or not record.done else []
        others = record.sentences() if is_written else record.warning_sentences()
        console.show_outcomes(told, others, verbose=args.verbose, quiet=args.quiet)
    if record.error:
        console.show(f"qh-unwrap: error: {record.error}", error=True)
