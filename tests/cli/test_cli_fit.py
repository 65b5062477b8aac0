"""``magcomp fit``: what it prints, what it writes, and how it ends."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from logs_made_of_logs import (
    FLIGHT,
    SWEEP,
    of_kind,
    with_shaken_compass_2,
    with_weak_current,
)

from magcomp.cli.app import run
from magcomp.report.files import SUFFIXES as REPORTS
from magcomp.writing.files import SUFFIXES, read_parameter_file

pytestmark = pytest.mark.usefixtures("fits_once")

TRUTH = np.array(json.loads(SWEEP.with_suffix(".json").read_text())["mot_mgauss_per_amp"])

ONE_OBJECT = {"magcomp", "source", "duration_s", "vehicle", "compasses"}
VEHICLE = {"autopilot", "system", "firmware", "device_ids"}
COMPASS = {
    "compass",
    "method",
    "regressor",
    "unit",
    "interference_mgauss",
    "std_mgauss",
    "lag_s",
    "line",
    "field_residual_mgauss",
    "heading_error_deg",
    "coverage",
    "parameters",
    "verdict",
    "reasons",
}


@pytest.fixture(scope="module")
def weak(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log no fit of which can be trusted."""
    return with_weak_current(tmp_path_factory.mktemp("logs") / "weak.tlog")


