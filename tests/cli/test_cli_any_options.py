"""Whatever options a log is looked at with, the end is an answer or a sentence that was meant.

A warning of NumPy is an error here (pyproject.toml), so it would come out as one that was not.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from logs_made_of_logs import FIXTURES

from magcomp.cli.app import run
from magcomp.errors import ExitCode

LOGS = sorted(str(path) for path in FIXTURES.iterdir() if path.suffix in (".tlog", ".BIN", ".gz"))
LOOSE = {
    "derandomize": True,
    "suppress_health_check": [HealthCheck.function_scoped_fixture],
}

moments = st.one_of(st.integers(-50, 500), st.floats(allow_nan=True, allow_infinity=True))
selection = {
    "--compass": st.sampled_from([1, 1, 2, 3, 4, 0]),
    "--start": moments,
    "--end": moments,
    "--system": st.sampled_from([1, 1, 1, 2]),
    "--component": st.sampled_from([1, 1, 2]),
    "--battery": st.sampled_from(["first", "second", "all", "1", "2", "esc", "none"]),
    "--attitude": st.sampled_from(["first", "second", "1", "2", "ahrs2"]),
}
of_fit = {
    "--method": st.sampled_from(["auto", "sweep", "levels", "flight", "other"]),
    "--regressor": st.sampled_from(["auto", "current", "throttle", "esc", "motors", "other"]),
}
of_heading = {"--gravity": st.sampled_from(["attitude", "accelerometer"])}
FLAGS = {
    "fit": ["--json"],
    "check": ["--json"],
    "info": ["--json"],
    "heading": ["--json", "--plot", "--in-force"],
}
OPTIONS = {
    "fit": selection | of_fit,
    "check": selection,
    "info": {},
    "heading": selection | of_heading,
}


@st.composite
def words(draw: st.DrawFn) -> list[str]:
    command = draw(st.sampled_from(sorted(OPTIONS)))
    said = [command, draw(st.sampled_from(LOGS))]
    for name, values in OPTIONS[command].items():
        if draw(st.integers(0, 3)) == 0:
            said.append(f"{name}={draw(values)}")
    return said + [flag for flag in FLAGS[command] if draw(st.booleans())]


def must_end_well(said: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    code = run(said)
    captured = capsys.readouterr()
    assert "should not have happened" not in captured.err, said
    assert code in (ExitCode.GOOD, ExitCode.REJECTED, ExitCode.USAGE), said
    assert captured.out or captured.err
    if code == ExitCode.USAGE:
        assert captured.out == ""


@pytest.mark.parametrize(
    "said",
    [
        ["fit", "turntable_paper.tlog", "--end=40", "--compass=1"],
        ["fit", "turntable_five_levels.tlog", "--end=60", "--compass=1"],
        ["heading", "turntable_paper.tlog", "--end=40"],
        ["check", "flight.tlog", "--start=277"],
    ],
)
def test_what_once_failed_ends_well(said: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    must_end_well([said[0], str(FIXTURES / said[1]), *said[2:]], capsys)


@settings(max_examples=8, **LOOSE)
@given(said=words())
def test_some_options_end_well(said: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    must_end_well(said, capsys)


@pytest.mark.slow
@settings(max_examples=400, suppress_health_check=LOOSE["suppress_health_check"])
@given(said=words())
def test_all_options_end_well(said: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    must_end_well(said, capsys)
