# SPDX-License-Identifier: GPL-3.0-or-later
"""From a projection on the least-squares plane, foldovers ignored, to the same map as from any other start.

The paper's section 7 computes all its examples so.  The circle is fixed: maps are compared vertex by vertex.
"""

from qh_unwrap.core import distortion

from .common import Verdicts, distance, final_map, given_meshes, maps, output_folder, table
from .drawing import VIEWS, checkerboard, contact_sheet, layout, save

ITERATIONS = 10
BALANCE = 0.5
PICTURED = "camelhead"
MESHES = (
    "venus.obj", "lilium.obj", "camelhead.off", "mannequin-devil.off", "face_bff.obj", "demosthenes.obj", "cowhead.obj"
)  # fmt: skip


def main():
    folder = output_folder(__doc__)
    meshes = given_meshes(*MESHES)
    verdicts, rows, judged = Verdicts(), [], []
    for name, mesh in meshes.items():
        settings = {"balance": BALANCE, "iterations": ITERATIONS}
        series = maps(mesh, initial="PROJECTION", **settings)
        others = [final_map(mesh, initial=initial, **settings) for initial in ("HARMONIC", "MEAN_VALUE")]
        folded = distortion(*mesh, series[0])
        l2_stretch = [distortion(*mesh, uv).l2_stretch for uv in (series[5], series[-1], others[0])]
        apart = [distance(series[-1], other) for other in others]
        rows.append((name, folded.flips, len(mesh[1]), folded.l2_stretch, *l2_stretch, distance(*others), *apart))
        worst, relative = max(apart), abs(l2_stretch[1] / l2_stretch[2] - 1)
        judged.append((name, worst < 1e-3 and relative < 1e-2, f"{worst:.1e}, L2 stretch {relative:.1e} apart"))
        if name == PICTURED:
            draw(mesh, series, others[0], folder)
    print(f"Distances after {ITERATIONS} iterations, by the diameter; balance {BALANCE}\n")
    stretches = ("L2 at start", "after 5", f"after {ITERATIONS}", "from harmonic")
    distances = ("harmonic-mean value", "projection-harmonic", "projection-mean value")
    table(("mesh", "flips at start", "of", *stretches, *distances), rows)
    for name, holds, figures in judged:
        verdicts.claim(f"{name}: the same map from the projection, to 1e-3 of the diameter", holds, figures)
    verdicts.exit()


def draw(mesh, series, other, folder):
    shown = {
        "projection": series[0],
        "iteration 1": series[1],
        "iteration 3": series[3],
        f"iteration {ITERATIONS}": series[-1],
        "from the harmonic map": other,
    }
    boards = [checkerboard(mesh, uv, VIEWS[PICTURED]) for uv in shown.values()]
    layouts = [layout(mesh, uv, VIEWS[PICTURED]) for uv in shown.values()]
    save(contact_sheet(list(shown), boards, layouts), folder, "projection_start.png")


if __name__ == "__main__":
    main()
