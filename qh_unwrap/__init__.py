# SPDX-License-Identifier: GPL-3.0-or-later
"""QH Unwrap: quasi-harmonic maps for Blender.  `qh_unwrap.core` needs no Blender."""

__version__ = "0.1.0"


def register():
    from . import cli
    from .addon import registration

    registration.register()
    cli.register()


def unregister():
    from . import cli
    from .addon import registration

    cli.unregister()
    registration.unregister()


def last_report():
    """What became of every island of the latest run, in Blender or by the command line: a list of dictionaries.

    Each has `object`, `island` (its number), `faces` (how many), `face_indices` and either `error` or `before`,
    `after`, `iterations`, `converged`, `injective`, `overlaps` (some of what it lies on now), `more_overlaps` (how many
    more were found) and `warnings`, as in the command line's JSON.
    """
    from .addon import outcome

    return outcome.last_report()
