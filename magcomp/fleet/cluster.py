"""Work for an existing Dask cluster: its scheduling, its retries, its dashboard."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

from magcomp import __version__
from magcomp.errors import LinkError, UsageError

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

_AHEAD = 2
"""Tasks a thread of the cluster has in hand, so that none waits for the next."""

_CONNECT = "10s"


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A client of a cluster whose workers have this version of magcomp.

    Parameters
    ----------
    address
        Of the scheduler, such as ``tcp://10.0.0.5:8786``.

    Raises
    ------
    UsageError
        Where Dask is not installed here, or the workers have another magcomp.
    LinkError
        Where no scheduler answers.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise LinkError(
            f"{address} must be the address of a Dask scheduler, such as tcp://10.0.0.5:8786; "
            f"instead received: {error}"
        ) from error
    with client:
        _check_workers(client, address)
        yield client


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise UsageError(
            "A cluster must be reached with dask.distributed, which is not installed: pip install "
            "'magcomp[fleet]'"
        ) from error


def _check_workers(client: Any, address: str) -> None:
    try:
        versions = set(client.run(_version).values())
    except ModuleNotFoundError as error:
        raise UsageError(
            f"The workers of {address} must have magcomp {__version__}; instead they lack "
            f"{error.name}"
        ) from error
    if versions - {__version__}:
        raise UsageError(
            f"The workers of {address} must have magcomp {__version__}; instead they have "
            f"{', '.join(sorted(versions))}"
        )


def _version() -> str:
    return __version__


def run(
    client: Any,
    tasks: Iterable[_Task],
    work: Callable[[_Task], _Result],
    lost: Callable[[_Task, str], _Result],
) -> Iterator[_Result]:
    """Results as they come; the scheduler is given tasks only as workers are free.

    Parameters
    ----------
    client
        From :func:`connected`.
    tasks, work, lost
        As in :func:`magcomp.fleet.local.run`.
    """
    waiting = iter(tasks)
    running: dict[Any, _Task] = {}
    done = _distributed().as_completed(loop=client.loop)

    def fill() -> None:
        room = max(_AHEAD * sum(client.nthreads().values()), 1) - len(running)
        for task in islice(waiting, max(room, 0)):
            future = client.submit(work, task, pure=False)
            running[future] = task
            done.add(future)

    try:
        fill()
        for future in done:
            task = running.pop(future)
            if future.status == "finished":
                yield future.result()
            else:
                yield lost(task, _why(future))
            fill()
    finally:
        client.cancel(list(running))


def _why(future: Any) -> str:
    if future.status == "cancelled":
        return "the cluster must carry it out; instead it was cancelled there"
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return "its worker must live; instead every one that tried it died"
    return f"the cluster must carry it out; instead it failed: {type(error).__name__}: {error}"
