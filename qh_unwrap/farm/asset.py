# SPDX-License-Identifier: GPL-3.0-or-later
"""An asset as it is handed to a worker: a file, the name of its output, and how to unwrap it."""

import dataclasses
import os
from dataclasses import dataclass, field

from ..addon.failures import FileError

CURE = "choose --name '{stem}/{stem}_uv{suffix}', so that each file has a folder of its own"


@dataclass(frozen=True)
class Asset:
    """All that a worker has to know, on whichever machine."""

    input: str
    output: str
    folder: str  # of the outputs, and of the ledger
    options: dict = field(default_factory=dict)  # the flags by their names, as the command line has them
    settings: str = ""  # a digest of what of them makes a difference
    owned: tuple = ()  # paths that may be replaced at any time: what is there was written for this asset
    old: tuple = ()  # paths that may be replaced if they were there before
    since: float = 0.0  # when the batch began, by the clock of the file system
    timeout: float | None = None  # seconds
    ticket: str = ""  # of the attempt

    def to_dict(self):
        """JSON-ready."""
        return dataclasses.asdict(self)

    @classmethod
    def of(cls, values):
        """The asset of a dictionary."""
        return cls(**values)

    def check_replaced(self, path):
        """Raise `FileError` where a file that exists may not be replaced for this asset: another one may need it."""
        if str(path) in self.owned:
            return
        if str(path) not in self.old:
            raise FileError(f"{path} exists, and is another one: {CURE}, or remove it")
        if os.stat(path).st_mtime >= self.since:
            raise FileError(f"{path} was written for another file as well: {CURE}")
