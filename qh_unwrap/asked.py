# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether what the command line is asked for can be meant: files, folders, formats and room; needs no Blender."""

import os
from pathlib import Path

from .addon import suffixes, writing
from .addon.failures import UsageError


def is_same(one, other):
    """Whether two paths lead to one file."""
    return os.path.realpath(one) == os.path.realpath(other)


def check_paths(args):
    """Raise `UsageError` where the files cannot be meant, before anything is written, the report included."""
    pictures = {"--preview": args.preview, "--plot": args.plot}
    writes = {"--output": args.output, **pictures, "--seams-from-islands": args.seams_from_islands}
    if args.check and args.relax:
        raise UsageError("--check and --relax exclude each other")
    if args.check and any(writes.values()):
        unwanted = next(flag for flag, value in writes.items() if value)
        raise UsageError(f"--check changes and writes nothing but the report: leave out {unwanted}")
    if args.input != "suzanne":
        args.input = Path(args.input)
        if args.json and is_same(args.json, args.input):
            args.json = None
            raise UsageError(f"--json would replace the input {args.input}: choose another name")
        if not args.input.is_file():
            raise UsageError(f"there is no file {args.input}")
    report = args.json if str(args.json) != "-" else None
    places = {}
    sibling = suffixes.sibling(args.output) if args.output and args.write != "patch" else None
    for path in filter(None, (args.output, sibling, report, *pictures.values())):
        place = os.path.realpath(path)
        if place in places:
            args.json = None
            raise UsageError(f"{path} is asked for twice: choose another name")
        places[place] = path
    for path in places.values():
        if not path.absolute().parent.is_dir():
            raise UsageError(f"there is no folder {path.absolute().parent}")
        if path.exists() and not path.is_file():
            raise UsageError(f"{path} is a folder, or no file to write to")
        if path.exists() and not args.overwrite:
            raise UsageError(f"{path} exists: choose another name, or pass --overwrite")
    for path in places.values():
        writing.check_folder(path)


def check_formats(args, preview, plotting):
    """Raise `UsageError` where a format cannot be read or written."""
    if args.input != "suzanne" and args.input.suffix.lower() not in suffixes.READ:
        raise UsageError(f"cannot read {args.input}: use {', '.join(suffixes.READ)}")
    if args.output and args.output.suffix.lower() not in suffixes.WRITTEN:
        raise UsageError(f"cannot write {args.output}: UVs can be kept in {', '.join(suffixes.WRITTEN)}")
    if args.preview and args.preview.suffix.lower() not in preview.FORMATS:
        raise UsageError(f"cannot write {args.preview}: pictures can be {', '.join(preview.FORMATS)}")
    if args.plot and args.plot.suffix.lower() not in plotting.FORMATS:
        raise UsageError(f"cannot write {args.plot}: plots can be {', '.join(plotting.FORMATS)}")
    if args.texcoord is not None and not (isinstance(args.texcoord, int) and args.texcoord >= 0):
        raise UsageError(f"--texcoord is {args.texcoord!r}: choose a whole number from 0")


def check_room(args, objects, files):
    """Raise `FileError` where there is no room for the files."""
    sizes = {path: 100_000 for path in (args.preview, args.plot) if path}
    if args.output:
        sizes[args.output] = files.likely_size(args.output, args.input, objects)
    writing.check_room(sizes)
