# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures in files, and in an Image Editor."""

from functools import partial
from xml.etree import ElementTree

import bpy
import numpy as np

from . import checking
from .failures import FileError
from .figure import as_svg
from .lettering import letters
from .raster import pixels_of

NAME = "QH Unwrap Distortion"
FORMATS = (".png", ".svg")


def write(figure, path):
    """Write the figure as a new .png or .svg file."""
    if path.suffix.lower() == ".svg":
        path.write_text(as_svg(figure), encoding="utf-8")
        return
    image = _filled(bpy.data.images.new(NAME, figure.width, figure.height), figure)
    try:
        image.file_format = 'PNG'
        image.save(filepath=str(path))
    finally:
        bpy.data.images.remove(image)


def check(path):
    """Raise `FileError` if a file that we wrote is not whole."""
    if path.suffix.lower() != ".svg":
        checking.check_image(path)
        return
    try:
        ElementTree.parse(path)
    except ElementTree.ParseError as error:
        raise FileError(f"it does not read back ({error}): is the disk full?") from error


def as_image(figure):
    """The figure as an image in the file, in place of the one before it."""
    image = bpy.data.images.get(NAME)
    if image is None or image.library:
        image = bpy.data.images.new(NAME, figure.width, figure.height)
    if tuple(image.size) != (figure.width, figure.height):
        image.scale(figure.width, figure.height)
    _filled(image, figure).pack()
    return image


def _filled(image, figure):
    pixels = np.ones((figure.height, figure.width, 4), dtype=np.float32)
    pixels[..., :3] = pixels_of(figure, letters)[::-1]  # Blender's images begin at the bottom
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    return image


def show(image, context):
    """Show it in an Image Editor, in a new window if there is none."""
    area = next((area for area in context.screen.areas if area.ui_type == 'IMAGE_EDITOR'), None)
    if area is not None:
        _put(image, area)
        return
    # Not now: an operator that opens a window while it is modal in another one never ends there.
    bpy.app.timers.register(partial(_show_in_new_window, image.name, context.window), first_interval=0.01)


def _show_in_new_window(name, window):
    image = bpy.data.images.get(name)
    if image is not None and window in list(bpy.context.window_manager.windows):
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_new()
        area = max(bpy.context.window_manager.windows[-1].screen.areas, key=lambda area: area.width * area.height)
        area.ui_type = 'IMAGE_EDITOR'
        _put(image, area)


def _put(image, area):
    area.spaces.active.image = image
    area.tag_redraw()
