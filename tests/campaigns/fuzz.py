# SPDX-License-Identifier: GPL-3.0-or-later
"""Unwrap thousands of random meshes in Blender, and judge what is stored by a checker of its own; needs bpy.

    python -m tests.campaigns.fuzz [--number 3000] [--first SEED] [--only SEED] [--shrink]

Every mesh is made by NumPy's generator from a seed of its own, not by Hypothesis: so each of thousands can be made
again by its number alone, whichever came before it and whatever the version of Hypothesis.  What that does to make a
failure small, `--shrink` does with meshes in mind: fewer faces, seams and pins, plainer settings, rounder numbers.

What is checked of every mesh:

1. There is no exception and no warning of NumPy; an error is a plain sentence, and then nothing was changed.
2. Unwrapped faces have finite UVs.
3. Nothing but the UVs of the chosen faces was changed, and of islands with an error not even these.
4. The map of an island that was valid is valid, where its boundary is free or kept.
5. A certificate is true, of Blender's own triangles and exactly, and where there is none, flips are not kept secret.
6. At least 99 % of the islands that are sound disks without pins, and have a free outline, are certified.
7. Islands are those that seams, selection and crowded edges bound; and pins stay.

Exit status 1 if any check failed.  The rest that is printed, such as disks with holes that are not certified, is to be
looked at.
"""

import bpy  # isort: skip  (the wheel knows bmesh only after this)
import argparse
import os
import re
import sys
import time
import traceback
import warnings
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field

import bmesh
import numpy as np

import qh_unwrap
from qh_unwrap.addon import operators

from ..addon.scenes import changes, snapshot, uvs
from .judging import Surface
from .meshes import EARLIER, NEW, Case, moved, random_case
from .shrinking import shrunk, written

FEWEST_DISKS = 0.99  # of the sound disks without pins, at least so many are certified
SLOW = 5.0  # seconds, from which on a mesh is named
DISK, HOLED = "disk not certified", "disk with holes not certified"
CLEAN = "clean, but not certified"


@dataclass
class Verdict:
    """What there is to say of one mesh."""

    failures: list = field(default_factory=list)  # of a kind and a text
    uncertified: list = field(default_factory=list)  # islands that should be: a kind and a text for each
    errors: list = field(default_factory=list)  # of islands, and of the operator
    islands: int = 0
    certified: int = 0
    valid: int = 0  # maps that were so before, and have to stay so
    disks: Counter = field(default_factory=Counter)  # with a free outline and without pins
    seconds: float = 0.0  # in the operator

    def fail(self, kind, text):
        self.failures.append((kind, text))

    def kinds(self):
        return {kind for kind, _ in self.failures + self.uncertified}


@contextmanager
def silence():
    """What Blender and its operators print goes nowhere."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, copy in enumerate(kept, start=1):
            os.dup2(copy, number)
            os.close(copy)


def built(case):
    """The case's object, alone, in its mode."""
    if bpy.context.object and bpy.context.object.mode != 'OBJECT':
        bpy.ops.object.mode_set(mode='OBJECT')
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes])
    mesh = bpy.data.meshes.new("Case")
    mesh.from_pydata(np.asarray(case.points, float).tolist(), [], case.faces)
    mesh.update(calc_edges=True)
    seams = {frozenset(pair) for pair in case.seams}
    mesh.edges.foreach_set("use_seam", [frozenset(edge.vertices) in seams for edge in mesh.edges])
    obj = bpy.data.objects.new("Case", mesh)
    obj.scale = case.scale
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    if case.uv is not None:
        mesh.uv_layers.new(name="UVMap")
        if case.uv is not NEW:
            mesh.uv_layers["UVMap"].uv.foreach_set("vector", np.asarray(case.uv, np.float32).ravel())
        if case.pins is not None:
            mesh.attributes.new(".pn.UVMap", 'BOOLEAN', 'CORNER').data.foreach_set("value", case.pins)
    if case.decorated:
        _decorate(mesh)
    bpy.context.view_layer.update()
    if case.chosen is not None:
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.context.tool_settings.mesh_select_mode = (False, False, True)
        bpy.ops.mesh.select_all(action='DESELECT')
        bm = bmesh.from_edit_mesh(mesh)
        for face, its in zip(bm.faces, case.chosen.tolist(), strict=True):
            face.select_set(its)
        bmesh.update_edit_mesh(mesh)
    return obj


