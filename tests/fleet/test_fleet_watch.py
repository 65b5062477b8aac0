"""Logs that arrive: given once, when nothing more is written to them."""

from __future__ import annotations

from dataclasses import replace

from made_flights import log

from magcomp.fleet.row import Log
from magcomp.fleet.watch import arrivals


def test_a_log_is_given_when_it_stood_still_and_once() -> None:
    a, b, growing = log(0), log(1), log(2)
    looks = iter(
        [
            [a, replace(growing, size=1)],
            [a, b, replace(growing, size=2)],
            [a, b, growing],
            [a, growing],
            [a, b, replace(growing, size=9)],
            [a, b, replace(growing, size=9)],
        ]
    )
    pauses: list[None] = []
    found: list[list[Log]] = []
    for whole in arrivals(lambda: next(looks), lambda: pauses.append(None)):
        found.append(whole)
        if len(found) == 6:
            break
    assert found == [[], [a], [b], [growing], [], [b, replace(growing, size=9)]]
    assert len(pauses) == 5
