# SPDX-License-Identifier: GPL-3.0-or-later
"""What seams would bring where there are none."""

from ..core import Settings
from ..core.stepping import mapped
from ..core.tubes import unwrapped_along_a_seam

_STRETCHED = 1.1  # energy of a tube from which on it is worth a look,
_BETTER = 0.5  # and how much of what is more than 1 may be left for the seam to be worth it
_LARGEST = 5000  # triangles, of which a map is made in a moment
_MOST = 3  # tubes that are looked at in one run


def hint_at_seams(works):
    """Tell of open tubes without a seam from end to end what it would bring; yields the share that is done."""
    tubes = [work for work in works if _is_stretched_tube(work)][:_MOST]
    for k, work in enumerate(tubes):
        steps = unwrapped_along_a_seam(work.polygons, work.island, Settings(balance=work.settings.balance))
        result = yield from mapped(lambda share, k=k: (k + share) / len(tubes), steps)
        if result is None or not result.report.injective:
            continue
        before, after = work.outcome.after, result.report.after
        if after.symmetric_dirichlet - 1 < _BETTER * (before.symmetric_dirichlet - 1):
            work.outcome.warnings += (
                f"it is a tube: a seam from end to end would bring its stretch"
                f" from {before.l2_stretch:.3f} to {after.l2_stretch:.3f}",
            )


def _is_stretched_tube(work):
    if (
        work.uv is None
        or work.in_frame
        or work.importance is not None
        or work.settings.boundary != 'FREE'
        or len(work.loops) != 2
    ):
        return False
    return work.outcome.after.symmetric_dirichlet > _STRETCHED and len(work.triangles) <= _LARGEST
