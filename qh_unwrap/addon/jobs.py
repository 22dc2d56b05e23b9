# SPDX-License-Identifier: GPL-3.0-or-later
"""All that is done to faces in one go, for the operators and the command line: cut, unwrap, or both; relax."""

from ..core.stepping import mapped
from . import cutting, mesh_arrays, modes, relaxing
from .last_run import last_run
from .unwrapping import unwrap_targets

_CUTTING = {'NEVER': 0.0, 'NEEDED': 0.1, 'DISTORTION': 0.7}  # the part of the work, by and large


def cut_and_unwrap(targets, settings, options, context, seam_settings=None, seam_options=None):
    """Unwrap the targets, after new seams as far as the options want them.

    A generator: yields the share that is done, returns the outcomes of the islands and the cuts.  Nothing is written
    before all is done.
    """
    cuts, part = [], _CUTTING[options.cut]
    if options.cut != 'NEVER':
        steps = cutting.find_all(targets, options.cut, seam_settings, seam_options, options, settings)
        cuts = yield from mapped(lambda share: part * share, steps)
    steps = unwrap_targets(targets, settings, options, context, cuts)
    outcomes = yield from mapped(lambda share: part + (1 - part) * share, steps)
    last_run.remember(outcomes, settings, options)
    return outcomes, cuts


def cut(targets, settings, options, context, seam_settings, seam_options):
    """The same without an unwrap: no outcomes, and the cuts, whose seams are marked."""
    cuts = yield from cutting.find_all(targets, seam_options.until, seam_settings, seam_options, options, settings)
    with modes.in_object_mode(context):
        for each in cuts:
            if each.new.any():
                mesh_arrays.mark_seams(each.target.obj, each.new)
    return [], cuts


def relax(chosen, settings, options, context):
    """Relax what is chosen, as `relaxing.relax` wants it: the outcomes of its regions, and no cuts."""
    return (yield from _remembered(relaxing.relax(chosen, settings, options, context), settings, options))


def straighten(chosen, settings, options, context):
    """The same with what is to become straight."""
    return (yield from _remembered(relaxing.straighten(chosen, settings, options, context), settings, options))


def _remembered(steps, settings, options):
    outcomes = yield from steps
    if outcomes:
        last_run.remember(outcomes, settings, options)
    return outcomes, []
