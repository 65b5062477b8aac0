"""Work for processes of this machine, where the death of one costs one piece of work."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import wait
from typing import Generic, TypeVar

from magcomp.fleet.worker import serve

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

_ENDING_S = 5.0


@dataclass(frozen=True)
class Limits:
    """What a worker may use.

    Attributes
    ----------
    workers
        Processes at work at once.
    seconds
        Time for one piece of work; what takes longer is lost.
    memory
        Bytes of data a process may hold; unlimited where 0.
    pieces
        Pieces of work after which a process is replaced, so that nothing can gather in it.
    """

    workers: int
    seconds: float = 600.0
    memory: int = 0
    pieces: int = 200


def run(
    tasks: Iterable[_Task],
    work: Callable[[_Task], _Result],
    lost: Callable[[_Task, str], _Result],
    limits: Limits,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[_Result]:
    """Results as they come; tasks are taken only as workers are free.

    Parameters
    ----------
    tasks
        What is to be done, as long as it likes.
    work
        A function of a module, so that another process finds it.
    lost
        Makes the result of a task whose worker died or took too long, and why.
    limits
        Of the workers.
    clock
        Seconds that only grow.
    """
    waiting = iter(tasks)
    slots = [_Slot(work, limits) for _ in range(limits.workers)]
    try:
        while True:
            for slot in slots:
                if slot.task is None:
                    slot.give(next(waiting, None), clock())
            busy = [slot for slot in slots if slot.task is not None]
            if not busy:
                return
            patience = min(slot.began for slot in busy) + limits.seconds - clock()
            ready = wait([slot.pipe for slot in busy], max(patience, 0.0))
            for slot in busy:
                task = slot.task
                if task is None:
                    continue
                if slot.pipe in ready:
                    yield slot.take(partial(lost, task))
                elif clock() - slot.began >= limits.seconds:
                    slot.end()
                    yield lost(task, f"it must take at most {limits.seconds:g} s; it took longer")
    finally:
        for slot in slots:
            slot.end()


class _Slot(Generic[_Task, _Result]):
    """A place for one process, and what it is at."""

    def __init__(self, work: Callable[[_Task], _Result], limits: Limits) -> None:
        self.task: _Task | None = None
        self.began = 0.0
        self._work, self._limits, self._done = work, limits, 0
        self._start()

    def _start(self) -> None:
        # A forked process would share this one's open files and locks.
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=serve, args=(theirs, self._limits.memory), daemon=True
        )
        self._process.start()
        # Only while nobody else holds that end does this one see when the process dies.
        theirs.close()
        self._done = 0
        self._alive = True
        self.pipe.send(self._work)

    def give(self, task: _Task | None, now: float) -> None:
        if task is None:
            return
        if not self._alive or self._done >= self._limits.pieces:
            self.end()
            self._start()
        try:
            self.pipe.send(task)
        except (BrokenPipeError, ConnectionResetError):
            # It died between two pieces of work: this one is not to blame.
            self.end()
            self._start()
            self.pipe.send(task)
        self.task, self.began = task, now

    def take(self, lost: Callable[[str], _Result]) -> _Result:
        self.task = None
        self._done += 1
        try:
            result: _Result = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self._process.join(_ENDING_S)
            code = self._process.exitcode
            self.end()
            how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
            return lost(f"its worker must live; instead it died ({how})")
        return result

    def end(self) -> None:
        self.task = None
        if not self._alive:
            return
        self._alive = False
        self.pipe.close()
        self._process.kill()
        self._process.join(_ENDING_S)
