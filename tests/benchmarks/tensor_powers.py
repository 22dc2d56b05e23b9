# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers of the tensor on a half-sphere, and the divergence of C where its inverse belongs.

The operator's tensor is C^-q: q = 1 is ours.  Taken literally the paper's eq. (10) has C itself, q = -1: where the map
is compressed conductivity is then high, and the next map is compressed more.
"""

import numpy as np

from qh_unwrap.core import Surface
from qh_unwrap.core.distortion import measure
from qh_unwrap.core.systems import Constrained
from qh_unwrap.core.tensor import surface_tensor
from qh_unwrap.core.weights import cotangent

from .common import Verdicts, changes, final_map, half_sphere, maps, output_folder, table
from .drawing import BLUE, RED, VIEWS, checkerboard, contact_sheet, plt, save

POWERS = (0.25, 0.5, 1.0, 1.5, 2.0)
ITERATIONS = 20
LITERAL = (1.08, 1.20, 1.66, 4.95, 213.0)  # L2 stretch, measured by two prototypes on another half-sphere


def main():
    folder = output_folder(__doc__)
    mesh = half_sphere()
    surface = Surface(*mesh)
    start = final_map(mesh, initial="HARMONIC", iterations=0)
    powers = {q: maps(mesh, initial="HARMONIC", balance=0.5, iterations=ITERATIONS, tensor_power=q) for q in POWERS}
    measured = {q: [measure(surface, uv) for uv in series] for q, series in powers.items()}
    moved = {q: changes(series) for q, series in powers.items()}
    shown = (1, 2, 3, 4, 5, 10, 20)
    print("Change by the diameter, C^-q\n")
    ends = [(d[-1].l2_stretch, d[-1].angle, d[-1].area) for d in measured.values()]
    rows = [(str(q), *(moved[q][i - 1] for i in shown), *end) for q, end in zip(POWERS, ends, strict=True)]
    table(("q", *map(str, shown), "L2 stretch", "angle", "log-area"), rows)

    literal = literal_series(surface, start, len(LITERAL) - 1)
    stretches = [measure(surface, uv).l2_stretch for uv in literal]
    print("L2 stretch, C\n")
    table(("iteration", *map(str, range(len(LITERAL)))), [("measured", *stretches), ("reference", *LITERAL)])
    draw(mesh, measured, moved, stretches, literal, folder)

    verdicts = Verdicts()
    for q in (0.5, 1.0, 1.5):
        text = f"q = {q}: converges (the change falls below 1e-4 within {ITERATIONS} iterations)"
        verdicts.claim(text, min(moved[q]) < 1e-4 and moved[q][-1] < 1e-4, f"{moved[q][-1]:.1e}")
    after_three = {q: moved[q][3] for q in POWERS}
    fastest = min(after_three, key=after_three.get)
    verdicts.claim("q = 1 is the fastest", fastest == 1, ", ".join(f"{q}: {x:.1e}" for q, x in after_three.items()))
    verdicts.claim(
        f"q = 2 hardly converges (the change is still above 1e-2 after {ITERATIONS})",
        1e-2 < moved[2.0][-1] < 0.1,
        f"{moved[2.0][-1]:.1e}",
    )
    areas = [d[-1].area for q, d in measured.items() if q in (0.5, 1.0, 1.5)]
    spread = max(areas) - min(areas)
    verdicts.claim("powers give different limits (q from 0.5 to 1.5)", spread > 1e-3, f"log-area {spread:.1e} apart")
    wrong = [abs(value / known - 1) for value, known in zip(stretches, LITERAL, strict=True)]
    verdicts.claim(
        "C itself diverges as the prototypes did (to 5 %)",
        max(wrong) < 0.05,
        " -> ".join(f"{x:.4g}" for x in stretches),
    )
    verdicts.exit()


def literal_series(surface, uv, iterations):
    """The maps (n, 2) that the literal eq. (10) makes from `uv`; its tensor, on the surface, is C^-q at q = -1."""
    held = np.zeros(len(surface.vertices), bool)
    held[surface.loops[0]] = True
    constrained = Constrained(surface.order, surface.edges, held, uv)
    series = [uv]
    for _ in range(iterations):
        series.append(constrained.solve(cotangent(surface, surface_tensor(surface, series[-1], 0.5, power=-1))))
    return series


def draw(mesh, measured, moved, stretches, literal, folder):
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4))
    for q, change in moved.items():
        left.semilogy(range(1, ITERATIONS + 1), np.maximum(change, 1e-12), "o-", label=f"q = {q:g}")
    right.semilogy(
        [d.l2_stretch for d in measured[1.0][: len(stretches)]], "o-", color=BLUE, label="its inverse (q = 1)"
    )
    right.semilogy(stretches, "o-", color=RED, label="C itself (q = -1)")
    left.set(xlabel="iteration", ylabel="change / diameter", xticks=range(0, ITERATIONS + 1, 5), ylim=(1e-15, 1))
    right.set(xlabel="iteration", ylabel="L2 stretch", xticks=range(len(stretches)))
    left.legend(loc="lower left", ncols=3)
    right.legend()
    save(figure, folder, "tensor_powers.png")
    boards = [checkerboard(mesh, uv, VIEWS["half-sphere"], squares=16, size=400) for uv in literal]
    names = ["start", *(f"iteration {i}" for i in range(1, len(literal)))]
    titles = [f"{name}\nL2 stretch {x:.3g}" for name, x in zip(names, stretches, strict=True)]
    save(contact_sheet(titles, boards, width=2), folder, "tensor_powers_literal.png")


if __name__ == "__main__":
    main()