def _decorate(mesh):
    """Other data of all kinds, which has to stay as it is."""
    dice = np.random.default_rng(len(mesh.loops))
    if mesh.uv_layers:
        other = mesh.uv_layers.new(name="Other")
        other.uv.foreach_set("vector", dice.random(2 * len(mesh.loops)).astype(np.float32))
        mesh.uv_layers.active_index = 0
    for kind, domain in (('FLOAT', 'POINT'), ('INT', 'FACE'), ('FLOAT_COLOR', 'CORNER')):
        mesh.attributes.new(f"of each {domain}", kind, domain)
    mesh.attributes["of each FACE"].data.foreach_set("value", np.arange(len(mesh.polygons), dtype=np.int32))
    sharp = dice.random(len(mesh.edges)) < 0.2
    mesh.edges.foreach_set("use_edge_sharp", sharp)
    mesh.polygons.foreach_set("use_smooth", dice.random(len(mesh.polygons)) < 0.7)
    normals = dice.normal(size=(len(mesh.loops), 3))
    mesh.normals_split_custom_set(normals / np.linalg.norm(normals, axis=1)[:, None])


def surface(obj, chosen):
    """The object's mesh, in Object Mode, as the judge looks at it."""
    mesh = obj.data
    mesh.calc_loop_triangles()

    def read(collection, name, kind, width=1):
        values = np.empty(len(collection) * width, kind)
        collection.foreach_get(name, values)
        return values.reshape(-1, width) if width > 1 else values

    points = read(mesh.vertices, "co", np.float32, 3).astype(float)
    return Surface(
        points=points @ np.array(obj.matrix_world.to_3x3(), float).T,
        corner_vertex=read(mesh.loops, "vertex_index", np.int32).tolist(),
        corner_edge=read(mesh.loops, "edge_index", np.int32).tolist(),
        face_start=[*read(mesh.polygons, "loop_start", np.int32).tolist(), len(mesh.loops)],
        seam=read(mesh.edges, "use_seam", bool),
        triangles=read(mesh.loop_triangles, "loops", np.int32, 3),
        triangle_face=read(mesh.loop_triangles, "polygon_index", np.int32),
        chosen=chosen,
    )


def state(obj):
    """All that must not change, but for UVs."""
    kinds = ("meshes", "objects", "scenes", "materials", "images")
    return snapshot(obj) | {
        "transform": np.array(obj.matrix_world).tobytes(),
        "maps": [(layer.name, layer.active_render) for layer in obj.data.uv_layers],
        "active": bpy.context.view_layer.objects.active.name,
        "data": [len(getattr(bpy.data, kind)) for kind in kinds],
        "custom normals": obj.data.has_custom_normals,
        "select mode": tuple(bpy.context.tool_settings.mesh_select_mode),
    }


def call(case):
    """Call the operator; returns its error, if it has one."""
    try:
        with silence():
            if case.in_editor:
                with bpy.context.temp_override(**_uv_editor()):
                    bpy.ops.uv.qh_unwrap(**case.settings)
            else:
                bpy.ops.uv.qh_unwrap(**case.settings)
    except RuntimeError as error:
        return str(error).strip()
    return ""


def _uv_editor():
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.ui_type = 'UV'
    region = next(region for region in area.regions if region.type == 'WINDOW')
    bpy.context.scene.tool_settings.use_uv_select_sync = True
    return dict(window=window, area=area, region=region)


def settled(case):
    """The case with numbers for the UVs of an earlier unwrap."""
    if case.uv is not EARLIER:
        return case
    obj = built(case.changed(uv=None, pins=None, chosen=None, in_editor=False, decorated=False, settings={}))
    call(Case(case.points, case.faces))
    if not obj.data.uv_layers:
        return case.changed(uv=NEW)
    uv = uvs(obj).copy()
    return case.changed(uv=uv if case.moved is None else moved(uv, case.moved), moved=None)


def judged(case):
    """Build the case's mesh, unwrap it, and say what there is to say of it."""
    verdict = Verdict()
    obj = built(case)
    everything = np.ones(len(case.faces), bool)
    chosen = everything if case.chosen is None else case.chosen
    operators.last_outcomes.clear()
    before, old = state(obj), uvs(obj) if obj.data.uv_layers else None
    started = time.perf_counter()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        error = call(case)
    verdict.seconds = time.perf_counter() - started
    where = [f"{each.category.__name__}: {each.message}, {each.filename}:{each.lineno}" for each in warned]
    if where:
        verdict.fail("warning", f"{where[0]}, and {len(where) - 1} more")
    difference = changes(before, state(obj))
    new = uvs(obj) if obj.data.uv_layers else None
    if case.chosen is not None and obj.mode == 'EDIT':
        bpy.ops.object.mode_set(mode='OBJECT')
    if error:
        if not qh_unwrap.last_report():
            verdict.errors.append(error)
        if not error.startswith("Error: ") or "Traceback" in error:
            verdict.fail("exception", error.splitlines()[-1] if "Traceback" not in error else _last_line(error))
        if difference:
            verdict.fail("changed in spite of an error", ", ".join(sorted(difference)))
        _note_errors(verdict, qh_unwrap.last_report())
        return verdict
    _judge(verdict, case, surface(obj, chosen), old, new, difference)
    return verdict


