# SPDX-License-Identifier: GPL-3.0-or-later
"""Thousands of random patches with a free outline: certified means that a second, independent checker finds nothing.

Patches are cut from generated surfaces and from those of the folder QH_MESHES, or are fans, strips one triangle wide
and slivers.  For every three patches one map is made to overlap: by pins, by a conformal map left as it is, by a
displaced vertex.  `--count` chooses the number of patches; failures and the worst cases are saved.
"""

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from qh_unwrap.core import Settings, Shape, Surface, UnwrapError, unwrap, unwrap_islands
from qh_unwrap.core.certificate import is_injective
from qh_unwrap.core.stepping import finished

from ..core.overlaps import faults
from ..core.patches import LARGEST, Patches, random_strip
from .common import Verdicts, find_mesh, load_mesh, table

SOURCES = (
    *("camelhead.off", "mannequin-devil.off", "cowhead.obj", "face_bff.obj", "face_igl.obj", "demosthenes.obj"),
    *("lilium.obj", "maze.obj", "hand_yaron_slivers.obj", "beetle_11loops.off", "cat_closed_slivers.obj"),
)
SIZES = (1, 4, 21, 101, 501, 2501, 10**9)


@dataclass
class Case:
    """A map that was certified or not, and what the checker says."""

    kind: str
    seed: int
    vertices: np.ndarray = field(repr=False)
    triangles: np.ndarray = field(repr=False)
    uv: np.ndarray = field(repr=False)
    certified: bool
    seconds: float = 0.0
    distortion: float = 1.0
    faults: tuple = field(init=False)
    """Flipped triangles, collapsed ones, overlapping pairs"""

    def __post_init__(self):
        flipped, collapsed, pairs = faults(self.uv, self.triangles)
        self.faults = flipped, collapsed, len(pairs)

    @property
    def clean(self):
        return not any(self.faults)

    def save(self, folder, name):
        path = folder / f"campaign_free_{name}_{self.kind}_{self.seed}.npz".replace(" ", "-")
        np.savez_compressed(path, vertices=self.vertices, triangles=self.triangles, uv=self.uv)
        print(f"    {self.kind} {self.seed}: {len(self.triangles)} triangles, {self.faults}, {path}")


def unwrapped(patches, seed, largest=LARGEST):
    """Patch number `seed`, unwrapped."""
    kind, vertices, triangles = patches(seed, largest)
    started = time.perf_counter()
    result = unwrap(vertices, triangles)
    seconds = time.perf_counter() - started
    report = result.report
    return Case(kind, seed, vertices, triangles, result.uv, report.injective, seconds, report.after.symmetric_dirichlet)


def together(cases):
    """The same patches once more, as the islands of one mesh."""
    results = finished(unwrap_islands([Shape(case.vertices, case.triangles) for case in cases]))
    for result in results:
        if isinstance(result, UnwrapError):
            raise result
    return [
        Case(case.kind, case.seed, case.vertices, case.triangles, result.uv, result.report.injective)
        for case, result in zip(cases, results, strict=True)
    ]


def overlapping(patches, seed, largest=1500):
    """A map of patch number `seed` made to overlap: mostly it does."""
    random = np.random.default_rng([seed, 1])
    _, vertices, triangles = patches(seed, largest)
    kind = str(random.choice(["crossed pins", "raw conformal", "displaced"]))
    if kind == "raw conformal":
        winding = stair(random) if random.random() < 0.7 else random_strip(random, random.integers(100, 500))
        vertices, triangles = winding
        result = unwrap(vertices, triangles, Settings(initial="CONFORMAL", iterations=0, refine=0))
        return Case(kind, seed, vertices, triangles, result.uv, result.report.injective)
    uv = unwrap(vertices, triangles, Settings(iterations=3)).uv
    surface = Surface(vertices, triangles)
    if kind == "displaced":
        uv = displaced(random, uv, surface)
        return Case(kind, seed, vertices, triangles, uv, is_injective(uv, triangles, surface.loops))
    uv, pinned = crossed(random, uv, surface)
    result = unwrap(vertices, triangles, Settings(), uv, pinned)
    assert (result.uv[pinned] == uv[pinned]).all()
    mirror = [-1 if result.report.mirrored else 1, 1]
    return Case(kind, seed, vertices, triangles, result.uv * mirror, result.report.injective)


def stair(random):
    """A ramp that winds round more than once."""
    turns, steps, across = random.uniform(1.3, 4), random.integers(40, 120), random.integers(1, 5)
    angle, along = np.meshgrid(np.linspace(0, 2 * np.pi * turns, steps + 1), np.linspace(0, 1, across + 1))
    radius = random.uniform(0.5, 3) + along
    points = [radius * np.cos(angle), radius * np.sin(angle), random.uniform(0.02, 0.3) * angle]
    k = np.add.outer(np.arange(across) * (steps + 1), np.arange(steps)).ravel()
    up = k + steps + 1
    triangles = np.vstack([np.column_stack([k, up + 1, k + 1]), np.column_stack([k, up, up + 1])])
    return np.column_stack([p.ravel() for p in points]), triangles


