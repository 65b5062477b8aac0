"""A Dask cluster does what local processes do."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

import pytest
from fleet_toys import die_of_three, double, fail_of_three

from magcomp import __version__
from magcomp.errors import LinkError
from magcomp.fleet.cluster import Watch, connected, in_this_version, run

SILENT = Watch(lambda text: None)


def cluster(**options: object) -> AbstractContextManager[Any]:
    """A cluster on this computer."""
    from distributed import LocalCluster  # noqa: PLC0415 - no other test needs so much of it

    return LocalCluster(**options)


def lost(task: int, why: str) -> tuple[int, str]:
    return task, why


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """One worker in this process."""
    with cluster(
        processes=False, n_workers=1, threads_per_worker=1, dashboard_address=":0", protocol="tcp"
    ) as local:
        yield local.scheduler_address


def test_every_piece_is_done_once(scheduler: str) -> None:
    with connected(scheduler) as client:
        assert sorted(run(client, range(20), double, lost, SILENT)) == [2 * n for n in range(20)]


def test_a_piece_that_fails_is_lost_alone(scheduler: str) -> None:
    with connected(scheduler) as client:
        results = list(run(client, range(6), fail_of_three, lost, SILENT))
    (failed,) = [each for each in results if isinstance(each, tuple)]
    assert failed == (3, "the cluster must carry it out; instead it failed: ValueError: three")
    assert len(results) == 6


def test_a_worker_of_another_version_that_came_later_finds_nothing(
    scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = partial(in_this_version, "another version")
    monkeypatch.setattr(
        "magcomp.fleet.cluster.in_this_version", lambda _, work, task: other(work, task)
    )
    with connected(scheduler) as client:
        ((_, why),) = run(client, [1], double, lost, SILENT)
    assert f"must have magcomp another version; instead it has {__version__}" in why


def test_the_scheduler_is_not_given_all_at_once(scheduler: str) -> None:
    taken: list[int] = []

    def tasks() -> Iterator[int]:
        for number in itertools.count():
            taken.append(number)
            yield number

    with connected(scheduler) as client:
        results = run(client, tasks(), double, lost, SILENT)
        for _ in range(3):
            next(results)
        results.close()  # type: ignore[attr-defined]
    assert len(taken) <= 6


def test_no_scheduler_is_a_link_that_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("magcomp.fleet.cluster._CONNECT", "0.1s")
    with (
        pytest.raises(LinkError, match="must be the address of a Dask scheduler"),
        connected("tcp://127.0.0.1:9"),
    ):
        pass


class KilledWorker(Exception):  # noqa: N818 - Dask's name
    """What a scheduler says of work whose workers all died."""


class Future:
    """A piece of work of a `Client`, which says itself when it is done."""

    def __init__(self, result: int) -> None:
        self.status = "pending"
        self._result = result
        self._told: list[Callable[[Future], None]] = []

    def add_done_callback(self, tell: Callable[[Future], None]) -> None:
        self._told.append(tell)

    def result(self, timeout: float) -> int:
        return self._result

    def exception(self) -> Exception:
        return KilledWorker()

    def release(self) -> None:
        self.status = "released"

    def end(self, status: str) -> None:
        self.status = status
        for tell in self._told:
            tell(self)


class Client:
    """A scheduler whose workers come and go each time somebody looks for them."""

    def __init__(self, looks: Iterable[int | str]) -> None:
        self.status = "running"
        self.cancelled: list[Future] = []
        self.given: list[Future] = []
        self._looks = iter(looks)
        self._work: list[Future] = []

    def submit(self, work: Callable[..., int], *given: object, pure: bool) -> Future:
        self._work.append(Future(work(*given)))
        self.given.append(self._work[-1])
        return self._work[-1]

    def nthreads(self) -> dict[str, int]:
        workers = next(self._looks)
        if isinstance(workers, str):
            raise OSError(workers)
        if workers:
            for each in self._work:
                each.end("finished")
            self._work.clear()
        return dict.fromkeys(map(str, range(workers)), 1)

    def go(self) -> None:
        self.status = "closed"
        for each in self._work:
            each.end("cancelled")

    def cancel(self, futures: list[Future]) -> None:
        self.cancelled += futures


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Looks for workers without waiting for work to be done."""
    monkeypatch.setattr("magcomp.fleet.cluster._LOOK_S", 0.0)


