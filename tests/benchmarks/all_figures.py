# SPDX-License-Identifier: GPL-3.0-or-later
"""Run every benchmark, one after another, and say which claims fall short."""

import subprocess
import sys
import time

from .common import output_folder

BENCHMARKS = (
    "reference_table",
    "convergence",
    "figure_7_self_correction",
    "figure_9_closed_model",
    "figures_2_8_comparison",
    "figure_10_mean_value",
    "figure_11_distortion",
    "projection_start",
    "mesh_density",
    "tensor_powers",
    "free_boundary",
)


def main():
    folder = output_folder(__doc__)
    summary, failed = [], False
    for name in BENCHMARKS:
        started = time.perf_counter()
        command = [sys.executable, "-m", f"tests.benchmarks.{name}", "--out", str(folder)]
        run = subprocess.run(command, capture_output=True, text=True)
        print(f"\n== {name}\n\n{run.stdout}{run.stderr}", flush=True)
        lines = run.stdout.splitlines()
        held = sum(line.startswith("holds") for line in lines)
        short = [line for line in lines if line.startswith("FALLS SHORT")]
        skipped = run.stdout.startswith("skipped")
        broken = run.returncode and not short
        outcome = "broke" if broken else "skipped" if skipped else f"{held} of {held + len(short)} claims hold"
        summary.append(f"{name:<28}{outcome:<24}{time.perf_counter() - started:>6.0f} s")
        summary += [f"    {line}" for line in short]
        failed |= run.returncode != 0
    print("\n== summary\n")
    print("\n".join(summary))
    sys.exit(failed)


if __name__ == "__main__":
    main()
