# SPDX-License-Identifier: GPL-3.0-or-later
"""How many iterations a map needs: the paper observes that it stabilises after three to five.

From the harmonic map, flips repaired as by default.  The limit is the map after 40 iterations.
"""

import numpy as np

from qh_unwrap.core import Settings, Surface
from qh_unwrap.core.distortion import measure

from .common import Verdicts, changes, given_meshes, maps, output_folder, table
from .drawing import plt, save

SHOWN = 8
LONG = 40


def main():
    folder = output_folder(__doc__)
    meshes = given_meshes("venus.obj", "camelhead.off", "mannequin-devil.off", "face_bff.obj", "cowhead.obj")
    verdicts, needed, left = Verdicts(), {}, {}
    figure, axes = plt.subplots(2, 2, figsize=(9, 6), sharex=True, sharey="row")
    for column, balance in zip(axes.T, (0.5, 0.25), strict=True):
        rows = []
        for name, mesh in meshes.items():
            moved, excess = history(mesh, balance)
            needed[balance, name] = stabilised(moved, excess)
            left[balance, name] = excess[Settings().iterations]
            rows.append((name, "change", "", *moved[:SHOWN], ""))
            rows.append(("", "excess", *excess[: SHOWN + 1], str(needed[balance, name])))
            column[0].semilogy(range(1, SHOWN + 1), moved[:SHOWN], "o-", label=name)
            column[1].semilogy(range(SHOWN + 1), np.maximum(excess[: SHOWN + 1], 1e-6), "o-")
        print(f"Balance {balance}: change by the diameter, and how far the L2 stretch is above its limit")
        print("needed: iterations until the excess is below 1 % and the change below 1e-2\n")
        table(("mesh", "", *map(str, range(SHOWN + 1)), "needed"), rows)
        column[0].axhline(1e-2, color="0.5", linestyle="--", linewidth=0.8)
        column[1].axhline(1e-2, color="0.5", linestyle="--", linewidth=0.8)
        column[0].set_title(f"balance {balance}{' (the paper)' if balance == 0.5 else ' (default)'}")
        column[1].set_xlabel("iteration")
    axes[0, 0].set_ylabel("change / diameter")
    axes[1, 0].set_ylabel("L2 stretch above its limit, relative")
    axes[0, 0].legend(loc="lower left")
    save(figure, folder, "convergence.png")

    for name in meshes:
        count = needed[0.5, name]
        verdicts.claim(f"{name}: stable within 5 iterations at balance 0.5", count is not None and count <= 5, count)
    for name in meshes:
        rest = left[0.25, name]
        text = f"{name}: within 2 % of its limit after the default {Settings().iterations} iterations at balance 0.25"
        verdicts.claim(text, abs(rest) < 0.02, f"{rest:+.2%}, and stable after {needed[0.25, name]}")
    verdicts.exit()


def history(mesh, balance):
    """For every iteration the change, and from the start on the relative excess of the L2 stretch over its limit."""
    series = maps(mesh, initial="HARMONIC", balance=balance, iterations=LONG, repair=True)
    surface = Surface(*mesh)
    l2_stretch = np.array([measure(surface, uv).l2_stretch for uv in series])
    return changes(series), l2_stretch / l2_stretch[-1] - 1


def stabilised(moved, excess):
    """The first iteration from which on everything is below the thresholds."""
    unstable = np.flatnonzero((np.abs(excess[1:]) > 1e-2) | (np.array(moved) > 1e-2))
    return int(unstable[-1]) + 2 if len(unstable) else 1


if __name__ == "__main__":
    main()
