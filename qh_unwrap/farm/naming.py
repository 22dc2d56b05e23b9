# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files a batch is of, and what their outputs are called; refuses what cannot all be meant."""

import glob
import os
import re
import unicodedata
from pathlib import Path

from ..addon import suffixes
from ..addon.failures import UsageError

_RANGE = re.compile(r"(\d+)(?:-(\d+))?(?::(\d+))?")
_FIELDS = "{stem}, {suffix} and {folder}"


def inputs_of(args):
    """The absolute paths of all files that are named, in the command line and in the list."""
    names = [name for each in args.input for name in _matching(each)]
    if args.list:
        try:
            lines = args.list.read_text(encoding="utf-8-sig", errors="surrogateescape").splitlines()
        except OSError as error:
            raise UsageError(f"cannot read the list {args.list}: {error.strerror}") from None
        names += [os.path.join(args.list.parent, line.strip()) for line in lines if line.strip()]
    paths = [Path(os.path.abspath(name)) for name in names]
    if not paths:
        raise UsageError("there is no INPUT: name files, or pass --list FILE")
    for path in paths:
        _check_input(path)
    return paths


def _matching(name):
    """The files that fit a pattern, sorted, where the shell has left it as it is, as that of Windows does."""
    if not os.path.exists(name) and glob.has_magic(name):
        return sorted(glob.glob(name)) or [name]
    return [name]


def _check_input(path):
    if path.is_dir():
        raise UsageError(f"{path} is a folder: name the files in it, such as '{path / '*.obj'}'")
    if not path.is_file():
        raise UsageError(f"there is no file {path}")
    if path.suffix.lower() not in suffixes.READ:
        raise UsageError(f"cannot read {path}: use {', '.join(suffixes.READ)}")


def outputs_of(inputs, folder, pattern):
    """The absolute path of each input's output; raises `UsageError` where two are the same on some system."""
    common = os.path.commonpath([path.parent for path in inputs]) if _are_on_one_drive(inputs) else None
    outputs = [folder / _name(path, pattern, common) for path in inputs]
    first = {}
    for path, output in zip(inputs, outputs, strict=True):
        if output.suffix.lower() not in suffixes.WRITTEN:
            cure = "choose another --name, such as '{stem}_uv.obj'"
            raise UsageError(f"cannot write {output}: UVs can be kept in {', '.join(suffixes.WRITTEN)}; {cure}")
        other = first.setdefault(_key(output), path)
        if other == path and other is not path:
            raise UsageError(f"{path} is named twice")
        if other is not path:
            cure = "choose another --name, such as '{folder}/{stem}_uv{suffix}'"
            cure = "rename one of them, or choose another --name" if other.parent == path.parent else cure
            raise UsageError(f"{other} and {path} would both be written to {output}: {cure}")
    _check_inputs_stay(inputs, outputs)
    return outputs


def _check_inputs_stay(inputs, outputs):
    """Raise `UsageError` where the output of one file would replace another one."""
    places = {_key(os.path.realpath(path)): path for path in inputs}
    for path, output in zip(inputs, outputs, strict=True):
        replaced = places.get(_key(os.path.realpath(output)))
        if replaced and _key(replaced) != _key(path):
            raise UsageError(f"the output of {path} would replace {replaced}: choose another --name or folder")


def _key(path):
    """The same for names that some system takes for one: but for case, or as other characters for the same letters."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", str(path)).casefold())


def _name(path, pattern, common):
    folder = os.path.relpath(path.parent, common) if common else path.parent.name
    try:
        name = Path(os.path.normpath(pattern.format(stem=path.stem, suffix=path.suffix, folder=folder)))
    except (LookupError, ValueError, AttributeError):
        raise UsageError(f"--name {pattern!r} cannot be read: use {_FIELDS}") from None
    if name.is_absolute() or name.parts[:1] in ((), (os.pardir,)) or name.drive:
        raise UsageError(f"--name {pattern!r} leads out of the folder: use {_FIELDS}")
    return name


def _are_on_one_drive(inputs):
    return len({path.drive.casefold() for path in inputs}) == 1


def chosen(ranges, count):
    """Which of so many are meant, by numbers from 0, in a text like "1-10,15,20-30:2", which counts from 1."""
    found = []
    for part in ranges.split(","):
        match = _RANGE.fullmatch(part.strip())
        if not match:
            raise UsageError(f"--only {ranges!r} cannot be read: use numbers and ranges such as 1-10,15")
        first, last, step = (int(each) if each else None for each in match.groups())
        found += range(first, (last or first) + 1, step or 1)
    if not found or min(found) < 1 or max(found) > count:
        raise UsageError(f"--only {ranges!r} does not fit: there are {count} files, from 1")
    return sorted({number - 1 for number in found})