def answer(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of one command."""
    code = run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_json_is_one_object_in_the_form_scripts_rely_on(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, err = answer(capsys, "fit", SWEEP, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found.keys() >= ONE_OBJECT
    assert found["source"] == str(SWEEP)
    assert found["vehicle"].keys() >= VEHICLE
    assert found["vehicle"]["device_ids"] == [97539, 131874, 263178]
    assert [compass["compass"] for compass in found["compasses"]] == [1, 2, 3]
    for compass in found["compasses"]:
        assert compass.keys() >= COMPASS
        assert compass["lag_s"].keys() == {"field", "regressor"}
        assert compass["line"].keys() >= {
            "point_mgauss",
            "direction",
            "straightness",
            "rms_mgauss",
        }
        assert compass["field_residual_mgauss"].keys() >= {"before", "after", "held_out"}
        assert all(
            row.keys() == {"u", "before", "after", "p95"} for row in compass["heading_error_deg"]
        )
        assert compass["verdict"] in {"good", "marginal", "rejected"}


def test_the_interference_it_prints_is_the_true_one(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = answer(capsys, "fit", SWEEP, "--json")
    for compass in json.loads(out)["compasses"]:
        assert (compass["method"], compass["regressor"], compass["unit"]) == (
            "sweep",
            "current",
            "A",
        )
        off = np.linalg.norm(compass["interference_mgauss"] - TRUTH)
        assert off <= 0.01 * np.linalg.norm(TRUTH)


def test_a_number_that_does_not_exist_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    # A vehicle that does not turn cannot show how far the field lags behind the attitude.
    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is not JSON")

    _, out, _ = answer(capsys, "fit", SWEEP, "--json", "--compass", 1)
    (compass,) = json.loads(out, parse_constant=refuse)["compasses"]
    assert compass["lag_s"]["field"] is None
    assert compass["lag_s"]["regressor"] > 0.0


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_file_holds_exactly_the_parameters_of_the_json(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"compass{suffix}"
    code, out, _ = answer(capsys, "fit", SWEEP, "--json", "-o", path)
    assert code == 0
    found = json.loads(out)
    printed: dict[str, float] = {}
    for compass in found["compasses"]:
        printed.update(compass["parameters"])
    written = read_parameter_file(path)
    assert dict(written.values) == printed
    assert written.vehicle is not None
    assert written.vehicle.device_ids == (97539, 131874, 263178)
    assert found["written"] == str(path)


def test_nothing_is_written_without_being_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert answer(capsys, "fit", SWEEP, "--compass", 1)[0] == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", REPORTS)
def test_a_report_is_written_beside(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"report{suffix}"
    code, out, _ = answer(capsys, "fit", SWEEP, "--compass", 1, "--report", path)
    assert code == 0
    assert str(path) in out.replace("\n", "").replace(" ", "")
    assert "COMPASS_MOT_X" in path.read_text(encoding="utf-8")
    again = answer(capsys, "fit", SWEEP, "--compass", 1, "--report", path)
    assert again[0] == 2
    assert "--force" in again[2]


def test_a_part_of_a_log_can_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = answer(capsys, "fit", SWEEP, "--json", "--compass", 2, "--start", 30, "--end", 70)
    (compass,) = json.loads(out)["compasses"]
    assert compass["compass"] == 2
    assert compass["coverage"]["seconds"] <= 40.0


def test_throttle_is_fitted_where_it_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = answer(capsys, "fit", SWEEP, "--json", "--compass", 1, "--regressor", "throttle")
    (compass,) = json.loads(out)["compasses"]
    assert (compass["regressor"], compass["unit"]) == ("throttle", "")
    assert compass["parameters"]["COMPASS_MOTCT"] == 1


class TestRejected:
    """A fit that the judge rejects is shown, is not written, and ends with 1."""

    def test_the_json_still_comes_out(self, weak: Path, capsys: pytest.CaptureFixture[str]) -> None:
        code, out, _ = answer(capsys, "fit", weak, "--json")
        found = json.loads(out)
        assert code == 1
        assert {compass["verdict"] for compass in found["compasses"]} == {"rejected"}
        assert all(compass["parameters"] == {} for compass in found["compasses"])

    def test_no_file_is_written(
        self, weak: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "compass.param"
        code, out, err = answer(capsys, "fit", weak, "-o", path)
        assert code == 1
        assert not path.exists()
        assert "REJECTED" in out
        assert str(path) in err
        assert "--force" in err

    def test_force_writes_it_and_the_file_says_so(
        self, weak: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "compass.param"
        code, _, _ = answer(capsys, "fit", weak, "-o", path, "--force")
        assert code == 1
        written = read_parameter_file(path)
        assert written.values["COMPASS_MOTCT"] == 2
        assert any("rejected" in comment for comment in written.comments)

    def test_a_compass_alone_is_left_without_compensation(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        log = with_shaken_compass_2(tmp_path / "shaken.tlog")
        path = tmp_path / "compass.param"
        code, out, _ = answer(capsys, "fit", log, "-o", path)
        assert code == 0
        assert "rejected: compass 2" in out
        written = read_parameter_file(path).values
        assert written["COMPASS_MOT_X"] == pytest.approx(-TRUTH[0], rel=0.02)
        # Its stored vector would come into force with the switch, which is one for all.
        assert all(written[f"COMPASS_MOT2_{axis}"] == 0.0 for axis in "XYZ")


class TestOutput:
    """The output is looked at before the long work begins, and nothing is overwritten."""

    @pytest.fixture(autouse=True)
    def no_work(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def work(*_: object) -> None:
            raise AssertionError("the log must not be read for nothing")

        monkeypatch.setattr("magcomp.cli.fit.fit_log", work)

    def refused(self, capsys: pytest.CaptureFixture[str], path: Path, why: str) -> None:
        code, out, err = answer(capsys, "fit", SWEEP, "-o", path)
        assert (code, out) == (2, "")
        assert why in err
        assert err.count("\n") == 1

    def test_a_suffix_that_is_no_parameter_file(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.refused(capsys, tmp_path / "compass.txt", ".param or .parm or .params")

    def test_a_directory_that_is_not_there(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.refused(capsys, tmp_path / "none" / "compass.param", "must be a directory")

    def test_a_directory_in_the_place_of_the_file(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = tmp_path / "compass.param"
        path.mkdir()
        self.refused(capsys, path, "must be a file")

    def test_a_file_that_is_there(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        path = tmp_path / "compass.param"
        path.write_text("mine")
        self.refused(capsys, path, "--force")
        assert path.read_text() == "mine"

    def test_the_log_itself(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        log = tmp_path / "really.param"
        log.write_bytes(b"a log")
        code, _, err = answer(capsys, "fit", log, "-o", tmp_path / "." / log.name, "--force")
        assert code == 2
        assert "the log itself" in err
        assert log.read_bytes() == b"a log"

    def test_a_name_too_long_for_the_disk(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        self.refused(capsys, tmp_path / f"{'x' * 300}.param", "must be a path to a file")


def test_force_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "compass.param"
    path.write_text("mine")
    assert answer(capsys, "fit", SWEEP, "--compass", 1, "-o", path, "--force")[0] == 0
    assert read_parameter_file(path).values["COMPASS_MOTCT"] == 2


class TestText:
    """What people see."""

    def test_the_verdict_comes_first_in_words(self, capsys: pytest.CaptureFixture[str]) -> None:
        _, out, _ = answer(capsys, "fit", SWEEP)
        verdict = out.index("MARGINAL")
        assert verdict < out.index("heading error") < out.index("COMPASS_MOTCT")
        assert "Nothing is written yet" in out

    def test_it_fits_80_columns_without_colours(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("COLUMNS", raising=False)
        _, out, _ = answer(capsys, "fit", FLIGHT, "--verbose")
        lines = [line for line in out.splitlines() if str(FLIGHT) not in line]
        assert max(map(len, lines)) <= 80
        assert "\x1b" not in out
        assert not any(line.endswith(" ") for line in lines)

    def test_colours_are_used_where_forced_and_not_where_refused(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("FORCE_COLOR", "1")
        assert "\x1b[" in answer(capsys, "fit", SWEEP, "--compass", 1)[1]
        monkeypatch.setenv("NO_COLOR", "1")
        assert "\x1b" not in answer(capsys, "fit", SWEEP, "--compass", 1)[1]

    def test_compasses_that_are_alike_share_one_picture(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        log = with_shaken_compass_2(tmp_path / "shaken.tlog")
        _, out, _ = answer(capsys, "fit", log)
        assert "compasses 1 and 3 (alike" in out
        assert out.count("heading error   now") == 2

    def test_a_name_cannot_command_the_terminal(
        self,
        tmp_path: Path,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        log = Path("\x1b[31mred\x07.tlog")
        _, _, err = answer(capsys, "fit", log)
        log.write_bytes(SWEEP.read_bytes())
        _, out, _ = answer(capsys, "fit", log, "--compass", 1)
        for text in (out, err):
            assert "?[31mred?.tlog" in text
            assert "\x1b" not in text

    def test_old_and_new_values_stand_side_by_side(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        _, out, _ = answer(capsys, "fit", SWEEP, "--compass", 1)
        row = next(line for line in out.splitlines() if line.startswith(" COMPASS_MOT "))
        assert row.count("0 → ") == 3

    def test_a_vehicle_that_is_no_multirotor_is_named(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        for kind, name in ((1, "plane"), (10, "rover")):
            code, out, _ = answer(
                capsys, "fit", of_kind(tmp_path / f"{name}.tlog", kind), "--compass", 1
            )
            assert code == 0
            assert f"vehicle is a {name}" in out
