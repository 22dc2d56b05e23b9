# SPDX-License-Identifier: GPL-3.0-or-later
"""QH Unwrap: quasi-harmonic maps for Blender.  `qh_unwrap.core` needs no Blender."""

from .addon.failures import UsageError as UsageError

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
    more were found), `warnings` and `texel_density`, as in the command line's JSON.  After a check of UVs, it has
    `faults`, `mirrored`, `stacked` and `published` as well, and nothing of the run.
    """
    from .addon import outcome

    return outcome.last_report()


def unwrap_file(path, output=None, **options):
    """Unwrap a file and write it to `output`, if that is given, as the command line does.

    path      a file that Blender reads, or "suzanne"; it is opened in place of what is open in Blender
    options   named like the flags, with underscores: `boundary="CIRCLE"`, `uv_map="Lightmap"`, `write="patch"`; those
              that may be repeated (`object`, `collection`, `material`) are a text or a list of texts

    Returns the dictionary that `--json` writes.  Its `exit_code` is 0 if all is well, 1 if some islands failed, and 3,
    with the reason in `error`, if nothing could be written: none of that raises anything.  Raises `UsageError`, a
    `ValueError`, for what the command line would call wrong usage; then nothing was written.
    """
    from . import cli

    return cli.unwrap_file(path, output, **options)
