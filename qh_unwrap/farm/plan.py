# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan of a batch: the assets, and which of them are done already.  All that is refused is refused here."""

import os
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from .. import __version__, flags
from ..addon import suffixes, writing
from ..addon.failures import UsageError
from . import naming
from .asset import Asset
from .ledger import Ledger, digest, digest_of

# What makes no difference to an output, or is another one's business
_IRRELEVANT = ("quiet", "verbose", "overwrite", "json", "preview", "input", "output")


class Plan(NamedTuple):
    """What is to do, and what was done before."""

    folder: Path
    assets: list  # that are to be unwrapped
    done: list  # entries of earlier runs
    order: list  # the outputs of both
    stale: list  # folders, and tickets of attempts that were cut off there


def planned(args):
    """The `Plan`; changes nothing, and raises `UsageError` where something would be replaced that may not be."""
    folder = Path(os.path.abspath(args.output_folder))
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"-O {folder} is no folder")
    if not folder.parent.is_dir():
        raise UsageError(f"there is no folder {folder.parent}")
    inputs = naming.inputs_of(args)
    outputs = naming.outputs_of(inputs, folder, args.name)
    options = {name: value for name, value in vars(args).items() if name not in flags.BATCH}
    settings = digest_of([__version__, {name: options[name] for name in options if name not in _IRRELEVANT}])
    options = {name: value for name, value in options.items() if name not in ("input", "output", "json", "preview")}
    numbers = naming.chosen(args.only, len(inputs)) if args.only is not None else range(len(inputs))
    ledger = Ledger(folder)
    assets, done, stale = [], [], []
    for number in numbers:
        path, output = inputs[number], outputs[number]
        entry = ledger.read(output) if args.resume or args.overwrite else None
        if args.resume and entry and _is_done(entry, path, output, settings):
            done.append(replace(entry, input=str(path), output=str(output)))  # which may have been seen elsewhere
            continue
        _check_free(args, output, entry)
        if entry and entry.is_unfinished and entry.ticket:
            stale.append((output.parent, entry.ticket))
        asset = Asset(
            str(path),
            str(output),
            str(folder),
            options=options,
            settings=settings,
            owned=tuple(str(each) for each in _written(args, output)),
            old=tuple(entry.files) if entry else (),
            timeout=args.timeout,
        )
        assets.append(asset)
    for place in {_existing(Path(asset.output).parent) for asset in assets}:
        writing.check_folder(place / "file")
    return Plan(folder, assets, done, [str(outputs[number]) for number in numbers], stale)


def _is_done(entry, path, output, settings):
    """Whether the output is what these settings make of this input."""
    if not entry.is_good or entry.settings != settings or not all(map(os.path.isfile, entry.files)):
        return False
    if digest(output) != entry.output_digest:
        return False
    return os.path.realpath(path) == os.path.realpath(output) or digest(path) == entry.input_digest


def _written(args, output):
    """The paths that are sure to be written."""
    sibling = suffixes.sibling(output) if args.write != "patch" else None
    return [output, sibling] if sibling else [output]


def _check_free(args, output, entry):
    """Raise `UsageError` if something is in the way that was not written by an earlier run of the same batch."""
    for path in _written(args, output):
        if path.exists() and not path.is_file():
            raise UsageError(f"{path} is a folder, or no file to write to")
        if not path.exists() or args.overwrite:
            continue
        if entry is None or not (entry.is_unfinished or str(path) in entry.files):
            cure = "pass --overwrite, or choose another --name or folder"
            raise UsageError(f"{path} exists: {cure if args.resume else f'pass --resume to go on, {cure[5:]}'}")
        if path == output and not entry.is_unfinished and digest(output) != entry.output_digest:
            raise UsageError(f"{path} was changed since it was written: move it away, or pass --overwrite")


def _existing(folder):
    """The folder, or the first one above it that is there."""
    while not folder.is_dir():
        if folder.exists():
            raise UsageError(f"{folder} is no folder: choose another --name")
        folder = folder.parent
    return folder
