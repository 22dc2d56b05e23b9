# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker: unwraps one asset at a time in a process of its own, which is replaced when it dies."""

import dataclasses
import platform
import time
import uuid
from pathlib import Path
from typing import NamedTuple

from ..addon import writing
from ..addon.failures import NO_BLENDER, FileError, UsageError
from .child import Child
from .entry import CRASHED, TIMED_OUT, TOO_LARGE, Entry
from .ledger import Ledger

POLL = 0.005  # seconds between two looks at a process
_ATTEMPTS = 2
_STARTS = 2  # of a process that dies before it is ready
_PATIENCE = 300.0  # seconds until a process is ready
_LOOK = 0.05  # seconds between two looks at its memory


class Limits(NamedTuple):
    """What an asset may take at most, None where there is no limit."""

    timeout: float | None = None  # seconds
    memory: float | None = None  # bytes of the process


class Worker:
    """Where one asset after another is unwrapped.  Begin one, and poll until its entry is there."""

    def __init__(self, limits):
        self._limits = limits
        self._child = None
        self._is_ready = False
        self._asset = None

    @property
    def is_idle(self):
        return self._asset is None

    def begin(self, asset):
        self._asset, self._attempts, self._starts = asset, 0, 0
        self._try()

    def poll(self):
        """The asset's entry, which is in the ledger by then, or None while it takes its time."""
        is_alive = self._child.is_alive  # asked before its last messages are read
        for message in self._child.received():
            if message.get("lacking"):
                raise UsageError(NO_BLENDER)
            if "ready" in message:
                self._is_ready, self._since = True, time.monotonic()
            if "entry" in message:
                return self._finished(Entry.of(message["entry"]))
        status, error = self._fault(is_alive) or (None, None)
        if status is None:
            return None
        self._child.kill()
        self._child = None
        writing.sweep(Path(self._asset.output).parent, self._ticket)
        if not self._is_ready:
            self._starts += 1
            if self._starts >= _STARTS:
                raise FileError(f"no worker can be started: it {error}")
            self._attempts -= 1
        if self._attempts < _ATTEMPTS:
            self._try()
            return None
        return self._finished(dataclasses.replace(self._running(), status=status, error=f"the worker {error}"))

    def stop(self):
        """Interrupt it; `end` has to follow."""
        if self._child and not self.is_idle:
            self._child.stop()
        elif self._child:
            self._child.dismiss()

    def end(self):
        """End its process, and what is half done."""
        if self._child:
            self._child.end()
            self._child = None
        if self._asset:
            writing.sweep(Path(self._asset.output).parent, self._ticket)
            self._asset = None

    def _try(self):
        if self._child is None or not self._child.is_alive:
            if self._child:
                self._child.kill()
            self._child, self._is_ready = Child(), False
        self._attempts += 1
        self._ticket = uuid.uuid4().hex[:12]
        self._since = time.monotonic()
        self._looked = 0.0
        Ledger(Path(self._asset.folder)).write(self._running())
        self._child.send(dataclasses.replace(self._asset, ticket=self._ticket).to_dict())

    def _running(self):
        return Entry.begun(self._asset, ticket=self._ticket, attempts=self._attempts)

    def _finished(self, entry):
        entry.attempts = self._attempts
        entry.host = platform.node()
        if not entry.seconds:
            entry.seconds = round(time.monotonic() - self._since, 3)
        Ledger(Path(self._asset.folder)).write(entry)
        self._asset = None
        return entry

    def _fault(self, is_alive):
        """Why the process has to be replaced: the status of its asset, and what to say of the worker."""
        now = time.monotonic()
        if not is_alive:
            return CRASHED, f"ended {self._child.last_words}"
        timeout = self._limits.timeout if self._is_ready else _PATIENCE
        if timeout and now - self._since > timeout:
            return TIMED_OUT, f"took longer than {timeout:g} s" + " (--timeout)" * self._is_ready
        if self._limits.memory and now - self._looked > _LOOK:
            self._looked = now
            memory = self._child.memory
            if memory > self._limits.memory:
                allowed = f"{self._limits.memory / 1e9:g} GB are allowed (--memory)"
                return TOO_LARGE, f"took {memory / 1e9:.1f} GB, and {allowed}"
        return None


def wait_for(worker, asset):
    """Have a worker unwrap an asset; returns the entry."""
    worker.begin(asset)
    while (entry := worker.poll()) is None:
        time.sleep(POLL)
    return entry
