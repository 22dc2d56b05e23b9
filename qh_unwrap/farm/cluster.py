# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers on the machines of a Dask cluster, which see the same folders as this one."""

import logging
import time
from contextlib import suppress
from pathlib import Path

from ..addon.failures import FileError, UsageError
from .asset import Asset
from .entry import CRASHED, Entry
from .ledger import Ledger
from .worker import Limits, Worker, wait_for

_AT_FIRST, _LATER = 10.0, 60.0  # seconds without a scheduler
_KEPT = "_qh_unwrap_workers"  # of a Dask worker: those of ours that have nothing to do, by their limits
_LOST = ("cancelled", "lost")


def require():
    """Raise `UsageError` where Dask is missing."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise UsageError("--dask needs Dask: pip install 'qh-unwrap[farm]'") from None


def unwrapped(assets, address, limits):
    """Yield the entry of each asset, as they are done.

    Goes on with what is left where the scheduler was started anew; raises `FileError` where there is none any more.
    """
    waiting = {asset.output: asset for asset in assets}
    patience = _AT_FIRST
    while waiting:
        client = _connected(address, patience)
        patience = _LATER
        try:
            yield from _by(client, waiting, limits)
        finally:
            _end(client)
        if waiting:  # the scheduler was lost; its workers may have finished something meanwhile
            yield from _finished(waiting)


def _connected(address, patience):
    import distributed

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what is lost is said once, in our words
    limit = time.monotonic() + patience
    while True:
        try:
            return distributed.Client(address, timeout=min(patience, 10.0), set_as_default=False)
        except ValueError as error:
            raise UsageError(f"--dask {address} is no address of a scheduler: {error}") from None
        except OSError:
            if time.monotonic() > limit:
                cure = "start one, and pass --resume to go on"
                raise FileError(f"there is no Dask scheduler at {address}: {cure}") from None
            time.sleep(0.5)


def _by(client, waiting, limits):
    """Yield the entries of what waits, until all is done or the scheduler is lost."""
    import distributed

    futures = {client.submit(_unwrap, asset.to_dict(), tuple(limits), pure=False): asset for asset in waiting.values()}
    for future in distributed.as_completed(futures, loop=client.loop):
        asset = futures.pop(future)
        if future.status in _LOST:
            return
        try:
            entry = Entry.of(future.result())
        except (FileError, UsageError):
            raise
        except Exception as error:  # such as KilledWorker, after several Dask workers died of it
            if future.status in _LOST:
                return
            error = f"Dask gave up: {type(error).__name__}: {error}"
            entry = Entry.begun(asset, status=CRASHED, error=error)
            Ledger(Path(asset.folder)).write(entry)
        del waiting[asset.output]
        yield entry


def _finished(waiting):
    """Yield the entries of what is good by now, and take it from what waits."""
    for asset in list(waiting.values()):
        entry = _entry_of(asset)
        if entry:
            del waiting[asset.output]
            yield entry


def _entry_of(asset):
    """The entry that the asset got in this batch, None if it is not good."""
    entry = Ledger(Path(asset.folder)).read(asset.output)
    return entry if entry and entry.is_good and entry.since == asset.since else None


def _end(client):
    with suppress(Exception):  # whatever is wrong with the cluster: what could be done is done
        client.run(_dismiss)
    with suppress(Exception):
        client.close(timeout=5)


def _unwrap(values, limits):
    """What a Dask worker does; returns the entry as a dictionary."""
    asset = Asset.of(values)
    entry = _entry_of(asset)  # if the scheduler repeats it
    if entry is None:
        kept = _kept().setdefault(limits, [])
        worker = kept.pop() if kept else Worker(Limits(*limits))
        try:
            entry = wait_for(worker, asset)
        except BaseException:
            worker.end()
            raise
        kept.append(worker)
    return entry.to_dict()


def _kept():
    from distributed import get_worker

    return vars(get_worker()).setdefault(_KEPT, {})


def _dismiss(dask_worker):
    """End the processes that have nothing to do."""
    for kept in vars(dask_worker).get(_KEPT, {}).values():
        while kept:
            kept.pop().end()
