# SPDX-License-Identifier: GPL-3.0-or-later
"""Which islands lie on others now and did not before: quickly said of thousands, and named of a few."""

from ..core.overlaps import new_overlaps
from . import layout
from .work import triangles_in_image

_NAMED = 5  # of those that an island lies on


def report_overlaps(works, all_works, options):
    """Put into the works' outcomes what they lie on now and did not lie on before.

    A generator that yields the share that is done, from 0 to 1.  What shares no image does not overlap.
    """
    rest = [f"other faces of {obj.name}" for obj, _, _ in layout.left_alone(all_works)]
    found = yield from new_overlaps_of(works, all_works)
    for work, others in zip(works, found, strict=False):
        outcome = work.outcome
        outcome.overlaps = tuple(
            works[other].outcome.label if other < len(works) else rest[other - len(works)] for other in others[:_NAMED]
        )
        outcome.more_overlaps = len(others[_NAMED:])
        # Packing moves only what is unwrapped, and does not help again.
        packing_helps = options.placement != 'PACK' and others and others[0] < len(works)
        outcome.overlap_cure = "pack them together" if packing_helps else "move it to a free place"


def new_overlaps_of(works, all_works):
    """For each of the works, and then for what `layout.left_alone` yields, the numbers among these of what it lies on
    now and did not before.  A generator like `report_overlaps`."""
    others = list(layout.left_alone(all_works))
    if len(works) + len(others) < 2:
        return [[] for _ in works]
    now = triangles_in_image(works)
    before = [work.old_triangles / work.aspect if work.has_place else None for work in works]
    images = [work.image for work in works]
    for _, rest, image in others:
        now.append(rest)
        before.append(rest)
        images.append(image)
    numbers = {image: number for number, image in enumerate(dict.fromkeys(images))}
    return (yield from new_overlaps(now, before, [numbers[image] for image in images]))
