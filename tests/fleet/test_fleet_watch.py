"""Logs that arrive: given once, when nothing more is written to them."""

from __future__ import annotations

import json
from dataclasses import replace

from json_schema import must_be
from made_flights import log, row

from magcomp.cli.fleet import arrived
from magcomp.fleet.row import Log, without_fit
from magcomp.fleet.task import Outcome
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


def test_what_is_told_of_a_log_that_came_is_as_the_schema_says() -> None:
    good = row(1)
    rows = (good, replace(good, compass=2), *without_fit(log(2), "", "it is empty"))
    lines = arrived(Outcome(log(1), good.digest, rows), to_json=True).splitlines()
    assert len(lines) == 3
    for line in lines:
        must_be("arrival", json.loads(line))
