# SPDX-License-Identifier: GPL-3.0-or-later
"""Relaxes and straightens thousands of random meshes in Blender, and looks at what must hold for all of them.

    python -m tests.campaigns.relaxing [--first 0] [--count 1000]

Nothing but UVs changes, and nothing at all with an error; pins, outlines that are held, and faces that are not selected
keep their UVs to the last bit; what had no flips has none; one coordinate stays where only the other may move.
"""

import bpy  # isort: skip
import argparse
import time
import warnings
from collections import Counter

import numpy as np
from scenes import changes, uvs

import qh_unwrap
from qh_unwrap.addon import operators

from .fuzz import _uv_editor, built, settled, silence, state
from .judging import orientation
from .meshes import random_case


def spoilt(dice, case):
    """The case with UVs of numbers, some of them moved about."""
    uv = case.uv
    if uv is None or isinstance(uv, str):
        return case
    uv, kind = np.array(uv, float), dice.random()
    vertex = np.concatenate([np.array(face) for face in case.faces])
    _, place = np.unique(np.column_stack([vertex, np.round(uv, 5)]), axis=0, return_inverse=True)
    size = np.nan_to_num(np.ptp(uv, axis=0)).max() or 1.0
    if kind < 0.5:  # a little, so that little flips
        uv = (
            uv
            + (dice.normal(size=(place.max() + 1, 2)) * size * 0.3 / len(case.faces) ** 0.5 * dice.random())[
                place.ravel()
            ]
        )
    elif kind < 0.65:  # some far
        thrown = dice.random(place.max() + 1) < 0.05
        uv = uv + (thrown[:, None] * dice.normal(size=(len(thrown), 2)) * size)[place.ravel()]
    elif kind < 0.7:
        uv = uv * (1, 0)
    return case.changed(uv=uv)


def call(dice, case):
    """The operator's name and options, its error, and how long it took."""
    if dice.random() < 0.75:
        name = "qh_relax"
        options = dict(
            direction=str(dice.choice(["BOTH", "BOTH", "U", "V"])),
            move_outline=bool(dice.random() < 0.4),
            blend=float(dice.choice([1.0, 1.0, 0.5])),
            balance=float(dice.choice([0.25, 0.25, 0.0, 0.5, 1.0])),
        )
    else:
        name = "qh_straighten"
        options = dict(
            shape=str(dice.choice(["LINES", "RECTANGLE"])),
            along=str(dice.choice(["AUTO", "U", "V"])),
            move_outline=bool(dice.random() < 0.7),
        )
    operator, started, error = getattr(bpy.ops.uv, name), time.perf_counter(), ""
    try:
        with silence():
            if case.in_editor:
                with bpy.context.temp_override(**_uv_editor()):
                    operator(**options)
            else:
                operator(**options)
    except RuntimeError as problem:
        error = str(problem).strip()
    return name, options, error, time.perf_counter() - started


def checked(seed):
    """What is wrong with the case of this seed, a list of texts; and what became of it."""
    dice = np.random.default_rng([seed, 1])
    case = spoilt(dice, settled(random_case(seed)))
    obj = built(case)
    operators.last_outcomes.clear()
    before, old = state(obj), uvs(obj) if obj.data.uv_layers else None
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        name, options, error, seconds = call(dice, case)
    wrong = [f"warning: {each.message}, {each.filename}:{each.lineno}" for each in warned[:1]]
    difference = changes(before, state(obj))
    new = uvs(obj) if obj.data.uv_layers else None
    said = qh_unwrap.last_report()
    if bpy.context.mode == 'EDIT_MESH':
        bpy.ops.object.mode_set(mode='OBJECT')
    if error:
        if "Traceback" in error or not error.startswith("Error: ") or "please report this" in error:
            wrong.append(f"exception: {error.splitlines()[-1]}")
        if difference:
            wrong.append(f"changed in spite of an error: {sorted(difference)}")
        return wrong, said, seconds, (name, options)
    if difference - {"UVMap"}:
        wrong.append(f"changed: {sorted(difference - {'UVMap'})}")
    if old is not None:
        wrong += _kept(case, obj, name, options, old, new)
        wrong += _signs(case, obj, said, old, new)
    for island in said:
        if "error" not in island and name == "qh_relax" and island["before"] and options["direction"] == "BOTH":
            is_valid = not (island["before"]["flips"] or island["before"]["collapsed"])
            if is_valid and options["balance"] == 0.25 and options["blend"] == 1:
                energies = [island[when]["symmetric_dirichlet"] for when in ("before", "after")]
                if energies[1] > energies[0] * (1 + 1e-5):
                    wrong.append(f"energy rose: {energies}")
    return wrong, said, seconds, (name, options)


