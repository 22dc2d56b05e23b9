# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers on this machine."""

import time
from collections import deque

from .worker import POLL, Worker


def unwrapped(assets, jobs, limits):
    """Yield the entry of each asset, as they are done, by so many workers.  Ends them whatever happens."""
    waiting = deque(assets)
    workers = [Worker(limits) for _ in range(min(jobs, len(waiting)))]
    try:
        while waiting or not all(worker.is_idle for worker in workers):
            entries = []
            for worker in workers:
                if worker.is_idle and waiting:
                    worker.begin(waiting.popleft())
                if not worker.is_idle:
                    entries.append(worker.poll())
            found = [entry for entry in entries if entry]
            yield from found
            if not found:
                time.sleep(POLL)
    finally:
        for worker in workers:
            worker.stop()
        for worker in workers:
            worker.end()
