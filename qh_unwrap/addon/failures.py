# SPDX-License-Identifier: GPL-3.0-or-later
"""Why a run on a file ends without a result; needs no Blender."""

NO_BLENDER = "this needs Blender: pip install 'qh-unwrap[bpy]', or run it inside Blender"


class UsageError(ValueError):
    """What was asked for cannot be meant: nothing was written, and the message says what to change."""


class FileError(Exception):
    """A file could not be read or written; what was there before is still there."""
