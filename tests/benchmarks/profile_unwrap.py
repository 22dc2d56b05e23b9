# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time of a default unwrap goes: the functions that take more than 3 % of it themselves.

python -m tests.benchmarks.profile_unwrap [--sizes 2000,30000,500000] [--least 0.03]
"""

import argparse
import cProfile
import pstats
from pathlib import Path

from .common import table
from .generated import hills
from .in_blender import extension, unwrapped


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="2000,30000,500000", help="triangles of the generated meshes")
    parser.add_argument("--least", type=float, default=0.03, help="part of the time that a listed function takes")
    arguments = parser.parse_args()
    with extension():
        unwrapped(hills(500))  # what happens only once does not count
        for size in arguments.sizes.split(","):
            mesh = hills(int(size))
            profile = cProfile.Profile()
            seconds, _ = unwrapped(mesh, around=profile)
            print(f"{len(mesh[1]):,} triangles: {seconds:.2f} s, profiled")
            rows = largest(pstats.Stats(profile).stats, arguments.least)
            table(("function", "called mostly by", "calls", "share", "s"), rows)


def largest(stats, least):
    """A row for each function that takes at least its share of the time, the largest first."""
    total = sum(own for _, _, own, _, _ in stats.values())
    rows = []
    for function, (_, calls, own, _, callers) in stats.items():
        if own >= least * total:
            caller = max(callers, key=lambda caller: callers[caller][2], default=None)
            rows.append((_name(function), caller and _name(caller), calls, f"{own / total:.1%}", own))
    return sorted(rows, key=lambda row: -row[-1])


def _name(function):
    path, line, name = function
    return f"{Path(path).stem}:{line} {name}" if line else name


if __name__ == "__main__":
    main()
