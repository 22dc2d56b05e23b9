# SPDX-License-Identifier: GPL-3.0-or-later
"""Figure 11: distortion of every triangle of the mannequin head, in angles and areas.

As in the paper red is the discrete conformal map, green stretch minimisation (Yoshizawa et al. 2004), blue the
quasi-harmonic map.  The paper: it preserves conformality to a great extent while area distortion is reduced.  Stretch
minimisation reduces area distortion further, at the cost of angles; our default balance (grey) does better in both.
"""

import numpy as np

from qh_unwrap.core import distortion, unwrap
from qh_unwrap.core.curves import FIGURE_11, curves

from .common import Verdicts, given_meshes, output_folder, table
from .drawing import BLUE, GREEN, GREY, RED, plain_ticks, plt, save

COLOURS = dict(zip(FIGURE_11, (RED, GREEN, BLUE, GREY), strict=True))


def main():
    folder = output_folder(__doc__)
    (mesh,) = given_meshes("mannequin-devil.off").values()
    found = {method: distortion(*mesh, unwrap(*mesh, settings).uv) for method, settings in FIGURE_11.items()}
    rows = []
    for method, d in found.items():
        ratio = np.exp(np.abs(d.triangle_log_area))
        quantiles = [float(q) for values in (d.triangle_angle, ratio) for q in np.quantile(values, (0.5, 0.95))]
        rows.append((method, d.angle, *quantiles[:2], d.area, *quantiles[2:], d.l2_stretch))
    print("Ratios are of singular values and of areas (or the inverse of it, whichever is larger); the ideal is 1\n")
    angle, area = ("mean angle", "median", "95 %"), ("RMS log-area", "median ratio", "95 %")
    table(("map", *angle, *area, "L2 stretch"), rows)
    draw(found, folder)

    conformal, stretch, paper, default = found.values()
    verdicts = Verdicts()
    verdicts.claim(
        "the quasi-harmonic map has less than half the area distortion of the conformal one",
        paper.area < conformal.area / 2,
        f"RMS log-area {paper.area:.2f} and {conformal.area:.2f}",
    )
    verdicts.claim(
        "it preserves angles better than stretch minimisation",
        paper.angle < stretch.angle,
        f"mean ratio of stretches {paper.angle:.2f} and {stretch.angle:.2f}",
    )
    verdicts.claim(
        "balance 0.25 preserves angles and areas better than stretch minimisation",
        default.angle < stretch.angle and default.area < stretch.area,
        f"{default.angle:.2f} and {stretch.angle:.2f}, {default.area:.2f} and {stretch.area:.2f}",
    )
    verdicts.exit()


def draw(found, folder):
    count = len(found)
    figure, axes = plt.subplots(2, count + 1, figsize=(15, 5), sharey="row", sharex="col")
    axes[0, 0].set_ylabel("larger / smaller stretch")
    axes[1, 0].set_ylabel("relative area, surface / plane")
    for column, (method, d) in enumerate(found.items()):
        colour, its = COLOURS[method], curves([d])
        for row, name in zip(axes, ("angle", "area"), strict=True):
            values, ascending = getattr(its, name), getattr(its.ascending, name)
            row[column].plot(values, color=colour, linewidth=0.25, rasterized=True)
            row[count].plot(np.linspace(0, 1, len(values)), ascending, color=colour, label=method)
        axes[0, column].set(title=method, xlim=(0, len(values)), xticks=(0, 10000, 20000))
        axes[1, column].set_xlabel("triangle")
    axes[0, 0].set(yscale="log", ylim=(0.9, 40))
    axes[1, 0].set(yscale="log", ylim=(1e-2, 1e4))
    for axis in axes.ravel():
        axis.axhline(1, color="black", linewidth=0.6)
    axes[0, count].set_title("sorted")
    axes[1, count].set_xlabel("part of the triangles")
    axes[1, count].legend(loc="upper left", bbox_to_anchor=(0, 1.08), fontsize=7.5)
    plain_ticks(axes[0, 0].yaxis, (1, 2, 5, 10, 20, 40))
    save(figure, folder, "figure_11_distortion.png")


if __name__ == "__main__":
    main()
