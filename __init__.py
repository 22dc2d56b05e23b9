# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender demands this file beside the manifest; the extension is the package `qh_unwrap`."""


def register():
    from . import qh_unwrap

    qh_unwrap.register()


def unregister():
    from . import qh_unwrap

    qh_unwrap.unregister()
