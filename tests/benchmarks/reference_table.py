# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures that independent prototypes of the method measured, measured again.

Circle by arc length, exact numbers of iterations.  A figure agrees within 2 % or half a unit of its last printed digit;
a repaired map, since there are many ways to repair, may also have less distortion than the prototypes'.
"""

from qh_unwrap.core import distortion

from .common import Verdicts, final_map, given_meshes, output_folder, table
from .drawing import VIEWS, checkerboard, contact_sheet, save

HARMONIC = {"initial": "HARMONIC", "iterations": 0}
MEAN_VALUE = {"initial": "MEAN_VALUE", "iterations": 0}
MEASURES = ("l2_stretch", "angle", "area", "symmetric_dirichlet")


def quasi_harmonic(balance, iterations=10, initial="HARMONIC", **settings):
    return {"balance": balance, "iterations": iterations, "initial": initial, **settings}


# mesh, map, settings; L2 stretch, angle, log-area, symmetric Dirichlet as printed; flips
ROWS = [
    ("mannequin-devil", "harmonic", HARMONIC, "18.996", "1.14", "3.58", "180.9", 3),
    ("mannequin-devil", "mean value", MEAN_VALUE, "14.225", "1.42", "3.60", "101.7", 0),
    *(
        ("mannequin-devil", f"t = 1/2, from {start}", settings, "2.158", "1.72", "1.48", "2.96", 4)
        for start, settings in (
            ("harmonic", quasi_harmonic(0.5)),
            ("mean value", quasi_harmonic(0.5, initial="MEAN_VALUE")),
            ("Tutte", quasi_harmonic(0.5, initial="UNIFORM")),
        )
    ),
    ("mannequin-devil", "t = 1/4", quasi_harmonic(0.25), "1.364", "2.87", "0.55", "1.92", 8),
    ("mannequin-devil", "t = 1/4, repaired", quasi_harmonic(0.25, 12, repair=True), "1.37", "2.84", "0.57", "1.93", 0),
    (
        "mannequin-devil",
        "t = 1/4, mean value tensor",
        quasi_harmonic(0.25, 12, weights="MEAN_VALUE"),
        "1.561",
        "2.59",
        "0.81",
        "2.07",
        0,
    ),
    ("camelhead", "harmonic", HARMONIC, "16.078", "1.08", "3.54", "129.8", 0),
    ("camelhead", "t = 1/2", quasi_harmonic(0.5), "2.430", "1.78", "1.50", "3.60", 0),
    ("camelhead", "t = 1/4", quasi_harmonic(0.25), "1.422", "2.90", "0.57", "1.96", 0),
    ("face_bff", "t = 1/2", quasi_harmonic(0.5), "1.406", "1.51", "0.60", "1.53", 0),
]


def main():
    folder = output_folder(__doc__)
    meshes = given_meshes("mannequin-devil.off", "camelhead.off", "face_bff.obj")
    verdicts = Verdicts()
    printed, judged, boards = [], [], {}
    for mesh, name, settings, *reference, flips in ROWS:
        uv = final_map(meshes[mesh], **settings)
        found = distortion(*meshes[mesh], uv)
        boards[f"{mesh}\n{name}"] = checkerboard(meshes[mesh], uv, VIEWS[mesh], size=400)
        measured = [getattr(found, measure) for measure in MEASURES]
        apart = [value / float(text) - 1 for value, text in zip(measured, reference, strict=True)]
        printed.append((mesh, name, "reference", *reference, str(flips)))
        rounded = [f"{value:.{_digits(text)}f}" for value, text in zip(measured, reference, strict=True)]
        printed.append(("", "", "measured", *rounded, str(found.flips)))
        printed.append(("", "", "difference", *(f"{value:+.2%}" for value in apart), ""))
        repaired = settings.get("repair", False)
        agree = all(
            _agrees(value, text) or (repaired and value < float(text))
            for value, text in zip(measured, reference, strict=True)
        )
        judged.append((f"{mesh}, {name}", agree and found.flips <= flips, max(apart, key=abs), found.flips))
    table(("mesh", "map", "", "L2 stretch", "angle", "log-area", "sym. Dirichlet", "flips"), printed)
    titles, pictures = list(boards), list(boards.values())
    for part in range(0, len(titles), 6):
        figure = contact_sheet(titles[part : part + 6], pictures[part : part + 6], width=2.4)
        save(figure, folder, f"reference_table_{part // 6 + 1}.png")
    for text, holds, worst, flips in judged:
        verdicts.claim(text, holds, f"at most {abs(worst):.2%} off, {flips} flips")
    verdicts.exit()


def _digits(text):
    return len(text.partition(".")[2])


def _agrees(value, text):
    return abs(value - float(text)) <= max(0.02 * float(text), 0.5 * 10.0 ** -_digits(text))


if __name__ == "__main__":
    main()
