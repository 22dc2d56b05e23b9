# SPDX-License-Identifier: GPL-3.0-or-later
"""Free outlines: distortion, certificates and what the air costs, on scans, models, developable surfaces and holes.

Every map is judged by the tests' own checker of overlaps as well.
"""

import time
from contextlib import contextmanager

from qh_unwrap.core import Settings, domain, unwrap

from ..core import shapes
from ..core.overlaps import is_clean
from .common import Verdicts, given_meshes, output_folder, table
from .drawing import VIEWS, checkerboard, contact_sheet, layout, save

# The most that symmetric Dirichlet may be
DISKS = {
    "face_bff.obj": 1.15,
    "camelhead.off": 1.93,
    "mannequin-devil.off": 1.91,
    "cowhead.obj": 2.07,
    "camel_b.obj": 1.06,
    "lilium.obj": 1.010,
    "maze.obj": 1.01,
    "venus.obj": 2.23,
    "hemisphere_pmp.off": 1.045,
    "demosthenes.obj": None,
    "face_igl.obj": None,
    "hand_yaron_slivers.obj": None,
}
HOLES = {"beetle_11loops.off": 1.03, "capsule_quads_3loops.off": 1.24, "halftunnel_quads_3loops.off": 1.43}
COST = {"camelhead.off": 1 / 4, "maze.obj": 1 / 2}  # the most that the air may take of an unwrap's time
PICTURES = {
    "camel_b": ((1, 0.15, 0.35), (0, 1, 0)),
    "face_bff": VIEWS["face_bff"],
    "beetle_11loops": ((-0.9, 0.7, 0.8), (0, 1, 0)),
    "maze": ((0.35, 0.8, 0.5), (1, 0, 0)),
}


def main():
    folder = output_folder(__doc__)
    meshes = given_meshes(*DISKS, *HOLES)
    verdicts, rows, claims, defaults = Verdicts(), [], [], {}

    def judged(name, mesh, most, **settings):
        started = time.perf_counter()
        result = unwrap(*mesh, Settings(**settings))
        seconds = time.perf_counter() - started
        report, after = result.report, result.report.after
        certified = report.injective and not after.flips and is_clean(result.uv, mesh[1])
        how = ", ".join(f"{key} {value}" for key, value in settings.items()) or "defaults"
        words = "certified" if certified else f"{after.flips} flips, {'' if report.injective else 'not '}certified"
        row = (name, how, str(len(mesh[1])), str(report.iterations), after.l2_stretch, after.symmetric_dirichlet)
        rows.append((*row, words, f"{seconds:.2f}"))
        holds = certified and (most is None or most(after))
        claims.append((f"{name}, {how}", holds, f"{after.symmetric_dirichlet:.4f}, L2 {after.l2_stretch:.4f}, {words}"))
        return result

    for name, most in DISKS.items():
        stem = name.partition(".")[0]
        defaults[stem] = judged(stem, meshes[stem], None)
        judged(stem, meshes[stem], most and (lambda after, most=most: after.symmetric_dirichlet <= most), iterations=30)
    for name, most in HOLES.items():
        stem = name.partition(".")[0]
        defaults[stem] = judged(stem, meshes[stem], None)
        judged(stem, meshes[stem], lambda after, most=most: after.symmetric_dirichlet <= most, iterations=12)
    for name in shapes.DEVELOPABLE:
        mesh = shapes.developable(name)
        judged(name, mesh, lambda after: after.l2_stretch < 1.005)
        judged(name, mesh, lambda after: after.l2_stretch < 1.005, initial="MEAN_VALUE", iterations=60, tolerance=1e-5)
    table(("mesh", "settings", "triangles", "iterations", "L2 stretch", "sym. Dirichlet", "", "s"), rows)

    printed = []
    for name, most in COST.items():
        stem = name.partition(".")[0]
        total, spent = cost(meshes[stem])
        air = sum(spent.values()) / total
        parts = [f"{spent[part] / total:.1%}" for part in PARTS]
        printed.append((stem, f"{total:.2f}", *parts, f"{air:.1%}"))
        claims.append(
            (f"{stem}: air takes less than {most:.0%} of the time", air < most, f"{air:.0%} of {total:.2f} s")
        )
    print("Time of an unwrap, and what part of it the air takes\n")
    table(("mesh", "s", *PARTS.values(), "air in all"), printed)

    boards = [checkerboard(meshes[name], defaults[name].uv, view) for name, view in PICTURES.items()]
    layouts = [layout(meshes[name], defaults[name].uv, view) for name, view in PICTURES.items()]
    save(contact_sheet(list(PICTURES), boards, layouts, width=3.4), folder, "free_boundary.png")
    for text, holds, figures in claims:
        verdicts.claim(text, holds, figures)
    verdicts.exit()


# Functions that are timed, and what they do
PARTS = {
    "make_air": "new air",
    "quality": "its quality",
    "_take": "its equations",
    "weights": "scale",
}


def cost(mesh):
    """The time of an unwrap with the defaults, and of the parts of it that air needs, in seconds."""
    unwrap(*mesh)
    spent = dict.fromkeys(PARTS, 0.0)
    with (
        timed(domain, "make_air", spent),
        timed(domain, "quality", spent),
        timed(domain.Plane, "_take", spent),
        timed(domain.Plane, "weights", spent),
    ):
        started = time.perf_counter()
        unwrap(*mesh)
        return time.perf_counter() - started, spent


@contextmanager
def timed(owner, name, spent):
    """Add up in `spent` the time within a function of a module or class."""
    function = getattr(owner, name)

    def wrapped(*arguments):
        started = time.perf_counter()
        try:
            return function(*arguments)
        finally:
            spent[name] += time.perf_counter() - started

    setattr(owner, name, wrapped)
    try:
        yield
    finally:
        setattr(owner, name, function)


if __name__ == "__main__":
    main()
