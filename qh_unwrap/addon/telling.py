# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators report of a run."""

from . import cutting
from .last_run import last_run
from .outcome import check_summary, error_sentences, listed, sentences, summary


def tell(operator, outcomes, cuts):
    """Report what became of the islands, and of what was cut before; returns what the operator returns."""
    errors = error_sentences(outcomes)
    for sentence in (*(errors if len(errors) > 1 else ()), *sentences(outcomes), *_of_cuts(outcomes, cuts)):
        operator.report({'INFO'}, sentence)
    failed = sum(bool(outcome.error) for outcome in outcomes)
    if failed == len(outcomes):
        operator.report({'ERROR'}, summary(outcomes))
        return {'CANCELLED'}
    clean = not failed and all(outcome.is_clean for outcome in outcomes)
    operator.report({'INFO'} if clean else {'WARNING'}, summary(outcomes))
    return {'FINISHED'}


def tell_of_check(operator, outcomes):
    """Report what a check found; returns what the operator returns."""
    for sentence, _ in (*last_run.errors, *last_run.lines):
        operator.report({'INFO'}, sentence)
    clean = not last_run.found('LOOK')
    operator.report({'INFO'} if clean else {'WARNING'}, check_summary(outcomes))
    return {'FINISHED'}


def tell_of_seams(operator, cuts):
    """The same where nothing is unwrapped."""
    *lines, last = _of_cuts([], cuts)
    for line in lines:
        operator.report({'INFO'}, line)
    failed = any(chart.error for cut in cuts for chart in cut.charts)
    if failed and not any(cut.new.any() for cut in cuts):
        operator.report({'ERROR'}, lines[0])
        return {'CANCELLED'}
    operator.report({'WARNING'} if failed else {'INFO'}, last)
    return {'FINISHED'}


def _of_cuts(outcomes, cuts):
    """A line for each kind of remark that is not made of the islands as well, and one on all."""
    if not cuts:
        return
    said = {text for outcome in outcomes for text in (*outcome.warnings, outcome.error)}
    told = {}
    for name, text in cutting.remarks(cuts):
        if text not in said:
            told.setdefault(text, []).append(name)
    for text, names in told.items():
        yield f"{listed(names)}: {text}"
    yield cutting.summary(cuts, len(outcomes) or sum(len(cut.charts) for cut in cuts))
