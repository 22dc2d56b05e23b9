# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of the assets of a folder, in a file for each, so that any number of machines can write at a time."""

import hashlib
import json
import os
import uuid
from pathlib import Path

from ..addon.failures import FileError
from .entry import Entry

_FOLDER = ".qh-unwrap"
_BLOCK = 1 << 20


class Ledger:
    """The entries of what was written to a folder, in a hidden folder within."""

    def __init__(self, folder):
        self._outputs = folder
        self._folder = folder / _FOLDER

    @property
    def is_there(self):
        """Whether anything was written to it."""
        return self._folder.is_dir()

    def prepare(self):
        """Make its folder; returns the time by the clock of that file system."""
        self._folder.mkdir(exist_ok=True)
        mark = self._folder / "begun"
        mark.write_bytes(b"")
        return mark.stat().st_mtime

    def read(self, output):
        """The entry of an output, None if there is none."""
        return _read(self._place(output))

    def write(self, entry):
        """Put an entry in the place of the output's last one."""
        place = self._place(entry.output)
        temporary = place.with_name(f"{place.name}.{uuid.uuid4().hex}")
        try:
            temporary.write_text(json.dumps(entry.to_dict()), encoding="utf-8")
            os.replace(temporary, place)  # not synced, which takes as long as a small asset: see `_read`
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise FileError(f"cannot write to {self._folder}: {error.strerror}") from error

    def entries(self):
        """All entries, by the names of the inputs."""
        found = [_read(path) for path in self._folder.glob("*.json")]
        return sorted(
            (entry for entry in found if entry and entry.input), key=lambda entry: (entry.input, entry.output)
        )

    def _place(self, output):
        name = Path(output).relative_to(self._outputs).as_posix()  # machines may see the folder in different places
        return self._folder / f"{hashlib.sha256(os.fsencode(name)).hexdigest()[:32]}.json"


def _read(path):
    try:
        return Entry.of(json.loads(path.read_bytes()))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, AttributeError):  # cut off with the power: the asset counts as unfinished
        return Entry("", "")


def digest(path):
    """A digest of the content of a file, and of the buffers that a .gltf file names; "" if it cannot be read."""
    total = hashlib.sha256()
    try:
        for file in [path, *_buffers(path)]:
            with open(file, "rb") as stream:
                while block := stream.read(_BLOCK):
                    total.update(block)
    except OSError:
        return ""
    return total.hexdigest()


def _buffers(path):
    if path.suffix.lower() != ".gltf":
        return []
    try:
        names = [each.get("uri", "data:") for each in json.loads(path.read_bytes()).get("buffers", [])]
        return [path.parent / name for name in names if not name.startswith("data:")]
    except (ValueError, AttributeError):
        return []


def digest_of(values):
    """A digest of what JSON can hold."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