def _last_line(error):
    lines = [line for line in error.splitlines() if line.strip() and not line.startswith(("Location", "Error: "))]
    return lines[-1]


def _note_errors(verdict, report):
    for island in report:
        if "error" in island:
            verdict.errors.append(island["error"])
            if "report this" in island["error"]:
                verdict.fail("internal error", island["error"])


def _judge(verdict, case, mesh, old, new, difference):
    report = qh_unwrap.last_report()
    verdict.islands = len(report)
    _note_errors(verdict, report)
    if old is None:
        # Blender 5 makes the selection of UVs with the map.
        expected = {"UVMap", "active UV map", "maps", ".uv_select_vert", ".uv_select_edge", ".uv_select_face"}
    else:
        expected = {"UVMap"}
    if difference - expected:
        verdict.fail("changed", ", ".join(sorted(difference - expected)))
    done = [island for island in report if "error" not in island]
    written_to = {face for island in done for face in island["face_indices"]}
    stayed = [c for face in range(len(mesh.chosen)) if face not in written_to for c in mesh.corners_of(face)]
    if old is not None and not np.array_equal(old[stayed].view(np.int32), new[stayed].view(np.int32)):
        verdict.fail("changed", "UVs of faces that are not unwrapped")
    mine = sorted(map(sorted, mesh.islands))
    theirs = sorted(sorted(island["face_indices"]) for island in report)
    if mine != theirs:
        verdict.fail("other islands", f"{len(theirs)} instead of {len(mine)}")
    for island in done:
        _judge_island(verdict, case, mesh, island, old, new)


def _judge_island(verdict, case, mesh, island, old, new):
    faces, certified = island["face_indices"], island["injective"]
    name = f"island {island['island']} ({len(faces)} faces)"
    corners = [c for face in faces for c in mesh.corners_of(face)]
    boundary = case.settings.get("boundary", 'FREE')
    verdict.certified += certified
    if not np.isfinite(new[corners]).all():
        verdict.fail("not finite", name)
        return
    after = island["after"]
    if not (certified or after["flips"] or after["collapsed"]):
        wrong = mesh.flips(faces, new)
        if wrong:
            verdict.fail("hidden flips", f"{name}: {wrong} of which nothing is said")
    if case.pins is not None and boundary in ('FREE', 'KEEP'):
        pinned = [c for face in faces if face not in mesh.twins for c in mesh.corners_of(face) if case.pins[c]]
        if (old[pinned] != new[pinned]).any():
            verdict.fail("moved pins", name)
    if old is not None and boundary in ('FREE', 'KEEP') and not mesh.why_invalid(faces, old):
        is_joined = mesh.is_joined(faces, old)
        if is_joined or not mesh.is_cut_alike(faces):
            verdict.valid += 1
            why = mesh.why_invalid(faces, new)
            if why:
                kind = f"valid map spoilt, {boundary}{'' if is_joined else ', where it was cut'}{_unusual(case)}"
                verdict.fail(kind, f"{name}: {why}; says {_said(island)}")
    if certified:
        for kind, text in mesh.why_uncertain(faces, new):
            verdict.fail(f"false certificate: {kind}", f"{name}: {text}")
    is_held = (case.pins is not None and case.pins[corners].any()) or (case.in_editor and old is not None)
    holes = mesh.holes(faces) if boundary == 'FREE' and not is_held else None
    if holes is not None:
        kind = HOLED if holes else DISK
        verdict.disks[kind] += 1
        if not certified:
            why = [fault for fault, _ in mesh.why_uncertain(faces, new)]
            text = f"{name}, {holes} holes{_unusual(case)}: {', '.join(why)}; says {_said(island)}"
            verdict.uncertified.append((kind, text))
    if not certified and not mesh.why_uncertain(faces, new):
        verdict.uncertified.append((CLEAN, f"{name}{_unusual(case)}: {_said(island)}"))


