"""Local workers: what one of them cannot survive costs one piece of work."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator

from fleet_toys import die_of_three, double, hang_at_three, hold, whose

from magcomp.fleet.local import Limits, run


def lost(task: int, why: str) -> tuple[int, str]:
    return task, why


def test_every_piece_is_done_once() -> None:
    assert sorted(run(range(20), double, lost, Limits(2))) == [2 * n for n in range(20)]


def test_a_worker_that_dies_loses_one_piece_only() -> None:
    results = list(run(range(6), die_of_three, lost, Limits(1)))
    assert results[3] == (3, "its worker must live; instead it died (signal 9)")
    assert results[:3] + results[4:] == [0, 2, 4, 8, 10]


def test_a_piece_that_takes_too_long_is_lost() -> None:
    # Time passes only once the piece that hangs has been given.
    hour, given = itertools.count(0, 3600), []

    def tasks() -> Iterator[int]:
        for number in range(6):
            given.append(number)
            yield number

    def clock() -> float:
        return float(next(hour)) if given[-1:] == [3] else 0.0

    results = list(run(tasks(), hang_at_three, lost, Limits(1, seconds=600.0), clock))
    assert results[3] == (3, "it must take at most 600 s; it took longer")
    assert results[4:] == [8, 10]


def test_tasks_are_taken_only_as_workers_are_free() -> None:
    taken: list[int] = []

    def tasks() -> Iterator[int]:
        for number in itertools.count():
            taken.append(number)
            yield number

    results = run(tasks(), double, lost, Limits(1))
    next(results)
    results.close()  # type: ignore[attr-defined]
    assert len(taken) <= 2


def test_a_worker_holds_no_more_memory_than_it_may() -> None:
    assert list(run([1, 4096], hold, lost, Limits(1, memory=512 << 20))) == [1, -1]


def test_a_worker_is_replaced_after_some_pieces() -> None:
    workers = list(run(range(4), whose, lost, Limits(1, pieces=2)))
    assert workers[0] == workers[1] != workers[2] == workers[3]
    assert os.getpid() not in workers
