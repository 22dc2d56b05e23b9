# SPDX-License-Identifier: GPL-3.0-or-later
"""New files in place of old ones, all of them or none, and only when they are whole; needs no Blender."""

import filecmp
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from . import stopping
from .failures import FileError

_PREFIX = ".qh-unwrap-"  # of what waits for its place
_LEAST = 1 << 14  # bytes: a disk with less is full


class _Waiting(NamedTuple):
    file: Path  # the new one
    path: Path  # the name that it will have
    place: Path  # the same without symbolic links: they stay, and what they lead to is replaced


class Staging:
    """New files that wait beside their places until all of them are known to be good.

    Use it in a `with` statement: what was not put in place by its end is removed, whatever happened.

    overwrite   whether files that exist may be replaced, or a function that is called with the path of each of them and
                raises `FileError` where that one must stay
    """

    ticket = ""  # stands in the names of all that waits, so that `sweep` finds what a process that was killed has left

    def __init__(self, *, overwrite):
        self._overwrite = overwrite
        self.placed = []  # the paths of the files that are in place
        self._waiting = []
        self._temporary = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        stopping.hold()
        try:
            for path in self._temporary:
                _remove(path)
        finally:
            stopping.release()

    def write(self, path, write, check, *, beside=False):
        """Have `write(temporary)` make the file that is to become `path`, and others in the same folder if it likes.

        check    called with each file that was made; raises what is wrong with it
        beside   make it in the folder of `path`, for a file with names in it that are relative to that
        """
        path = path.absolute()
        temporary = self._name_beside(path) if beside else self._folder_beside(path) / path.name
        write(temporary)
        if not temporary.is_file():
            raise FileError("no file was made")
        made = [temporary] if beside else [file for file in temporary.parent.rglob("*") if file.is_file()]
        for file in sorted(made, key=lambda file: file == temporary):  # the file comes after those that it names
            check(file)
            relative = path.name if beside else file.relative_to(temporary.parent)
            self._wait(file, path.parent / relative, is_sibling=file != temporary)

    def write_text(self, path, text):
        data = text.encode()

        def check(file):
            if file.stat().st_size != len(data):
                raise FileError("it was cut off")

        self.write(path, lambda file: file.write_bytes(data), check)

    def put_in_place(self):
        """Replace the old files.  If one cannot be replaced, none is."""
        replaced = []
        with stopping.undisturbed():
            try:
                for file, _, place in self._waiting:
                    place.parent.mkdir(parents=True, exist_ok=True)
                    kept = self._kept(file, place)
                    os.replace(file, place)
                    replaced.append((place, kept))
            except OSError:
                for place, kept in reversed(replaced):
                    if kept:
                        os.replace(kept, place)
                    else:
                        place.unlink()
                raise
            for folder in {place.parent for _, _, place in self._waiting}:
                _sync(folder)
            self.placed += [path for _, path, _ in self._waiting]
            self._waiting.clear()

    def _kept(self, file, place):
        """A copy of the old file, to bring it back if one of the others cannot be replaced; None if there is none."""
        if len(self._waiting) == 1 or not place.exists():
            return None
        kept = file.with_name(f"{file.name}.old")
        self._temporary.append(kept)
        try:
            os.link(place, kept)
        except OSError:  # on file systems without links
            shutil.copy2(place, kept)
        return kept

    def _wait(self, file, path, *, is_sibling):
        place = Path(os.path.realpath(path))
        if place.exists():
            if is_sibling and filecmp.cmp(file, place, shallow=False):
                return  # such as a texture of the input, which is in the same folder
            if callable(self._overwrite):
                self._overwrite(path)
            elif not self._overwrite:
                raise FileError(f"{path} exists: choose another name, or pass --overwrite")
        if _device(place.parent) not in (None, _device(file)):  # the symbolic link leads to another disk
            distant = self._name_beside(place)
            shutil.copyfile(file, distant)
            file = distant
        _sync(file)
        if place.exists():
            _keep_mode(file, place)
        self._waiting.append(_Waiting(file, path, place))

    def _folder_beside(self, path):
        with stopping.undisturbed():
            folder = Path(tempfile.mkdtemp(dir=path.parent, prefix=f"{_PREFIX}{self.ticket}"))
            self._temporary.append(folder)
            return folder

    def _name_beside(self, path):
        """A free name; its beginning tells `_remove` what else was left beside it."""
        with stopping.undisturbed():
            folder = self._folder_beside(path)
            name = folder.with_name(f"{folder.name}-{path.name}")
            self._temporary.append(name)
            return name


def sweep(folder, ticket):
    """Remove what a process that is no more left in the folder, waiting for its place."""
    for path in folder.glob(f"{_PREFIX}{ticket}*"):
        _remove(path)


def check_folder(path):
    """Raise `FileError` where the folder of `path` takes no files, or `path` is protected against writing."""
    path = Path(os.path.realpath(path))
    if path.exists() and not os.access(path, os.W_OK):
        raise FileError(f"cannot write {path}: it is write-protected")
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
    except OSError as error:
        raise FileError(f"cannot write to the folder {path.parent}: {error.strerror}") from error


def check_room(sizes):
    """Raise `FileError` where the files, given as paths with a cautious guess of their sizes, do not fit."""
    needed = {}
    for path, size in sizes.items():
        folder = Path(os.path.realpath(path)).parent
        first, total = needed.get(_device(folder), (folder, 0))
        needed[_device(folder)] = first, total + size
    for folder, size in needed.values():
        free = shutil.disk_usage(folder).free
        if size > free:
            room = f"about {_megabytes(size)} are needed, and {_megabytes(free)} are free"
            raise FileError(f"cannot write to the folder {folder}: {room}")


def is_full(path):
    """Whether nothing more fits where `path` is."""
    return shutil.disk_usage(Path(os.path.realpath(path)).parent).free < _LEAST


def _megabytes(size):
    return f"{size / 1e6:.1f} MB"


def _device(path):
    return path.stat().st_dev if path.exists() else None


def _sync(path):
    """Have the file or folder on the disk before anything that comes later; errors of delayed writing show here."""
    if path.is_dir():
        if os.name == "nt":  # which has no such thing
            return
        handle = os.open(path, os.O_RDONLY)
    else:
        handle = os.open(path, os.O_RDWR | getattr(os, "O_BINARY", 0))
    try:
        os.fsync(handle)
    except OSError:
        if not path.is_dir():  # some network file systems do not do it for folders
            raise
    finally:
        os.close(handle)


def _keep_mode(file, place):
    """Give the new file the owner, if that is allowed, and the permissions of the old one."""
    old, new = place.stat(), file.stat()
    if hasattr(os, "chown") and (old.st_uid, old.st_gid) != (new.st_uid, new.st_gid):
        with suppress(OSError):
            os.chown(file, old.st_uid, old.st_gid)
    os.chmod(file, old.st_mode & 0o7777)


def _remove(path):
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    for left in [path, path.with_name(f"{path.name}@")]:  # Blender's own temporary file, if the disk is full
        left.unlink(missing_ok=True)
