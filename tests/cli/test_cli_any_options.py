"""Whatever options a log is looked at with, the end is an answer or a sentence that was meant.

A warning of NumPy is an error here, so it would come out as one that was not. This draws a few
cases; ``benchmarks/fuzz_options.py`` draws as many as wanted, over any folder of logs.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest
from fuzz_options import OF_A_LINK, OF_A_LOG, CommandLines, fault, logs_in, seeded
from logs_made_of_logs import FIXTURES


@pytest.mark.parametrize(
    "said",
    [
        ["fit", "turntable_paper.tlog", "--end=40", "--compass=1"],
        ["fit", "turntable_five_levels.tlog", "--end=60", "--compass=1"],
        ["heading", "turntable_paper.tlog", "--end=40"],
        ["check", "flight.tlog", "--start=277"],
    ],
)
def test_what_once_failed_ends_well(said: list[str]) -> None:
    assert fault([said[0], str(FIXTURES / said[1]), *said[2:]]) == ""


@pytest.mark.parametrize("seed", range(6))
def test_some_options_end_well(seed: int, tmp_path: Path) -> None:
    seeded(tmp_path)
    drawn = CommandLines(random.Random(seed), logs_in([FIXTURES]), tmp_path)
    for said in (drawn.draw() for _ in range(2)):
        assert fault(said) == "", said


@pytest.mark.parametrize("seed", range(4))
def test_some_options_for_a_vehicle_end_well(seed: int, tmp_path: Path) -> None:
    seeded(tmp_path)
    drawn = CommandLines(random.Random(seed), logs_in([FIXTURES]), tmp_path, OF_A_LINK)
    said = drawn.draw()
    assert fault(said) == "", said


def test_every_option_of_every_command_is_drawn(tmp_path: Path) -> None:
    seeded(tmp_path)
    for command in (*OF_A_LOG, *OF_A_LINK):
        drawn = CommandLines(random.Random(1), logs_in([FIXTURES]), tmp_path, [command], share=0.5)
        said = {word.partition("=")[0] for _ in range(30) for word in drawn.draw()}
        assert {option.opts[-1] for option in drawn.options(command)} <= said


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (["a warning"], "RuntimeWarning: divide by zero"),
        (["an error"], "this should not have happened: ValueError"),
        (["silence"], "nothing is said"),
        (["a wrong code"], "exit code 7"),
        (["an answer and an error"], "an answer although it ended in an error"),
        (["no number", "--json"], "no JSON"),
    ],
)
def test_what_does_not_end_well_is_seen(
    said: list[str], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    endings = {
        "a warning": (0, "x", "RuntimeWarning: divide by zero\n"),
        "an error": (2, "", "magcomp: this should not have happened: ValueError: x\n"),
        "silence": (0, "", ""),
        "a wrong code": (7, "x", ""),
        "an answer and an error": (2, "x", "magcomp: no\n"),
        "no number": (0, '{"a": NaN}', ""),
    }

    def ends(arguments: list[str]) -> int:
        code, out, err = endings[arguments[0]]
        sys.stdout.write(out)
        sys.stderr.write(err)
        return code

    monkeypatch.setattr("fuzz_options.run", ends)
    assert why in fault(said)
