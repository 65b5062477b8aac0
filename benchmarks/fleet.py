"""What a fleet's run costs beside the fits themselves, and how long its overview takes.

    python benchmarks/fleet.py [--rows 100000] [--log LOG] [--logs FOLDER [--only-logs]]

Times are of the processor, so that a busy machine disturbs them little; with --logs also the wall
time of one worker against two, which only an idle machine tells.
"""

from __future__ import annotations

import argparse
import gc
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from magcomp.analysis import analyse
from magcomp.fleet import cluster
from magcomp.fleet.aircraft import aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.as_html import html
from magcomp.fleet.as_text import fleet_text
from magcomp.fleet.flights import NEEDED, select
from magcomp.fleet.local import Limits, run
from magcomp.fleet.places import find
from magcomp.fleet.row import Log, Row, State
from magcomp.fleet.run import Runner, carry_out_all, known_of, lost, to_do
from magcomp.fleet.store import Store
from magcomp.fleet.task import Outcome, Task, carry_out
from magcomp.process import prepare
from magcomp.report.look import Look
from magcomp.sources import read

_FLIGHTS = 50
_PAIRS = 16


def processor_s(work: Callable[[], object]) -> float:
    """Processor time of some work."""
    start = time.process_time()
    work()
    return time.process_time() - start


def beside(path: str) -> tuple[float, float]:
    """Processor time of reading and fitting a log, and what a worker takes beside that.

    What a fit takes varies by a tenth from one to the next, and what it leaves for Python to
    clear falls to whoever comes then: each pair is cleared before, begun by the other in turn,
    and the middle one of their differences counts.
    """
    (log,) = find([path])
    works: list[Callable[[], object]] = [
        lambda: analyse(read(Path(path))),
        lambda: carry_out(Task(log)),
    ]
    pairs = []
    for turn in range(_PAIRS):
        taken = [0.0, 0.0]
        for which in (turn % 2, 1 - turn % 2):
            gc.collect()
            taken[which] = processor_s(works[which])
        pairs.append(taken)
    alone, whole = np.array(pairs[1:]).T
    return float(np.median(alone)), float(np.median(whole - alone))


def overhead(path: Path) -> None:
    """What a log costs beside its reading and fitting, milliseconds."""
    (log,) = find([str(path)])
    # In a process that is set up as a worker is: this one has more threads, which wait.
    ((alone, more),) = run([str(path)], beside, lambda _, why: sys.exit(why), Limits(1))
    rows = carry_out(Task(log)).rows
    count = 2000

    def known(tasks: Iterable[Task]) -> Iterator[Outcome]:
        for number, task in enumerate(tasks):
            digest = f"{number:064x}"
            made = tuple(replace(row, path=task.log.path, digest=digest) for row in rows)
            yield Outcome(task.log, digest, made)

    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        logs = [replace(log, path=f"{k}.tlog", stamp=str(k)) for k in range(count)]

        def keep() -> None:
            found = known_of(store)
            todo = to_do(logs, found)
            list(carry_out_all(todo, found, store, known, time.monotonic))

        kept = processor_s(keep)
    here = processor_s(lambda: list(run(range(count), abs, lambda _, why: why, Limits(1))))
    print(f"read and fit {1e3 * alone:.0f} ms; in a worker beside it {1e3 * more:.1f} ms")
    print(
        f"keeping its rows {1e3 * kept / count:.2f} ms; to a worker and back "
        f"{1e3 * here / count:.2f} ms"
    )


def overview(count: int, like: Path) -> None:
    """Processor time of the answer from a store of some rows."""
    (log,) = find([str(like)])
    first = carry_out(Task(log)).rows[0]
    rng = np.random.default_rng(0)
    logs = count // 2
    rows: list[Row] = []
    found: list[Log] = []
    for k in range(logs):
        of = replace(log, path=f"{k}.tlog", stamp=str(k), modified_s=1.7e9 + 8.64e4 * k)
        found.append(of)
        board = k % max(logs // _FLIGHTS, 1)
        motor = np.array(first.correction[:3]) + 0.03 * rng.normal(size=3)
        if board % 10 == 0:
            motor[0] += 2e-5 * k
        made = replace(
            first,
            path=of.path,
            stamp=of.stamp,
            digest=f"{k:064x}",
            uid=f"board {board}",
            start_unix_s=of.modified_s,
            verdict="good",
            before_deg=float(rng.exponential(1.0)),
            correction=(*map(float, motor), *first.correction[3:]),
        )
        rows += [made, replace(made, compass=2)]
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        for begin in range(0, len(rows), 20000):
            store.append(rows[begin : begin + 20000])
        marks = [time.process_time()]
        known = known_of(store)
        selected = select(store.read(NEEDED), found, known)
        marks.append(time.process_time())
        fleet = Fleet(aircraft(selected), selected, len(found), 0)
        marks.append(time.process_time())
        page = html(fleet, {})
        fleet_text(fleet, Look())
        marks.append(time.process_time())
    steps = ", ".join(
        f"{what} {b - a:.2f} s"
        for what, a, b in zip(
            ("from the store", "aircraft", "page"), marks, marks[1:], strict=False
        )
    )
    print(
        f"{len(selected.flights)} rows of {len(fleet.aircraft)} aircraft: {steps}, together "
        f"{marks[-1] - marks[0]:.2f} s; page {len(page) >> 10} KiB"
    )


def seconds(logs: Sequence[Log], runner: Runner) -> float:
    """Wall time of logs that are fitted and kept."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        known = known_of(store)
        start = time.perf_counter()
        outcomes = list(carry_out_all(logs, known, store, runner, time.monotonic))
        taken = time.perf_counter() - start
    gone = [each.rows[0].why for each in outcomes if each.rows[0].state == State.LOST]
    if gone:
        sys.exit(f"{len(gone)} logs were lost: {gone[0]}")
    return taken


def local(logs: Sequence[Log], count: int) -> float:
    """Wall time with worker processes, and their start."""
    return seconds(logs, lambda tasks: run(tasks, carry_out, lost, Limits(count)))


def clustered(logs: Sequence[Log], count: int) -> float:
    """Wall time with a Dask cluster of processes that stand ready, as on one that is there."""
    from distributed import LocalCluster  # noqa: PLC0415 - an extra

    with (
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=count, threads_per_worker=1, dashboard_address=None
        ) as there,
        cluster.connected(there.scheduler_address) as client,
    ):
        client.run(carry_out, Task(logs[0]))
        watch = cluster.Watch(print)
        return seconds(logs, lambda tasks: cluster.run(client, tasks, carry_out, lost, watch))


def workers(place: str) -> None:
    """Wall time of one worker and of two over the same logs."""
    logs = find([place])
    for what, road in (("worker processes", local), ("processes of a Dask cluster", clustered)):
        one, two = (road(logs, count) for count in (1, 2))
        print(
            f"{len(logs)} logs, {what}: one {one:.1f} s, two {two:.1f} s, efficiency "
            f"{one / two / 2:.0%}"
        )


def main() -> None:
    # Workers import this file, and NumPy with it, before they are set up: two threads in each of
    # two took eight times as long as one worker.
    prepare()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--log", type=Path, default=Path("sitl_fixtures/sweep_current.tlog"))
    parser.add_argument("--logs", help="a folder of logs for one worker against two")
    parser.add_argument("--only-logs", action="store_true", help="nothing else")
    wanted = parser.parse_args()
    if not wanted.only_logs:
        overhead(wanted.log)
        overview(wanted.rows, wanted.log)
    if wanted.logs:
        workers(wanted.logs)


if __name__ == "__main__":
    main()
