# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that an OBJ file cannot do without: its materials, and their images."""

from pathlib import Path

_IMAGES = ("map_", "bump", "disp", "decal", "refl", "norm")  # how the names of the keywords begin


def siblings(folder, libraries):
    """The names, relative to the folder, of the material libraries that are there, and of their images."""
    for line in libraries:
        for library in [line] if Path(folder, line).is_file() else line.split():
            if Path(folder, library).is_file():
                yield library
                yield from _images(folder, library)


def _images(folder, library):
    base = Path(library).parent
    for line in Path(folder, library).read_bytes().decode("utf-8", "surrogateescape").splitlines():
        words = line.split()
        if len(words) < 2 or not words[0].lower().startswith(_IMAGES):
            continue
        for first in range(1, len(words)):  # options come before the name, which may have spaces
            name = line.split(None, first)[-1].strip()
            if Path(folder, base, name).is_file():
                yield name if Path(name).is_absolute() else str(base / name)
                break