@pytest.mark.usefixtures("at_once")
def test_a_cluster_that_has_lost_its_workers_says_so_once_and_goes_on_when_one_is_back() -> None:
    told: list[str] = []
    watch = Watch(told.append, itertools.count(0, 10).__next__)
    # Ten seconds from look to look: twenty are no more than a restart, thirty are too many.
    restarts, away = [0, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0, 0, 0]
    client = Client(itertools.chain(restarts, away, itertools.repeat(1)))
    results = run(client, range(4), double, lost, watch)
    assert [next(results), next(results)] == [0, 2]
    assert told == []
    assert sorted(results) == [4, 6]
    waits, back = told
    assert "no worker has been there for 30 s" in waits
    assert "Ctrl-C" in waits
    assert "goes on" in back


@pytest.mark.usefixtures("at_once")
def test_a_result_whose_worker_is_gone_is_not_waited_for_in_silence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tries = iter([TimeoutError(), TimeoutError(), 7])

    def result(future: Future, timeout: float) -> int:
        given = next(tries)
        if isinstance(given, int):
            return given
        raise given

    monkeypatch.setattr(Future, "result", result)
    told: list[str] = []
    watch = Watch(told.append, itertools.count(0, 40).__next__)
    client = Client(itertools.chain([1, 1, 0, 0], itertools.repeat(1)))
    assert list(run(client, [1], double, lost, watch)) == [7]
    assert "no worker has been there" in told[0]


@pytest.mark.usefixtures("at_once")
def test_no_worker_holds_what_was_taken() -> None:
    client = Client(itertools.repeat(1))
    assert len(list(run(client, range(4), double, lost, SILENT))) == 4
    assert [each.status for each in client.given] == ["released"] * 4


@pytest.mark.usefixtures("at_once")
def test_a_run_that_is_ended_while_it_waits_leaves_nothing_with_the_scheduler() -> None:
    def interrupt(text: str) -> None:
        raise KeyboardInterrupt

    client = Client(itertools.repeat(0))
    watch = Watch(interrupt, itertools.count(0, 10).__next__)
    with pytest.raises(KeyboardInterrupt):
        list(run(client, range(3), double, lost, watch))
    assert len(client.cancelled) == 1


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("looks", [[0, 0, "gone"], [0, 0, 0]])
def test_no_log_is_to_blame_for_a_scheduler_that_is_gone(looks: list[int | str]) -> None:
    client = Client(looks)

    def tell(text: str) -> None:
        client.go()

    watch = Watch(tell, itertools.count(0, 40).__next__)
    results = []
    with pytest.raises(LinkError, match="scheduler must go on; instead it is gone"):
        results.extend(run(client, range(3), double, lost, watch))
    assert not results


class Deadly(Client):
    """A worker that takes up what it has in hand once nothing more comes, and dies of a piece."""

    def __init__(self) -> None:
        super().__init__([])
        self._still = False

    def submit(self, work: Callable[..., int], *given: object, pure: bool) -> Future:
        self._still = False
        return super().submit(work, *given, pure=pure)

    def nthreads(self) -> dict[str, int]:
        if self._still:
            died = any(each.result(0.0) == double(3) for each in self._work)
            for each in self._work:
                each.end("error" if died else "finished")
            self._work.clear()
        self._still = bool(self._work)
        return {"one": 1}


@pytest.mark.usefixtures("at_once")
def test_what_a_worker_had_in_hand_as_it_died_of_another_is_not_lost() -> None:
    results = list(run(Deadly(), range(6), double, lost, SILENT))
    killed = (3, "its worker must live; instead every one that tried it died")
    assert [each for each in results if isinstance(each, tuple)] == [killed]
    assert sorted(each for each in results if isinstance(each, int)) == [0, 2, 4, 8, 10]


@pytest.mark.slow
def test_a_piece_that_kills_every_worker_is_lost_alone() -> None:
    import dask  # noqa: PLC0415 - no other test needs it

    # A local cluster gives up a worker that is away after fifteen seconds, in which a busy
    # computer may not have started it again; then nobody is left to do the work.
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "1h"}),
        cluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as local,
        connected(local.scheduler_address) as client,
    ):
        results = list(run(client, range(6), die_of_three, lost, SILENT))
    (killed,) = [each for each in results if isinstance(each, tuple)]
    assert killed == (3, "its worker must live; instead every one that tried it died")
    assert sorted(each for each in results if isinstance(each, int)) == [0, 2, 4, 8, 10]
