# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 10: mean value coordinates beside the quasi-harmonic map, on two sculpted heads."""

from qh_unwrap.core import distortion

from .common import Verdicts, final_map, given_meshes, output_folder, table
from .drawing import VIEWS, checkerboard, contact_sheet, layout, save

METHODS = {
    "mean value": {"initial": "MEAN_VALUE", "iterations": 0},
    "quasi-harmonic, mean value weights": {"weights": "MEAN_VALUE", "balance": 0.5, "iterations": 5},
    "quasi-harmonic": {"balance": 0.5, "iterations": 5},
    "balance 0.25": {"balance": 0.25, "iterations": 6},
}


def main():
    folder = output_folder(__doc__)
    meshes = given_meshes("demosthenes.obj", "camelhead.off")
    verdicts = Verdicts()
    rows = []
    for name, mesh in meshes.items():
        titles, boards, layouts, found = [], [], [], {}
        for method, settings in METHODS.items():
            uv = final_map(mesh, **settings)
            found[method] = d = distortion(*mesh, uv)
            rows.append((name, method, d.l2_stretch, d.angle, d.area, d.symmetric_dirichlet, d.flips))
            titles.append(f"{method}\nL2 {d.l2_stretch:.2f}, sym. Dirichlet {d.symmetric_dirichlet:.2f}")
            boards.append(checkerboard(mesh, uv, VIEWS[name], squares=60))
            layouts.append(layout(mesh, uv, VIEWS[name]))
        save(contact_sheet(titles, boards, layouts, width=3), folder, f"figure_10_{name}.png")
        before = found["mean value"]
        for method in list(METHODS)[1:]:
            after = found[method]
            verdicts.claim(
                f"{name}: {method} has a third of the L2 stretch of mean value coordinates or less, without flips",
                after.l2_stretch <= before.l2_stretch / 3 and not after.flips,
                f"{after.l2_stretch:.3f} and {before.l2_stretch:.3f}, {after.flips} flips",
            )
    print()
    table(("mesh", "map", "L2 stretch", "angle", "log-area", "sym. Dirichlet", "flips"), rows)
    verdicts.exit()


if __name__ == "__main__":
    main()
