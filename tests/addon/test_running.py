# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work in the window: it shows how far it is, ESC cancels it, and whatever happens, nothing is left behind."""

import bpy  # isort: skip
import gc
import weakref
from types import SimpleNamespace

import bmesh
import numpy as np
import pytest
from scenes import add_cube, add_grid, changes, edit_mode, snapshot, uvs

from qh_unwrap.addon import operators, running, selection, unwrapping
from qh_unwrap.addon.options import MeshOptions
from qh_unwrap.addon.running import InSteps, Run
from qh_unwrap.core import Settings
from qh_unwrap.core import unwrapping as driver

TIMER = SimpleNamespace(type='TIMER', value='NOTHING')
ESC = SimpleNamespace(type='ESC', value='PRESS')


class Window:
    """Stands for the window manager, the window and its workspace, and notes what is going on in them."""

    def __init__(self):
        self.timers, self.operators, self.progress, self.status = [], [], None, None

    def event_timer_add(self, _interval, window):
        assert window is self
        self.timers.append(object())
        return self.timers[-1]

    def event_timer_remove(self, timer):
        self.timers.remove(timer)

    def modal_handler_add(self, operator):
        self.operators.append(operator)

    def progress_begin(self, low, high):
        assert (low, high, self.progress) == (0, 1, None)
        self.progress = 0.0

    def progress_update(self, share):
        assert self.progress <= share <= 1
        self.progress = share

    def progress_end(self):
        assert self.progress is not None
        self.progress = None

    def status_text_set(self, text):
        self.status = text

    @property
    def is_clean(self):
        return not self.timers and self.progress is None and self.status is None


class Context:
    """Blender's context, with a window."""

    def __init__(self):
        self.window = self.window_manager = self.workspace = Window()

    def __getattr__(self, name):
        return getattr(bpy.context, name)


class Unwrapping(operators.OnSelectedFaces):
    """The operator, as far as it runs without Blender's own part of it."""

    begin, finish = operators.QH_OT_unwrap.begin, operators.QH_OT_unwrap.finish

    def __init__(self, settings=None, options=None):
        self.reports = []
        self.settings, self.mesh_options = lambda: settings or Settings(), lambda: options or MeshOptions()

    def report(self, kind, text):
        self.reports.append((kind, text))


@pytest.fixture
def slow(monkeypatch):
    """Every step takes longer than the moment that it has."""
    monkeypatch.setattr(running, "_AT_ONCE", 0)
    monkeypatch.setattr(running, "_SLICE", 0)
    monkeypatch.setattr(running, "_DRAWS", 0)


@pytest.fixture(autouse=True)
def _no_outcomes():
    operators.last_outcomes.clear()


@pytest.fixture(autouse=True)
def _one_by_one(monkeypatch):
    """Islands are unwrapped one by one, however small."""
    monkeypatch.setattr(driver, "_TOGETHER", 0)


def begun(**arguments):
    """An operator that has been invoked, and is not finished."""
    operator, context = Unwrapping(**arguments), Context()
    assert operator.invoke(context, None) == {'RUNNING_MODAL'}
    assert context.window.operators == [operator] and len(context.window.timers) == 1
    return operator, context


def scene():
    """Two objects in Edit Mode, with everything on them that could get lost."""
    objects = add_grid(8, "One"), add_grid(6, "Other", uv=False, location=(3, 0, 0))
    edit_mode(lambda _, face: face % 7)
    bm = bmesh.from_edit_mesh(objects[0].data)
    bm.faces.ensure_lookup_table()
    bm.faces[4].hide_set(True)
    bm.faces.active = bm.faces[9]
    for loop in bm.faces[11].loops:
        loop[bm.loops.layers.uv.active].pin_uv = True
    bmesh.update_edit_mesh(objects[0].data)
    bpy.context.scene.tool_settings.use_uv_select_sync = False
    bpy.context.scene.qh_unwrap.iterations = 9
    return objects


