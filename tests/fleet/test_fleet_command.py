"""``magcomp fleet`` on real logs, from the command line to the dataset and back."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

import pytest
from json_schema import must_be
from truth import FIXTURES

from magcomp.cli.app import run
from magcomp.fleet.places import find
from magcomp.fleet.row import State
from magcomp.fleet.task import Task, carry_out


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A sweep, its copy in an archive's place, and two files that are no logs."""
    folder = tmp_path / "logs"
    (folder / "deep").mkdir(parents=True)
    shutil.copy(FIXTURES / "sweep_current.tlog", folder / "a.tlog")
    shutil.copy(FIXTURES / "sweep_current.tlog", folder / "deep" / "b.TLOG")
    (folder / "c.BIN").write_bytes(b"")
    (folder / "d.log").write_text("nothing of the kind\n" * 50)
    (folder / "readme.txt").write_text("not a log")
    return folder


def test_a_fleet_from_folder_to_answer(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["fleet", str(logs), "-o", str(tmp_path / "out"), "--workers", "1", "--json"]
    table = tmp_path / "rows.csv"
    assert run([*arguments, "--table", str(table)]) == 0
    first = json.loads(capsys.readouterr().out)
    assert (first["logs"], first["read"], first["fitted"], first["copies"]) == (4, 4, 1, 1)
    assert {Path(each["log"]).name for each in first["unusable"]} == {"c.BIN", "d.log"}
    must_be("fleet", first)
    (found,) = first["aircraft"]
    assert found["device_ids"] == [97539, 131874, 263178]
    truth = json.loads((FIXTURES / "sweep_current.json").read_text())["mot_mgauss_per_amp"]
    for compass in found["compasses"]:
        assert compass["pooled"]["interference_mgauss"] == pytest.approx(truth, rel=0.03, abs=0.03)
    assert table.read_text().count("\n") == 1 + 3 + 1 + 2
    assert run(arguments) == 0
    second = json.loads(capsys.readouterr().out)
    assert second.pop("read") == 0
    assert second.items() <= first.items()


def test_places_are_files_folders_and_patterns(logs: Path, tmp_path: Path) -> None:
    def names(*paths: object) -> list[str]:
        return [Path(log.path).name for log in find(map(str, paths))]

    assert names(logs) == ["a.tlog", "c.BIN", "d.log", "b.TLOG"]
    assert names(logs / "readme.txt", logs / "a.tlog", logs / "a.tlog") == ["a.tlog", "readme.txt"]
    assert names(logs / "**" / "*.[tT]*[gG]") == ["a.tlog", "b.TLOG"]
    odd = logs / "[odd].tlog"
    odd.write_bytes(b"x")
    assert names(odd) == ["[odd].tlog"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "nowhere must be a log"),
        (["nowhere/*.tlog"], "a pattern that some match"),
        ([".", "--since", "someday"], "--since must be a day"),
        ([".", "--table", "x.xls"], "must end in .csv or .parquet"),
    ],
)
def test_what_cannot_be_asked_is_refused(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["fleet", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_an_archive_is_a_log(tmp_path: Path) -> None:
    path = tmp_path / "flight.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("x.tlog", b"\0" * 100)
    (log,) = find([str(path)])
    (row,) = carry_out(Task(log)).rows
    assert row.state == State.UNUSABLE
    assert str(path) in row.why


def test_a_log_that_has_gone_is_a_row(tmp_path: Path) -> None:
    path = tmp_path / "gone.tlog"
    path.write_bytes(b"x")
    (log,) = find([str(path)])
    path.unlink()
    outcome = carry_out(Task(log))
    assert (outcome.digest, outcome.rows[0].state) == ("", State.UNUSABLE)


def test_a_log_without_memory_for_it_can_be_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "huge.tlog"
    path.write_bytes(b"x")

    def full(_: Path) -> None:
        raise MemoryError

    monkeypatch.setattr("magcomp.fleet.task.read", full)
    (log,) = find([str(path)])
    outcome = carry_out(Task(log))
    assert (outcome.digest, outcome.rows[0].state) == ("", State.LOST)
    assert "--memory" in outcome.rows[0].why


def test_a_folder_is_watched(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (logs / "a.tlog").unlink()
    (logs / "deep" / "b.TLOG").unlink()
    page = tmp_path / "page.html"
    looks = ["--every", "0.1", "--looks", "2", "--workers", "1", "-o", str(tmp_path / "out")]
    assert run(["fleet", "watch", str(logs), *looks, "--html", str(page)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(": ")[0] for line in sorted(lines)] == [
        str(logs / "c.BIN"),
        str(logs / "d.log"),
    ]
    assert "c.BIN" in page.read_text()
