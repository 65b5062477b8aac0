"""``magcomp report`` and ``magcomp fit --report`` from arguments to files and exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from report_page import content_of
from truth import FIXTURES

from magcomp.cli.app import run

SWEEP = str(FIXTURES / "sweep_throttle_only.tlog")
FLIGHT = str(FIXTURES / "flight.tlog")

pytestmark = pytest.mark.usefixtures("fits_once")


@pytest.fixture(autouse=True)
def no_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)


@pytest.mark.parametrize("suffix", [".html", ".json", ".md"])
def test_a_report_is_written_in_the_form_of_its_suffix(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"report{suffix}"
    assert run(["report", SWEEP, "-o", str(path)]) == 0
    text = path.read_text(encoding="utf-8")
    if suffix == ".json":
        assert json.loads(text)["verdict"] == "marginal"
    elif suffix == ".md":
        assert text.startswith("# At 38 % throttle your compasses are up to 16° wrong.")
    else:
        assert content_of(text).headings[0].startswith("At 38 % throttle your compasses")
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_all_forms_hold_the_numbers_that_fit_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, document = tmp_path / "a.html", tmp_path / "a.json"
    assert run(["fit", SWEEP, "--json", "--report", str(page)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert run(["report", SWEEP, "-o", str(document)]) == 0
    assert json.loads(document.read_text()) == printed
    assert content_of(page.read_text(encoding="utf-8")).json("result") == printed


def test_a_rejected_fit_is_reported_and_ends_with_1(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    assert run(["report", FLIGHT, "--compass", "1", "--start", "240", "-o", str(path)]) == 1
    assert content_of(path.read_text(encoding="utf-8")).headings[0].startswith("Do not write")


def test_a_rejected_fit_is_reported_by_fit_though_its_parameters_are_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report, parameters = tmp_path / "report.md", tmp_path / "compass.param"
    selection = ["--compass", "1", "--start", "240"]
    given = ["-o", str(parameters), "--report", str(report)]
    assert run(["fit", FLIGHT, *selection, *given]) == 1
    assert report.read_text(encoding="utf-8").startswith("# Do not write these numbers.")
    assert not parameters.exists()
    assert str(parameters) in capsys.readouterr().err


def test_the_report_of_fit_names_the_parameter_file(tmp_path: Path) -> None:
    report, parameters = tmp_path / "report.md", tmp_path / "compass.param"
    assert run(["fit", SWEEP, "-o", str(parameters), "--report", str(report)]) == 0
    assert str(parameters) in report.read_text(encoding="utf-8")


@pytest.mark.parametrize("command", [["report", "-o"], ["fit", "--report"]])
class TestRefusedBeforeTheLogIsRead:
    """The log does not exist, and yet it is the output that is complained about."""

    def refusal(
        self, command: list[str], path: Path, capsys: pytest.CaptureFixture[str]
    ) -> tuple[int, str]:
        name, option = command
        code = run([name, "no-such-log.tlog", option, str(path)])
        return code, capsys.readouterr().err

    def test_a_file_that_is_there(
        self, command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "report.html"
        path.write_text("mine")
        code, said = self.refusal(command, path, capsys)
        assert code == 2
        assert "--force" in said
        assert path.read_text() == "mine"

    def test_a_suffix_of_no_form(
        self, command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        code, said = self.refusal(command, tmp_path / "report.pdf", capsys)
        assert code == 2
        assert ".html or .json or .md" in said

    def test_a_directory_that_is_not_there(
        self, command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        code, said = self.refusal(command, tmp_path / "none" / "report.html", capsys)
        assert code == 2
        assert "must be a directory" in said


def test_force_overwrites(tmp_path: Path) -> None:
    path = tmp_path / "report.md"
    path.write_text("old")
    assert run(["report", SWEEP, "-o", str(path), "--force"]) == 0
    assert path.read_text(encoding="utf-8").startswith("# At 38 % throttle your compasses")


def test_an_unusable_log_leaves_no_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "text.tlog"
    log.write_text("no log at all\n" * 50)
    path = tmp_path / "report.html"
    assert run(["report", str(log), "-o", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"magcomp: Log {log} must be ")
    assert "Traceback" not in said
    assert not path.exists()