def everything(objects):
    tools = bpy.context.scene.tool_settings
    return [snapshot(obj) for obj in objects] + [
        bpy.context.mode,
        tools.use_uv_select_sync,
        tuple(tools.mesh_select_mode),
        bpy.context.scene.qh_unwrap.as_keywords(),
        [len(getattr(bpy.data, kind)) for kind in ("meshes", "objects", "scenes", "images", "materials")],
        bpy.context.view_layer.objects.active,
        list(bpy.context.selected_objects),
    ]


# The state alone


def test_advances_for_a_moment_at_a_time(monkeypatch):
    clock = iter(range(100))
    monkeypatch.setattr(running, "perf_counter", lambda: next(clock))

    def steps():
        yield from (0.1, 0.2, 0.3, 0.4, 0.5)
        return "done"

    run = Run(steps())
    assert not run.advance(2) and run.share == 0.2
    assert not run.advance(0) and run.share == 0.3, "one step at least"
    assert run.result is None
    assert run.advance(50) and (run.share, run.result) == (1, "done")


def test_share_grows_to_one():
    add_grid(8, "Large")
    add_grid(3, "Small", location=(3, 0, 0))
    add_cube()
    for obj in bpy.context.scene.objects:
        obj.select_set(True)
    targets = selection.targets(bpy.context)
    settings = Settings(refine=0, tolerance=0)
    shares = list(unwrapping.unwrap_targets(targets, settings, MeshOptions(), bpy.context))
    assert len(targets) == 3 and shares == sorted(shares) and shares[0] == 0 and shares[-1] == 1
    assert len(np.unique(shares)) > 8


def test_cancelled_state_runs_no_more_and_frees_what_it_held():
    obj = add_grid(8)
    before = snapshot(obj)
    run = Run(unwrapping.unwrap_targets(selection.targets(bpy.context), Settings(), MeshOptions(), bpy.context))
    for _ in range(4):
        assert not run.advance(0)
    works = run._steps.gi_frame.f_locals["works"]
    held = weakref.ref(works[0].island)
    assert held() is not None
    del works
    run.cancel()
    gc.collect()
    assert held() is None
    assert not changes(before, snapshot(obj))


# The operator


@pytest.mark.parametrize("placement", ['ORIGINAL', 'PACK'])
def test_finishes_as_if_it_were_executed(slow, placement):
    objects = scene()
    start = everything(objects)
    options = MeshOptions(placement=placement)
    operator, context = begun(options=options)
    states = []
    while (result := operator.modal(context, TIMER)) == {'RUNNING_MODAL'}:
        assert everything(objects) == start, "nothing is written before the end"
        states.append(context.window.status)
    assert result == {'FINISHED'} and context.window.is_clean and operator._run is None
    assert len(states) > 5 and len(set(states)) > 5
    assert all(text.startswith("QH Unwrap: ") and text.endswith(" % — Esc cancels") for text in states)
    found = [uvs(obj) for obj in objects]

    bpy.ops.wm.read_homefile(use_empty=True)
    objects, executed = scene(), Unwrapping(options=options)
    assert executed.execute(Context()) == {'FINISHED'}
    assert executed.reports == operator.reports and len(operator.reports) >= 1
    for one, obj in zip(found, objects, strict=True):
        assert np.array_equal(one, uvs(obj))


def test_short_work_ends_at_once():
    obj = add_grid(4)
    before = uvs(obj)
    operator, context = Unwrapping(), Context()
    assert operator.invoke(context, None) == {'FINISHED'}
    assert context.window.is_clean and not context.window.operators
    assert not np.array_equal(before, uvs(obj)) and len(operators.last_outcomes) == 1


@pytest.mark.parametrize("steps", [0, 1, 5, "all"])
def test_esc_cancels_and_changes_nothing(slow, steps):
    objects = scene()
    start = everything(objects)
    operator, context = begun()
    if steps == "all":
        while context.window.progress < 1:
            operator.modal(context, TIMER)
    else:
        for _ in range(steps):
            operator.modal(context, TIMER)
    assert operator.modal(context, ESC) == {'CANCELLED'}
    assert operator.reports == [({'INFO'}, "Cancelled: nothing was changed")]
    assert context.window.is_clean and operator._run is None
    assert everything(objects) == start
    assert not operators.last_outcomes
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}, "and it can be done again"