def _kept(case, obj, name, options, old, new):
    """What moved that was to stay."""
    face = np.repeat(np.arange(len(case.faces)), [len(each) for each in case.faces])
    moved = (old != new) & ~(np.isnan(old) & np.isnan(new))
    if case.pins is not None and moved[case.pins].any():
        yield "pins moved"
    if name == "qh_relax":
        if case.chosen is not None and moved[~case.chosen[face]].any():
            yield "what is not selected moved"
        if options["direction"] != "BOTH" and moved[:, "VU".index(options["direction"])].any():
            yield "the other coordinate moved"
        if not options["move_outline"] and moved[_on_outline(obj, old)].any():
            yield "an outline moved"


def _on_outline(obj, uv):
    """The corners, (c,) bool, at edges that belong to a single face, whatever the UVs are."""
    mesh = obj.data
    edge = np.array([loop.edge_index for loop in mesh.loops])
    single = np.bincount(edge, minlength=len(mesh.edges))[edge] == 1
    following = np.arange(1, len(edge) + 1)
    for polygon in mesh.polygons:
        following[polygon.loop_start + polygon.loop_total - 1] = polygon.loop_start
    found = single.copy()
    found[following[single]] = True
    return found


def _signs(case, obj, said, old, new):
    """Islands that are said to be certified, and have flipped faces; the winding is that of most of their triangles."""
    mesh = obj.data
    mesh.calc_loop_triangles()
    triangles = np.array([triangle.loops[:] for triangle in mesh.loop_triangles]).reshape(-1, 3)
    face = np.array([triangle.polygon_index for triangle in mesh.loop_triangles])
    for island in said:
        if "error" in island or not island["injective"]:
            continue
        its = triangles[np.isin(face, island["face_indices"])]
        sign = orientation(new[its])
        if (
            (sign > 0).any()
            and (sign < 0).any()
            and not any("inside out" in text or "doubled" in text or "one-sided" in text for text in island["warnings"])
        ):
            yield f"said valid, and {min((sign > 0).sum(), (sign < 0).sum())} flipped"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000)
    arguments = parser.parse_args()
    qh_unwrap.register()
    bpy.ops.wm.read_homefile(use_empty=True)
    kinds, slow, failed, islands, certified = Counter(), [], 0, 0, 0
    for seed in range(arguments.first, arguments.first + arguments.count):
        wrong, said, seconds, how = checked(seed)
        for island in said:
            islands += 1
            certified += bool(island.get("injective"))
            if "error" in island:
                kinds["".join("#" if each.isdigit() else each for each in island["error"])] += 1
        if seconds > 5:
            slow.append((round(seconds, 1), seed))
        if wrong:
            failed += 1
            print(seed, *how, *wrong, sep="\n    ", flush=True)
    print(f"{failed} of {arguments.count} fail; {islands} regions, {certified} certified; slow: {slow}")
    for kind, count in kinds.most_common():
        print(f"{count:6} {kind}")
    qh_unwrap.unregister()
    return failed


if __name__ == "__main__":
    raise SystemExit(min(main(), 1))
