# SPDX-License-Identifier: GPL-3.0-or-later
"""The heatmap while it is on: which objects have it, and how it follows them.

It is drawn over the editors and is nowhere in the file: no material, attribute, shading or overlay is touched.  So
there is nothing to restore, whatever is undone, saved or loaded meanwhile.
"""

from time import perf_counter

import bpy

from . import evaluated, heat
from .options import HeatSettings

_LONGEST_PAUSE = 1.0  # second between two looks at what has changed


class Entry:
    """An object with the heatmap.  Undo makes objects anew, so it is known by a number that stays."""

    def __init__(self, obj):
        self.name, self.uid = obj.name, obj.session_uid
        self.shown = self.heat = None
        self.colours = None  # (t, 3)
        self.is_stale = True
        self.drawn = {}  # what the graphics card has got of it; the drawing fills it

    def find(self):
        """The object, None if it is not there any more."""
        obj = bpy.data.objects.get(self.name)
        if obj is None or obj.session_uid != self.uid:  # renamed, or a namesake from another library
            obj = next((each for each in bpy.data.objects if each.session_uid == self.uid), None)
        if obj is not None:
            self.name = obj.name
        return obj


class Heatmap:
    """The one heatmap."""

    def __init__(self):
        self.entries, self.legend = [], None
        self._coloured_by = self._handles = None
        self.again = self.refresh  # one and the same function each time, as timers need it
        self._seconds = 0.0  # that the latest refresh took

    @property
    def is_on(self):
        return bool(self.entries)

    def turn_on(self, objects, drawing):
        """Show it on these objects; `drawing` is a function that adds the editors' handlers and returns one that
        removes them."""
        self.turn_off()
        self.entries = [Entry(obj) for obj in objects]
        self._handles = drawing(self)
        for handlers, function in _HANDLERS:
            handlers.append(function)
        self.refresh()

    def turn_off(self):
        if self.is_on:
            for handlers, function in _HANDLERS:
                handlers.remove(function)
            if bpy.app.timers.is_registered(self.again):
                bpy.app.timers.unregister(self.again)
            self._handles()
            self.__init__()
            redraw()

    def look_again(self, which=None):
        """Have entries, all if none is told, measured anew soon: not at once, since changes come in swarms."""
        for entry in self.entries if which is None else which:
            entry.is_stale = True
        if not bpy.app.timers.is_registered(self.again):
            bpy.app.timers.register(self.again, first_interval=min(self._seconds, _LONGEST_PAUSE))

    def refresh(self):
        """Measure anew what has changed."""
        begun = perf_counter()
        layers = {window.view_layer: None for window in bpy.context.window_manager.windows}
        for entry in self.entries:
            obj = entry.find() if entry.is_stale else None
            layer = next((each for each in layers if obj is not None and obj.name in each.objects), None)
            if layer is None or obj.type != 'MESH':  # it may have been converted
                continue
            layer.update()
            shown = evaluated.read(obj, layer)
            entry.is_stale = False
            if not shown.is_like(entry.shown):
                entry.shown, entry.heat = shown, heat.measured(shown)
                self._coloured_by = None
        self._seconds = perf_counter() - begun
        redraw()

    def colour(self, settings):
        """Give the entries colours by the settings, unless they have them."""
        if settings == self._coloured_by:
            return
        measured = [entry for entry in self.entries if entry.shown is not None]
        colours, self.legend = heat.coloured([entry.heat for entry in measured], settings)
        for entry, its in zip(measured, colours, strict=True):
            entry.colours, entry.drawn = its, {}
        self._coloured_by = settings
        redraw()


heatmap = Heatmap()


def settings_of(scene):
    """The `HeatSettings` that the panel shows."""
    return scene.qh_heatmap.settings() if scene else HeatSettings()


def redraw():
    """Have the editors that can show it draw themselves."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {'VIEW_3D', 'IMAGE_EDITOR'}:
                area.tag_redraw()


def _follow(_scene, depsgraph):
    """Something in the file has changed: look again at the objects that it may concern."""
    changed = set()
    for update in depsgraph.updates:
        source = update.id.original
        if isinstance(source, bpy.types.Material | bpy.types.Image):
            heatmap.look_again()
            return
        if update.is_updated_geometry or update.is_updated_transform:
            changed.add(source.session_uid)
    which = [entry for entry in heatmap.entries if changed & _uids(entry.find())]
    if which:
        heatmap.look_again(which)


def _uids(obj):
    return set() if obj is None else {obj.session_uid, obj.data.session_uid}


def _look_again(*_):
    heatmap.look_again()


@bpy.app.handlers.persistent
def _turn_off(*_):
    heatmap.turn_off()


_HANDLERS = (
    (bpy.app.handlers.depsgraph_update_post, _follow),
    (bpy.app.handlers.undo_post, _look_again),
    (bpy.app.handlers.redo_post, _look_again),
    (bpy.app.handlers.frame_change_post, _look_again),
    (bpy.app.handlers.load_pre, _turn_off),
)