def test_window_is_drawn_before_the_work_goes_on(slow, monkeypatch):
    monkeypatch.setattr(running, "_DRAWS", 2)
    add_grid(4)
    operator, context = begun()
    worked = []
    monkeypatch.setattr(Run, "advance", lambda _run, seconds: worked.append(seconds))
    for expected in (0, 0, 1, 2):
        assert operator.modal(context, TIMER) == {'RUNNING_MODAL'}
        assert len(worked) == expected
    operator.cancel(context)


def test_swallows_everything_else(slow):
    add_grid(4)
    operator, context = begun()
    share = context.window.progress
    for kind in ('LEFTMOUSE', 'RIGHTMOUSE', 'MOUSEMOVE', 'WHEELUPMOUSE', 'TAB', 'G', 'Z', 'TIMER_AUTOSAVE'):
        assert operator.modal(context, SimpleNamespace(type=kind, value='PRESS')) == {'RUNNING_MODAL'}
    assert operator.modal(context, SimpleNamespace(type='ESC', value='RELEASE')) == {'RUNNING_MODAL'}
    assert context.window.progress == share, "and does no work for it"
    assert operator.modal(context, ESC) == {'CANCELLED'}


def test_small_islands_are_done_together_and_can_be_cancelled(slow, monkeypatch):
    monkeypatch.setattr(driver, "_TOGETHER", 8)
    monkeypatch.setattr(driver, "_AT_ONCE", 16)
    sizes, original = [], driver.Unwrapper
    monkeypatch.setattr(driver, "Unwrapper", lambda shapes, *rest: sizes.append(len(shapes)) or original(shapes, *rest))
    obj = add_grid(6, uv=False)
    for edge in obj.data.edges:  # every face an island
        edge.use_seam = True
    start = everything([obj])
    operator, context = begun()
    shares = []
    for _ in range(4):
        operator.modal(context, TIMER)
        shares.append(context.window.progress)
    assert len(set(shares)) > 2 and set(sizes) == {8}
    assert operator.modal(context, ESC) == {'CANCELLED'}
    assert context.window.is_clean and everything([obj]) == start
    assert bpy.ops.uv.qh_unwrap() == {'FINISHED'}
    assert len(operators.last_outcomes) == 36 and all(outcome.is_clean for outcome in operators.last_outcomes)


def failing(monkeypatch, error, vertices=None):
    """Sessions of islands with so many vertices, or of all, break off after two parts of steps."""
    original = driver.Unwrapper.parts

    def parts(session):
        sizes = [len(uv) for uv in np.split(session._course.now, session._course.batch.surface.vertex_starts[1:])]
        for taken, part in enumerate(original(session)):
            if taken > 1 and (vertices is None or vertices in sizes):
                raise error
            yield part

    monkeypatch.setattr(driver.Unwrapper, "parts", parts)


@pytest.mark.parametrize("together", [0, 5000])
@pytest.mark.parametrize("start", ["execute", "invoke"])
def test_exception_fails_the_island_alone(slow, monkeypatch, start, together, capsys):
    monkeypatch.setattr(driver, "_TOGETHER", together)
    add_grid(4, "One")
    add_grid(3, "Other", location=(3, 0, 0))
    failing(monkeypatch, ZeroDivisionError("by zero"), 25)
    if start == "execute":
        operator, context = Unwrapping(), Context()
        result = operator.execute(context)
    else:
        operator, context = begun()
        while (result := operator.modal(context, TIMER)) == {'RUNNING_MODAL'}:
            pass
    assert result == {'FINISHED'} and context.window.is_clean
    one, other = operators.last_outcomes
    assert "ZeroDivisionError: by zero" in one.error and other.is_clean
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("start", ["execute", "invoke"])
def test_exception_in_every_island_leaves_nothing_behind(slow, monkeypatch, start):
    objects = scene()
    before = everything(objects)
    failing(monkeypatch, ZeroDivisionError("by zero"))
    if start == "execute":
        operator, context = Unwrapping(), Context()
        assert operator.execute(context) == {'CANCELLED'}
    else:
        operator, context = begun()
        while (result := operator.modal(context, TIMER)) == {'RUNNING_MODAL'}:
            pass
        assert result == {'CANCELLED'}
    assert all("ZeroDivisionError" in outcome.error for outcome in operators.last_outcomes)
    assert context.window.is_clean and operator._run is None
    assert everything(objects) == before


