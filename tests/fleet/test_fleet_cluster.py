"""A Dask cluster does what local processes do."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Any

import pytest
from fleet_toys import die_of_three, double, fail_of_three

from magcomp.errors import LinkError
from magcomp.fleet.cluster import connected, run


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
        assert sorted(run(client, range(20), double, lost)) == [2 * n for n in range(20)]


def test_a_piece_that_fails_is_lost_alone(scheduler: str) -> None:
    with connected(scheduler) as client:
        results = list(run(client, range(6), fail_of_three, lost))
    (failed,) = [each for each in results if isinstance(each, tuple)]
    assert failed == (3, "the cluster must carry it out; instead it failed: ValueError: three")
    assert len(results) == 6


def test_the_scheduler_is_not_given_all_at_once(scheduler: str) -> None:
    taken: list[int] = []

    def tasks() -> Iterator[int]:
        for number in itertools.count():
            taken.append(number)
            yield number

    with connected(scheduler) as client:
        results = run(client, tasks(), double, lost)
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
        results = list(run(client, range(6), die_of_three, lost))
    (killed,) = [each for each in results if isinstance(each, tuple)]
    assert killed == (3, "its worker must live; instead every one that tried it died")
    assert sorted(each for each in results if isinstance(each, int)) == [0, 2, 4, 8, 10]
