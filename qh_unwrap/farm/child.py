# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker process as its parent sees it: messages to and fro, its memory, and its end."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

_PATIENCE = 3.0  # seconds to end by itself


def command():
    """What starts a worker process: this Python, or the Blender that runs it."""
    bpy = sys.modules.get("bpy")
    if bpy and bpy.app.binary_path:
        return [bpy.app.binary_path, "--background", "--command", "qh_unwrap", "farm", "worker"]
    return [sys.executable, "-P", "-m", "qh_unwrap", "farm", "worker"]


class Child:
    """A process that takes JSON lines and answers with JSON lines.

    Its answers go through a file: there is no way to look into a pipe without waiting that all systems have.
    """

    def __init__(self):
        self._folder = tempfile.TemporaryDirectory(prefix="qh-unwrap-", ignore_cleanup_errors=True)
        self._answers, self._said = (Path(self._folder.name, name) for name in ("answers", "said"))
        with open(self._answers, "ab") as answers, open(self._said, "ab") as said:
            self._process = subprocess.Popen(
                command(), stdin=subprocess.PIPE, stdout=answers, stderr=said, env=_environment(), **_APART
            )
        self._reading = open(self._answers, "rb")  # noqa: SIM115  (as long as the process is there)
        self._begun = b""
        self._heard = 0  # bytes that were said before the latest message

    @property
    def is_alive(self):
        return self._process.poll() is None

    def send(self, values):
        """Send a message; if the process is no more, nobody gets it."""
        self._heard = self._said.stat().st_size
        with suppress(OSError):
            self._process.stdin.write(json.dumps(values).encode() + b"\n")
            self._process.stdin.flush()

    def received(self):
        """The messages that have come since."""
        *lines, self._begun = (self._begun + self._reading.read()).split(b"\n")
        return [found for found in map(_message, lines) if found]

    @property
    def last_words(self):
        """How the process ended, and the last line that it printed as an error."""
        number = self._process.poll()
        how = f"by {_signal_name(-number)}" if number is not None and number < 0 else f"with exit code {number}"
        with suppress(OSError):
            said = self._said.read_bytes()[self._heard :]
            lines = said.decode(errors="replace").strip().splitlines()
            return f"{how} ({lines[-1].strip()})" if lines else how
        return how

    @property
    def memory(self):
        """Bytes of memory that it has, 0 where nobody knows."""
        return resident(self._process.pid)

    def kill(self):
        """End it at once, whatever it is at, and what it has started."""
        if hasattr(os, "killpg"):
            with suppress(OSError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()
        self._close()

    def dismiss(self):
        """Tell it that there is no more to do."""
        with suppress(OSError):
            self._process.stdin.close()

    def end(self):
        """Wait until it has ended by itself, and if it does not, end it; one that is at work is to tidy up."""
        self.dismiss()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_PATIENCE)
        self.kill()

    def stop(self):
        """Interrupt what it is at, so that it tidies up and ends."""
        self._process.terminate()

    def _close(self):
        self.dismiss()
        self._reading.close()
        self._folder.cleanup()


def _message(line):
    """The message in a line; None where it is something that Blender printed."""
    with suppress(ValueError):
        found = json.loads(line)
        return found if isinstance(found, dict) else None
    return None


def _environment():
    """The environment, with the place of this package, wherever it was imported from."""
    place = str(Path(__file__).parents[2])
    others = [each for each in os.environ.get("PYTHONPATH", "").split(os.pathsep) if each]
    return os.environ | {"PYTHONPATH": os.pathsep.join([place, *others])}


def _signal_name(number):
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


# Ctrl C is for the main process alone, which then ends the workers.
_APART = dict(creationflags=subprocess.CREATE_NEW_PROCESS_GROUP) if os.name == "nt" else dict(start_new_session=True)


def resident(pid):
    """Bytes of memory that a process has, 0 if it has ended; None where the system does not say."""
    if sys.platform == "linux":
        with suppress(OSError, IndexError, ValueError):
            return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        return 0
    try:
        import psutil
    except ImportError:
        return None
    try:
        return psutil.Process(pid).memory_info().rss
    except psutil.Error:
        return 0
