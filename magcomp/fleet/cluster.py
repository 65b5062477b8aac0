"""Work for an existing Dask cluster: its scheduling, its retries, its dashboard."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from magcomp import __version__
from magcomp.errors import LinkError, UsageError

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

_AHEAD = 2
"""Tasks a thread of the cluster has in hand, so that none waits for the next."""

_CONNECT = "10s"

_PATIENCE_S = 30.0
"""How long nothing is said of a cluster without a worker: one may be starting again."""

_LOOK_S = 2.0

_GIVE_S = 10.0
"""Time for a worker to give a result, some kB, away."""


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


def in_this_version(version: str, work: Callable[[_Task], _Result], task: _Task) -> _Result:
    """Work of a worker, which may have come after the others were asked for their versions.

    Raises
    ------
    UsageError
        Where it has another magcomp: what that found must not stand among results of this one.
    """
    if version != __version__:
        raise UsageError(f"a worker must have magcomp {version}; instead it has {__version__}")
    return work(task)


class Watch:
    """Says when a cluster has had no worker for a while, and when it has one again.

    Parameters
    ----------
    tell
        Tells people.
    clock
        Seconds that only grow.
    """

    def __init__(
        self, tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._tell, self._clock = tell, clock
        self._alone_since: float | None = None
        self._told = False

    def look(self, workers: int) -> None:
        """Take note of how many workers there are."""
        now = self._clock()
        if workers:
            if self._told:
                self._tell("a worker is there again: the run goes on")
            self._alone_since, self._told = None, False
            return
        if self._alone_since is None:
            self._alone_since = now
        if not self._told and now - self._alone_since >= _PATIENCE_S:
            self._told = True
            self._tell(
                f"no worker has been there for {_PATIENCE_S:.0f} s: the run waits for one; Ctrl-C "
                "ends it, and what was done is kept"
            )


def run(
    client: Any,
    tasks: Iterable[_Task],
    work: Callable[[_Task], _Result],
    lost: Callable[[_Task, str], _Result],
    watch: Watch,
) -> Iterator[_Result]:
    """Results as they come; the scheduler is given tasks only as workers are free.

    Parameters
    ----------
    client
        From :func:`connected`.
    tasks, work, lost
        As in :func:`magcomp.fleet.local.run`.
    watch
        Is told of the workers whenever nothing came for a while.

    Raises
    ------
    LinkError
        Where the scheduler is gone.
    """
    suspects = []
    for task, future in _done(client, tasks, work, watch):
        if _killed(future):
            suspects.append(task)
        else:
            yield _outcome(client, task, future, lost, watch)
    # Who was in hand of a worker that died is blamed with the one it died of: alone only one is.
    for suspect in suspects:
        for task, future in _done(client, [suspect], work, watch):
            yield _outcome(client, task, future, lost, watch)


def _done(
    client: Any,
    tasks: Iterable[_Task],
    work: Callable[[_Task], _Result],
    watch: Watch,
) -> Iterator[tuple[_Task, Any]]:
    """Tasks that have come to an end, however, as they do."""
    waiting = iter(tasks)
    running: dict[Any, _Task] = {}
    done: SimpleQueue[Any] = SimpleQueue()

    def fill() -> None:
        room = max(_AHEAD * sum(_threads(client).values()), 1) - len(running)
        for task in islice(waiting, max(room, 0)):
            future = client.submit(in_this_version, __version__, work, task, pure=False)
            running[future] = task
            future.add_done_callback(done.put)

    try:
        fill()
        while running:
            try:
                future = done.get(timeout=_LOOK_S)
            except Empty:
                watch.look(len(_threads(client)))
                continue
            # A scheduler that is gone cancels all, and no log is to blame for that.
            if future.status == "cancelled":
                _threads(client)
            yield running.pop(future), future
            # What a worker still holds as it dies would be done once more, for nobody.
            future.release()
            fill()
    finally:
        # A scheduler that is gone has nothing left to cancel.
        with suppress(OSError):
            client.cancel(list(running))


def _threads(client: Any) -> dict[str, int]:
    """Threads of each worker."""
    try:
        if client.status in ("closing", "closed"):
            raise ConnectionError("it does not answer")
        threads: dict[str, int] = client.nthreads()
    except OSError as error:
        raise LinkError(
            f"The Dask scheduler must go on; instead it is gone ({error}): what was done is kept, "
            "and the same command goes on from there"
        ) from error
    return threads


def _killed(future: Any) -> bool:
    """Whether every worker that tried it died."""
    return future.status == "error" and type(future.exception()).__name__ == "KilledWorker"


def _outcome(
    client: Any, task: _Task, future: Any, lost: Callable[[_Task, str], _Result], watch: Watch
) -> _Result:
    # The worker that has the result may die before it gives it away.
    while future.status not in ("cancelled", "error"):
        try:
            result: _Result = future.result(timeout=_GIVE_S)
        except TimeoutError:
            watch.look(len(_threads(client)))
        else:
            return result
    if future.status == "cancelled":
        return lost(task, "the cluster must carry it out; instead it was cancelled there")
    if _killed(future):
        return lost(task, "its worker must live; instead every one that tried it died")
    error = future.exception()
    why = f"the cluster must carry it out; instead it failed: {type(error).__name__}: {error}"
    return lost(task, why)