@pytest.mark.parametrize("start", ["execute", "invoke"])
def test_exception_beside_the_islands_leaves_nothing_behind(slow, monkeypatch, start, capsys):
    objects = scene()
    before = everything(objects)

    def broken(*_arguments):
        yield 0.5
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(unwrapping, "unwrap_variously", broken)
    if start == "execute":
        operator, context = Unwrapping(), Context()
        with pytest.raises(ZeroDivisionError):
            operator.execute(context)
    else:
        operator, context = begun()
        while (result := operator.modal(context, TIMER)) == {'RUNNING_MODAL'}:
            pass
        assert result == {'CANCELLED'}
        assert operator.reports == [({'ERROR'}, "ZeroDivisionError: by zero")]
        assert "Traceback" in capsys.readouterr().err
    assert context.window.is_clean and operator._run is None
    assert everything(objects) == before


@pytest.mark.parametrize("together", [0, 5000])
def test_memory_that_runs_out_fails_the_island_alone(slow, monkeypatch, together):
    monkeypatch.setattr(driver, "_TOGETHER", together)
    add_grid(4, "One")
    add_grid(3, "Other", location=(3, 0, 0))
    failing(monkeypatch, MemoryError(), 25)
    operator, context = begun()
    while (result := operator.modal(context, TIMER)) == {'RUNNING_MODAL'}:
        pass
    assert result == {'FINISHED'} and context.window.is_clean
    one, other = operators.last_outcomes
    assert "the memory ran out" in one.error and not other.error


def test_window_that_is_closed_cancels(slow):
    objects = scene()
    start = everything(objects)
    operator, context = begun()
    operator.modal(context, TIMER)
    operator.cancel(context)
    assert context.window.is_clean and operator._run is None
    assert everything(objects) == start
    operator.cancel(context)
    assert context.window.is_clean, "a second time does no harm"


def topology(obj):
    bm = bmesh.from_edit_mesh(obj.data)
    bmesh.ops.subdivide_edges(bm, edges=bm.edges[:1], cuts=1)
    bmesh.update_edit_mesh(obj.data)


def existence(obj):
    bpy.ops.object.mode_set(mode='OBJECT')
    bpy.data.objects.remove(obj)


@pytest.mark.parametrize("change", [topology, existence])
def test_mesh_that_another_window_changed_is_left_alone(slow, change):
    one, other = scene()
    operator, context = begun()
    operator.modal(context, TIMER)
    change(other)
    before = snapshot(one)
    while (result := operator.modal(context, TIMER)) == {'RUNNING_MODAL'}:
        pass
    assert result == {'CANCELLED'} and context.window.is_clean
    ((kind, text),) = operator.reports
    assert kind == {'ERROR'} and "a mesh was changed meanwhile: unwrap again" in text
    assert not changes(before, snapshot(one))


@pytest.mark.parametrize("start", ["execute", "invoke"])
def test_nothing_to_do_starts_nothing(start):
    add_grid(3)
    edit_mode(lambda *_: False)
    operator, context = Unwrapping(), Context()
    run = {"execute": lambda: operator.execute(context), "invoke": lambda: operator.invoke(context, None)}
    assert run[start]() == {'CANCELLED'}
    assert operator.reports == [({'ERROR'}, "No faces are selected")]
    assert context.window.is_clean and not context.window.operators


def test_operator_has_all_that_blender_calls():
    for name in ("execute", "invoke", "modal", "cancel"):
        assert callable(getattr(operators.QH_OT_unwrap, name))
    assert operators.QH_OT_unwrap.modal is InSteps.modal
