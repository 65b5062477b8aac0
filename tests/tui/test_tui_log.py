"""The road of a log: open, fit, look, change, save."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import made
import numpy as np
import pytest
import scripted
from click.testing import CliRunner
from scripted import press, screen, until
from textual.widgets import Input
from truth import FIXTURES
from unequal import Unequal

from magcomp.analysis import Options
from magcomp.cli.app import app as command_line
from magcomp.errors import MissingDataError
from magcomp.fit import METHODS
from magcomp.report.plain import table_rows
from magcomp.tui import fitting
from magcomp.tui.fits import fit_rows
from magcomp.tui.screens.dialogs import Confirm, Message
from magcomp.tui.screens.fit import regressors
from magcomp.tui.services import Simulation
from magcomp.writing.files import read_parameter_file

SWEEP = FIXTURES / "sweep_current.tlog"


async def opened(pilot) -> None:
    await until(pilot, lambda: pilot.app.work.card is not None and pilot.app.busy is None)


async def fitted(pilot, compass: int | None = 1) -> None:
    """With the log fitted: one compass, because three take three times as long."""
    await opened(pilot)
    pilot.app.set_work(replace(pilot.app.work, options=Options(compass=compass)))
    await press(pilot, "n")
    await until(pilot, lambda: pilot.app.work.analysis is not None)


@pytest.fixture(scope="module")
def json_answer() -> dict:
    answered = CliRunner().invoke(command_line, ["fit", str(SWEEP), "--json"])
    return json.loads(answered.stdout)


async def test_a_log_named_on_the_command_line_is_open_at_once(tmp_path):
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await opened(pilot)
        shown = screen(pilot.app)
        assert "ArduPilot copter 4.6.3, system 1" in shown
        assert "1, 2 and 3 (ids 97539, 131874, 263178)" in shown
        assert "off (COMPASS_MOTCT 0)" in shown
        assert "Press N to see the fit" in shown


async def test_what_the_screen_shows_is_what_fit_json_prints(tmp_path, json_answer):
    async with scripted.app(tmp_path, str(SWEEP)).run_test(size=(120, 60)) as pilot:
        await fitted(pilot, compass=None)
        for compass in json_answer["compasses"]:
            await press(pilot, str(compass["compass"]))
            await pilot.pause()
            shown = screen(pilot.app)
            for row in table_rows(compass):
                # What cannot be told from the fit is no worse than it.
                now = max(row["before"], row["p95"] if row["before"] <= row["p95"] else 0.0)
                for value in (now, row["after"], row["p95"]):
                    assert f"{value:.1f}°" in shown
            residual = compass["field_residual_mgauss"]
            assert f"{residual['held_out_before']:.1f} → {residual['after']:.1f}" in shown
            assert f"unseen {residual['held_out']:.1f}" in shown
            for value, std in zip(
                compass["interference_mgauss"], compass["std_mgauss"], strict=True
            ):
                assert f"{value:.3f} ± {std:.3f}" in shown
            assert compass["verdict"].upper() in shown
        held = {n: v for c in json_answer["compasses"] for n, v in c["parameters"].items()}
        assert pilot.app.work.parameters.values == held


async def test_every_option_can_be_changed_and_fits_again_at_once(tmp_path):
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await fitted(pilot, compass=None)
        await press(pilot, "c")
        assert [c.fit.compass for c in pilot.app.work.analysis.compasses] == [1]
        await press(pilot, "m")
        assert pilot.app.work.analysis.compasses[0].fit.method == "sweep"
        await press(pilot, "r", "r")
        assert pilot.app.work.analysis.compasses[0].fit.regressor == "throttle"
        await pilot.press("t")
        first, last = pilot.app.screen.query(Input)
        first.value, last.value = "10", "70"
        await press(pilot, "enter")
        assert pilot.app.work.options.start == 10.0
        assert pilot.app.work.options.end == 70.0
        shown = screen(pilot.app)
        assert "M method sweep R by throttle C compass 1 T time 10 … 70 s" in shown


def test_what_is_offered_is_what_the_log_may_be_fitted_by():
    flown = Unequal(seed=1).recording()
    escs = {0: flown.current}
    assert regressors(None) == ("auto", "current", "throttle")
    assert regressors(replace(flown, outputs=None)) == ("auto", "current", "throttle")
    assert regressors(flown) == ("auto", "current", "throttle", "motors")
    assert regressors(replace(flown, esc_currents=escs))[-2:] == ("motors", "esc")


async def test_a_fit_that_cannot_be_says_why_and_what_next_and_keeps_the_old_one(tmp_path):
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await fitted(pilot)
        before = pilot.app.work
        await pilot.press("t")
        first, last = pilot.app.screen.query(Input)
        first.value, last.value = "83", "83.5"
        await press(pilot, "enter")
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        assert "Next:" in screen(pilot.app)
        assert "Traceback" not in screen(pilot.app)
        await press(pilot, "enter")
        assert pilot.app.work is before


async def test_a_time_that_is_no_number_is_said_to_be_none(tmp_path):
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await fitted(pilot)
        await pilot.press("t")
        pilot.app.screen.query(Input).first().value = "soon"
        await press(pilot, "tab", "enter")
        await until(pilot, lambda: "instead received 'soon'" in screen(pilot.app))
        assert pilot.app.screen.focused is pilot.app.screen.query(Input).first()


async def test_fits_of_two_time_ranges_stand_side_by_side_and_either_can_be_shown(tmp_path):
    app = scripted.app(tmp_path, str(SWEEP))
    async with app.run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        whole = app.work.analysis
        await pilot.press("t")
        first, last = app.screen.query(Input)
        first.value, last.value = "10", "70"
        await press(pilot, "enter")
        await until(pilot, lambda: app.work.analysis is not whole)
        await until(pilot, lambda: "10 … 70 s" in screen(app).split("Fits side by side")[-1])
        await press(pilot, "p")
        await until(pilot, lambda: app.work.analysis is whole)
        assert "T time whole" in screen(app)
        rows = {row.number: row for row in fit_rows(app.work.tried, whole, 1)}
        assert rows[1].apart < 1e-6
        assert 0.0 < rows[2].apart < 1.0


async def test_a_time_range_is_chosen_by_eye_with_the_arrow_keys(tmp_path):
    app = scripted.app(tmp_path, str(SWEEP))
    async with app.run_test() as pilot:
        await fitted(pilot)
        await pilot.press("t")
        await until(pilot, lambda: "━" * 60 in scripted.picture(app))
        await press(pilot, *["up"] * 10, "tab", *["down"] * 10)
        first, last = (float(field.value) for field in app.screen.query(Input))
        whole = app.work.recording.duration_s
        assert first == pytest.approx(whole / 6.0, abs=6.0)
        assert last == pytest.approx(5.0 * whole / 6.0, abs=6.0)
        strip = next(
            line for line in scripted.picture(app).splitlines() if "━·" in line and "·━" in line
        )
        assert strip.count("━") == pytest.approx(
            strip.count("·") * (last - first) / (whole - last + first), abs=3
        )


@pytest.mark.parametrize(
    ("key", "option", "impossible", "round_trip"),
    [
        ("m", "method", ("levels", "flight"), {*METHODS}),
        ("r", "regressor", ("throttle", "motors"), {"current", "throttle", "motors", "auto"}),
    ],
)
async def test_every_choice_is_reached_and_one_that_cannot_be_fitted_does_not_end_the_round(
    key, option, impossible, round_trip, tmp_path, monkeypatch
):
    def fit(_recording, options, _progress):
        if getattr(options, option) in impossible:
            raise MissingDataError(f"{option} must have what it needs; instead it has not")
        return made.analysis(), made.pictures(made.analysis())

    monkeypatch.setattr(fitting, "fit", fit)
    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        await until(pilot, lambda: app.choices)
        app.set_work(replace(made.work(), recording=Unequal(seed=1).recording()))
        app.action_go("fit")
        await until(pilot, lambda: "Heading error" in screen(app))
        tried = []
        for _ in round_trip:
            await press(pilot, key)
            tried.append(getattr(app.asked, option))
            if isinstance(app.screen, Message):
                await press(pilot, "enter")
        assert set(tried) == round_trip


async def test_the_report_of_what_is_shown_is_saved_and_told_of_on_leaving(tmp_path):
    path = tmp_path / "sweep.md"
    app = scripted.app(tmp_path, str(SWEEP))
    async with app.run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "e")
        app.screen.query_one(Input).value = str(tmp_path / "sweep.doc")
        await press(pilot, "enter")
        await until(pilot, lambda: isinstance(app.screen, Message))
        await press(pilot, "enter")
        assert app.screen.query_one(Input).value == str(tmp_path / "sweep.doc")
        app.screen.query_one(Input).value = str(path)
        await press(pilot, "enter")
        await until(pilot, path.is_file)
        assert "sweep_current.tlog" in path.read_text()
        assert app.farewell == f"Report      {path}"


async def test_the_difference_can_be_saved_and_is_what_was_shown(tmp_path):
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await fitted(pilot, compass=None)
        await press(pilot, "n", "3", "s")
        path = tmp_path / "compass.param"
        pilot.app.screen.query_one(Input).value = str(path)
        await press(pilot, "enter")
        await until(pilot, lambda: pilot.app.work.kept)
        saved = read_parameter_file(path)
        # The switch serves compass 3 as well: left out, it gets a vector of zeros and nothing else.
        assert {n for n in saved.values if "3_" in n} == {f"COMPASS_MOT3_{a}" for a in "XYZ"}
        assert not any(saved.values[f"COMPASS_MOT3_{axis}"] for axis in "XYZ")
        for row in pilot.app.writing.rows:
            assert np.float32(row.new) == np.float32(saved.values[row.name])
        assert "Saved to" in screen(pilot.app)
        assert "undoes" not in screen(pilot.app)  # nothing was written to a vehicle


async def test_a_file_that_exists_is_overwritten_only_after_a_question(tmp_path):
    path = tmp_path / "compass.param"
    path.write_text("mine\n")
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "n", "s")
        pilot.app.screen.query_one(Input).value = str(path)
        await press(pilot, "enter")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        await press(pilot, "enter")  # the safe answer has the focus
        assert path.read_text() == "mine\n"
        assert not pilot.app.work.kept


async def test_a_log_has_no_vehicle_to_write_to_and_no_step_to_verify(tmp_path):
    async with scripted.app(tmp_path, str(SWEEP)).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "n")
        actions = {b.binding.action for b in pilot.app.screen.active_bindings.values()}
        assert "app.write" not in actions
        assert "app.forward" not in actions


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ("nowhere.tlog", "nowhere.tlog"),
        ("rubbish:::", "rubbish"),
        ("{empty}", "empty.tlog"),
    ],
)
async def test_what_cannot_be_opened_gets_a_sentence_and_a_next_step(tmp_path, target, says):
    (tmp_path / "empty.tlog").touch()
    named = target.format(empty=tmp_path / "empty.tlog")
    async with scripted.app(tmp_path, named).run_test() as pilot:
        await until(pilot, lambda: "Next:" in screen(pilot.app))
        assert says in screen(pilot.app).replace(" ", "")
        assert "Traceback" not in screen(pilot.app)
        await press(pilot, "enter")
        assert not pilot.app.work.source


async def test_logs_used_lately_are_offered_next_time_whatever_wrote_them(tmp_path):
    logs = (str(SWEEP), str(tmp_path / "flight.BIN"), str(tmp_path / "px4.ulg"))
    for log in logs[1:]:
        Path(log).touch()
    for log in logs:
        services = {"read": lambda *_: made.recording()}
        async with scripted.app(tmp_path, log, **services).run_test() as pilot:
            await opened(pilot)
    later = scripted.app(tmp_path)
    async with later.run_test(size=(120, 40)) as pilot:
        await until(pilot, lambda: later.choices)
        for log in logs:
            assert log in {choice.target for choice in later.choices}
            assert Path(log).name in screen(later)


async def test_either_simulated_vehicle_can_be_chosen_from_the_list(tmp_path):
    for down, autopilot in ((2, "ardupilot"), (1, "px4")):
        started = []

        def simulate(name, started=started):
            started.append(name)
            return Simulation("udp:127.0.0.1:14599", lambda: None)

        app = scripted.app(tmp_path, simulate=simulate)
        async with app.run_test() as pilot:
            await until(pilot, lambda app=app: app.choices)
            await press(pilot, "end", *["up"] * (down - 1), "enter")
            await until(pilot, lambda started=started: started)
        assert started == [autopilot]
