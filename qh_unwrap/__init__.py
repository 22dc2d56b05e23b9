# SPDX-License-Identifier: GPL-3.0-or-later
"""QH Unwrap: quasi-harmonic maps for Blender.  `qh_unwrap.core` needs no Blender."""

__version__ = "0.1.0"


def register():
    from .addon import registration

    registration.register()


def unregister():
    from .addon import registration

    registration.unregister()
