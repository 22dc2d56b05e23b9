# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work that stays in hand: scripts get it done at once, people see how far it is and can cancel it with ESC."""

import traceback
from time import perf_counter

_AT_ONCE = 0.5  # seconds: what takes no longer ends before anyone could look
_DRAWS = 2  # of the window before the work goes on: in the first, the menu still stands there
_SLICE = 0.1  # seconds of work between two looks at what the person does


class Run:
    """A generator on its way, which yields the share that is done, from 0 to 1, and returns the `result`."""

    def __init__(self, steps):
        self._steps = steps
        self.share = 0.0
        self.result = None

    def advance(self, seconds):
        """Work for that long, at least one step; returns whether it is finished."""
        end = perf_counter() + seconds
        try:
            while True:
                self.share = next(self._steps)
                if perf_counter() >= end:
                    return False
        except StopIteration as stop:
            self.share, self.result = 1.0, stop.value
            return True

    def cancel(self):
        """Stop where it is, for good; what the generator holds is freed."""
        self._steps.close()


class InSteps:
    """Mix-in for an operator that works in steps.

    It has `begin(context)`, which returns the generator, or None once it reported why there is nothing to do, and
    `finish(result)`, which reports and returns what the operator returns.
    """

    _run = _timer = None
    _undrawn = 0

    def execute(self, context):
        steps = self.begin(context)
        if steps is None:
            return {'CANCELLED'}
        run = Run(steps)
        context.window_manager.progress_begin(0, 1)
        try:
            while not run.advance(_SLICE):
                context.window_manager.progress_update(run.share)
        finally:
            context.window_manager.progress_end()
        return self.finish(run.result)

    def invoke(self, context, _event):
        steps = self.begin(context)
        if steps is None:
            return {'CANCELLED'}
        run = Run(steps)
        if run.advance(_AT_ONCE):
            return self.finish(run.result)
        window_manager = context.window_manager
        self._undrawn = _DRAWS
        self._run, self._timer = run, window_manager.event_timer_add(0.01, window=context.window)
        window_manager.progress_begin(0, 1)
        window_manager.modal_handler_add(self)
        self._show(context)
        return {'RUNNING_MODAL'}

    def modal(self, context, event):
        """Swallows every event, so that nothing can be edited under the work."""
        if event.type == 'ESC' and event.value == 'PRESS':
            self._end(context)
            self.report({'INFO'}, "Cancelled: nothing was changed")
            return {'CANCELLED'}
        if event.type != 'TIMER':
            return {'RUNNING_MODAL'}
        if self._undrawn:
            self._undrawn -= 1
            self._show(context)
            return {'RUNNING_MODAL'}
        try:
            finished = self._run.advance(_SLICE)
        except Exception as error:  # Blender would take it for finished, and make a step to undo
            self._end(context)
            traceback.print_exc()
            self.report({'ERROR'}, f"{type(error).__name__}: {error}")
            return {'CANCELLED'}
        if not finished:
            self._show(context)
            return {'RUNNING_MODAL'}
        result = self._run.result
        self._end(context)
        return self.finish(result)

    def cancel(self, context):
        """Blender closes the window or loads another file."""
        if self._run is not None:
            self._end(context)

    def _show(self, context):
        context.window_manager.progress_update(self._run.share)
        context.workspace.status_text_set(f"QH Unwrap: {100 * self._run.share:.0f} % — Esc cancels")

    def _end(self, context):
        """Leave nothing behind."""
        self._run.cancel()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        self._run = self._timer = None  # Blender keeps the operator for its history
