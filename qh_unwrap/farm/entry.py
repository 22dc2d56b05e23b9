# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of one asset: the only noun for it, whichever machine unwrapped it."""

import dataclasses
import platform
from dataclasses import dataclass, field

RUNNING, OK = "running", "ok"
CRASHED, TIMED_OUT, TOO_LARGE = "crashed", "timed out", "out of memory"
_UNFINISHED = (RUNNING, CRASHED, TIMED_OUT, TOO_LARGE)  # after which nobody knows whether the output was put in place


@dataclass
class Entry:
    """An asset's line in the ledger and in the reports."""

    input: str
    output: str
    status: str = RUNNING  # one of those above, or a status of the command line's JSON
    exit_code: int | None = None
    error: str | None = None
    attempts: int = 1
    seconds: float = 0.0  # of the last attempt
    host: str = field(default_factory=platform.node)
    ticket: str = ""  # what the files that wait for their places have in their names
    since: float = 0.0  # when its batch began
    settings: str = ""  # a digest of the settings and the version
    input_digest: str = ""
    output_digest: str = ""
    stretch: float | None = None  # means over the surface
    energy: float | None = None
    details: dict = field(default_factory=dict)  # the command line's JSON without what is long
    preview: str = ""  # a picture of the UVs, a .png file in base 64

    @classmethod
    def begun(cls, asset, **values):
        """The entry of an asset that a worker is at."""
        return cls(asset.input, asset.output, since=asset.since, settings=asset.settings, **values)

    @property
    def is_good(self):
        """Everything of it is unwrapped and in place."""
        return self.status == OK

    @property
    def is_unfinished(self):
        """Its worker ended before the asset did."""
        return self.status in _UNFINISHED

    @property
    def files(self):
        """The paths of what was put in place."""
        return self.details.get("files", [])

    @property
    def totals(self):
        """How many islands it has, how many are certified, and so on."""
        return self.details.get("totals", {})

    def to_dict(self):
        """JSON-ready."""
        return dataclasses.asdict(self)

    @classmethod
    def of(cls, values):
        """The entry of a dictionary, which may come from another version."""
        names = {each.name for each in dataclasses.fields(cls)}
        return cls(**{name: value for name, value in values.items() if name in names})