def _unusual(case):
    """What of the settings lets a map be worse."""
    names = ("initial", "weights", "iterations", "refine", "repair", "balance")
    return "".join(f", {name} {case.settings[name]}" for name in names if name in case.settings)


def _said(island):
    after = island["after"]
    return f"{after['flips']} flips, {after['collapsed']} collapsed, {island['warnings']}"


def checked(seed):
    """The verdict on a seed's mesh, and the case."""
    case = None
    try:
        case = settled(random_case(seed))
        return judged(case), case
    except Exception:
        verdict = Verdict()
        verdict.fail("exception in the campaign", traceback.format_exc().strip().replace("\n", " | ")[-500:])
        return verdict, case


class Tally:
    """What was found in all meshes."""

    def __init__(self):
        self.started = time.perf_counter()
        self.total, self.kinds, self.errors = Counter(), Counter(), Counter()
        self.failures, self.others = [], []  # of a seed, a kind and a text

    def add(self, seed, case, verdict):
        self.total.update(meshes=1, faces=len(case.faces) if case else 0, islands=verdict.islands)
        self.total.update(certified=verdict.certified, valid=verdict.valid)
        self.total.update(verdict.disks)
        self.total.update(f"not: {kind}" for kind, _ in verdict.uncertified)
        self.kinds.update(verdict.kinds())
        self.errors.update(_kind(error) for error in verdict.errors)
        self.failures += [(seed, *failure) for failure in verdict.failures]
        self.others += [(seed, *other) for other in verdict.uncertified]
        if verdict.seconds > SLOW:
            self.others.append((seed, "slow", f"{verdict.seconds:.1f} s for {len(case.faces)} faces"))

    @property
    def seconds(self):
        return time.perf_counter() - self.started

    def share(self, kind):
        """Of the disks of a kind, how many are certified."""
        return 1 - self.total[f"not: {kind}"] / max(self.total[kind], 1)

    @property
    def passed(self):
        return not self.failures and self.share(DISK) >= FEWEST_DISKS

    def show(self):
        for word, found in (("FAILED", self.failures), ("      ", self.others)):
            for seed, kind, text in found:
                print(f"{word} seed {seed}: {kind}: {text}")
        total = self.total
        print(f"\n{total['meshes']} meshes with {total['faces']} faces, {self.seconds:.0f} s")
        print(f"{total['islands']} islands, {total['certified']} of them certified")
        print(f"{total['valid']} of them had a valid map before, which they must not lose")
        print(f"{total[DISK]} sound disks without pins and with a free outline, {self.share(DISK):.2%} certified")
        print(f"{total[HOLED]} such disks with holes, {self.share(HOLED):.2%} certified")
        for title, counts in (("Meshes by kind of failure or shortcoming", self.kinds), ("Errors", self.errors)):
            print(f"{title}:{'' if counts else ' none'}")
            for kind, count in counts.most_common():
                print(f"{count:7}  {kind}")


def campaign(seeds, shrink):
    """Judge the meshes of all seeds; returns whether no check failed."""
    tally = Tally()
    for number, seed in enumerate(seeds, start=1):
        verdict, case = checked(seed)
        tally.add(seed, case, verdict)
        if shrink and case:
            for kind in sorted(verdict.kinds()):
                small = shrunk(case, lambda each, kind=kind: kind in _kinds(each))
                print(f"seed {seed}, {kind}:\n{written(small)}", flush=True)
        if number % 100 == 0:
            print(f"{number} meshes, {len(tally.failures)} failures, {tally.seconds:.0f} s", flush=True)
    tally.show()
    return tally.passed


def _kinds(case):
    try:
        return judged(case).kinds()
    except Exception:  # such a mesh cannot be made
        return set()


def _kind(error):
    """The same for errors that differ in their numbers alone."""
    return re.sub(r"[\d.]*\d", "#", error.removeprefix("Error: ").splitlines()[0])[:150]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--number", type=int, default=3000, help="of meshes (default: 3000)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed (default: 0)")
    parser.add_argument("--only", type=int, metavar="SEED", help="one mesh alone")
    parser.add_argument("--shrink", action="store_true", help="make failures small, and print them as Python")
    arguments = parser.parse_args()
    first, number = (arguments.first, arguments.number) if arguments.only is None else (arguments.only, 1)
    bpy.ops.wm.read_homefile(use_empty=True)
    qh_unwrap.register()
    try:
        passed = campaign(range(first, first + number), arguments.shrink)
    finally:
        qh_unwrap.unregister()  # Blender 4.5 hangs at its exit if a class is still registered
    sys.exit(not passed)


if __name__ == "__main__":
    main()