def displaced(random, uv, surface):
    """One vertex somewhere else: far away, on top of another, across a side by one unit in the last place."""
    uv = uv.astype(np.float32).astype(float)
    loop = surface.loops[0]
    moved = int(random.choice(loop) if random.random() < 0.7 else random.integers(len(uv)))
    manner = random.integers(4)
    if manner == 0:
        uv[moved] += random.normal(size=2)
    elif manner == 1:
        uv[moved] = uv[random.integers(len(uv))]
    else:  # the middle of a side of the outline, and somewhat beyond
        at = random.integers(len(loop))
        a, b = uv[loop[at]], uv[loop[at - 1]]
        inward = np.array([(b - a)[1], -(b - a)[0]])
        uv[moved] = (a + b) / 2 + (0 if manner == 2 else random.choice([1e-7, 1e-3, 0.1])) * inward
    return uv


def crossed(random, uv, surface):
    """Pins that no map without overlaps can keep: an outline shuffled or in a figure of eight, a triangle turned."""
    uv, pinned = uv.copy(), np.zeros(len(uv), bool)
    loop, manner = surface.loops[0], random.integers(3) if len(surface.triangles) > 5 else 2
    if manner == 0:
        pinned[loop] = True
        uv[loop] = random.permutation(uv[loop])
    elif manner == 1:
        pinned[loop] = True
        angle = 2 * np.pi * (np.arange(len(loop)) + 0.5) / len(loop)
        uv[loop] = np.column_stack([np.sin(angle), np.sin(2 * angle)])
    else:
        corners = surface.triangles[random.integers(len(surface.triangles))]
        pinned[corners] = True
        uv[corners[:2]] = uv[corners[1::-1]]
        pinned[random.integers(len(uv), size=3)] = True
    return uv, pinned


def campaign(patches, count, made):
    """The cases of `count` patches, those of `made` overlapping ones, and what raised an exception."""
    free, overlaps, raised = [], [], []
    for cases, make, total in ((free, unwrapped, count), (overlaps, overlapping, made)):
        for seed in range(total):
            try:
                cases.append(make(patches, seed))
            except Exception as error:  # whatever it is, it is counted
                raised.append((make.__name__, seed, error))
    return free, overlaps, raised


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for failures (default: out)")
    parser.add_argument("--count", type=int, default=2000, help="number of patches (default: 2000)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    paths = [path for path in map(find_mesh, SOURCES) if path]
    print(f"Patches of {len(paths)} scanned and modelled surfaces and of six generated ones\n")
    patches = Patches([load_mesh(path) for path in paths])
    made = arguments.count // 3
    free, overlaps, raised = campaign(patches, arguments.count, made)

    rows = []
    for low, high in pairwise(SIZES):
        group = [case for case in free if low <= len(case.triangles) < high]
        if group:
            seconds = np.median([case.seconds for case in group])
            row = [sum(case.certified for case in group), sum(case.clean for case in group)]
            worst = [max(case.distortion for case in group), np.median([case.distortion for case in group])]
            rows.append((f"{low} to {min(high - 1, 5000)}", len(group), *row, *worst, 1e3 * seconds))
    table(("triangles", "patches", "certified", "clean", "worst sym. D.", "median", "median ms"), rows)
    kinds = Counter(case.kind for case in free), Counter(case.kind for case in free if case.certified)
    table(("kind", "patches", "certified"), [(kind, kinds[0][kind], kinds[1][kind]) for kind in sorted(kinds[0])])
    at_fault = [case for case in overlaps if not case.clean]
    kinds = Counter(case.kind for case in overlaps), Counter(case.kind for case in at_fault)
    table(("made to overlap by", "maps", "do"), [(kind, kinds[0][kind], kinds[1][kind]) for kind in sorted(kinds[0])])

    for name, seed, error in raised:
        print(f"    {name} {seed}: {type(error).__name__}: {error}")
    joined = together(free)
    print(f"{len(joined)} of the patches were unwrapped once more, together\n")
    finite = all(np.isfinite(case.uv).all() for case in free + overlaps + joined)
    wrong = [case for case in free + overlaps + joined if case.certified and not case.clean]
    missed = [case for case in free if case.clean and not case.certified]
    uncertified = [case for case in free if not case.certified]
    for case in wrong:
        case.save(arguments.out, "wrong")
    for case in uncertified[:20]:
        case.save(arguments.out, "uncertified")
    print("\nWorst distortion, and slowest:")
    max(free, key=lambda case: case.distortion).save(arguments.out, "worst")
    max(free, key=lambda case: case.seconds).save(arguments.out, "slowest")
    print()
    verdicts = Verdicts()
    verdicts.claim(
        f"no exception in {arguments.count} patches and {made} maps made to overlap", not raised, len(raised)
    )
    verdicts.claim("no NaN", finite)
    certified = sum(case.certified for case in free + joined)
    verdicts.claim("certified maps are clean, says the checker", not wrong, f"{len(wrong)} of {certified} are not")
    share = len(missed) / len(free)
    verdicts.claim("less than 1 % of the patches are clean but not certified", share < 0.01, f"{share:.2%}")
    claim = "at least a quarter as many maps overlap as there are patches, and none is certified"
    none = not any(case.certified for case in at_fault)
    verdicts.claim(claim, none and len(at_fault) >= arguments.count // 4, f"{len(at_fault)}")
    print(f"            {len(uncertified)} of {len(free)} patches are not certified")
    verdicts.exit()


if __name__ == "__main__":
    main()
