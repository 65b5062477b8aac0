"""The road of a vehicle that does what the script says: every screen, every trouble."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import made
import pytest
import scripted
from scripted import ScriptedSession, press, screen, until
from truth import FIXTURES

from magcomp.analysis import check
from magcomp.errors import LinkError, LinkTimeoutError, VehicleRefusedError, WriteError
from magcomp.live.guide import Guidance
from magcomp.live.situation import Manoeuvre, Situation
from magcomp.model import Grade, HeadingError, ParameterChange, ParameterHistory, Verdict
from magcomp.report import words
from magcomp.report.as_json import quoted
from magcomp.sources import read
from magcomp.tui import opening, writing
from magcomp.tui.promise import Kept, Promise, promises
from magcomp.tui.screens.connect import AddressInput
from magcomp.tui.screens.dialogs import Confirm, Message
from magcomp.tui.status import link_words
from magcomp.tui.work import Work
from magcomp.writing.files import read_parameter_file


async def connected(pilot) -> None:
    opening.open_target(pilot.app, "udp:1:2")
    await until(pilot, lambda: pilot.app.work.card is not None and pilot.app.busy is None)


async def fitted(pilot, *grades: Grade) -> Work:
    """With an answer in hand, on the write screen; no fit is carried out."""
    await connected(pilot)
    pilot.app.set_work(made.work(*grades, live=True))
    writing.prepare(pilot.app)
    pilot.app.action_go("review")
    await until(pilot, lambda: "Parameters that change" in screen(pilot.app))
    return pilot.app.work


def disarmed() -> ScriptedSession:
    return ScriptedSession(made.snapshot(armed=False, situation=Situation.STILL))


# --- connect ----------------------------------------------------------------------------------


async def test_the_vehicle_is_shown_with_what_will_stand_in_the_way(tmp_path):
    session = ScriptedSession(
        made.snapshot(warnings=("there is no current sensor: throttle is used",))
    )
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        shown = screen(pilot.app)
        assert "ArduPilot copter 4.6.3, system 1" in shown
        assert "Compass 1" in shown
        assert "offsets 12, -30, 7" in shown
        assert "Mind: There is no current sensor: throttle is used." in shown


async def test_a_vehicle_that_does_not_answer_is_waited_for_and_can_be_given_up(tmp_path):
    session = ScriptedSession(
        made.snapshot(
            vehicle=None,
            ready=False,
            connected=False,
            link_text="no heartbeat arrived at udp:1:2 within 1 s",
            guidance=Guidance("waiting for the vehicle's heartbeat", 0.0),
        )
    )
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await until(pilot, lambda: pilot.app.choices)
        await press(pilot, "a", *"udp:1:2", "enter")
        await until(pilot, lambda: "waiting for the vehicle's heartbeat" in screen(pilot.app))
        assert "No heartbeat arrived" in screen(pilot.app)
        await press(pilot, "x")
        await until(pilot, lambda: not pilot.app.work.source)
        assert session.closed


async def test_an_address_nobody_is_at_gets_a_sentence_and_the_list_stays(tmp_path):
    async with scripted.app(tmp_path).run_test() as pilot:
        await until(pilot, lambda: pilot.app.choices)
        await press(pilot, "enter")
        await until(pilot, lambda: "Next:" in screen(pilot.app))
        assert "/dev/ttyACM0 cannot be opened: nobody is there." in screen(pilot.app)
        await press(pilot, "enter")
        assert "CubeOrange" in screen(pilot.app)


# --- record -----------------------------------------------------------------------------------


async def test_recording_shows_everything_and_says_what_to_do_next(tmp_path):
    session = ScriptedSession()
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "Turn slowly to the right." in screen(pilot.app))
        shown = screen(pilot.app)
        for part in (
            "479 mG",
            "47° NE",
            "45° NE",
            "42 %",
            "24.0 A",
            "66 %",
            "time 01:23",
            "compass 50 Hz",
            "1 % lost",
            "missing: headings, a sure answer",
            "at hover at most 1.3° (95 %), falling █▆▅▄▃ at 24 A",
            "◇ next, 200°",
            "recording-20250615T150640Z.tlog",
            "ARMED",
            "done",
            "! ",
        ):
            assert part in shown


async def test_the_map_fills_as_the_vehicle_turns(tmp_path):
    session = ScriptedSession(made.snapshot(situation=Situation.HELD))
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "Attitudes seen" in screen(pilot.app))
        before = screen(pilot.app).count("▒")
        counts = session.shown.coverage.counts.copy()
        counts[4, :12] = 1
        session.change(coverage=type(session.shown.coverage)(counts))
        await until(pilot, lambda: screen(pilot.app).count("▒") == before + 24)


async def test_a_lost_link_is_shown_in_words_and_recovered_from_on_the_same_screen(tmp_path):
    session = ScriptedSession()
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "link good" in screen(pilot.app))
        session.change(connected=False)
        await until(pilot, lambda: "LINK LOST" in screen(pilot.app))
        assert "it goes on when the link is back" in screen(pilot.app)
        assert "Compasses, as last heard" in screen(pilot.app)
        assert pilot.app.screen.has_class("-stale")
        session.change(connected=True)
        await until(pilot, lambda: "link good" in screen(pilot.app))
        assert pilot.app.current_mode == "record"
        assert not pilot.app.screen.has_class("-stale")


@pytest.mark.parametrize(("loss", "word"), [(0.01, "good"), (0.12, "weak"), (0.31, "bad")])
def test_a_link_that_loses_much_is_not_called_good(loss, word):
    assert link_words(loss) == f"link {word}, {100 * loss:.0f} % lost"


async def test_a_compass_is_not_rejected_before_enough_is_recorded(tmp_path):
    each = (made.compass_now(1, grade=Grade.REJECTED),)
    session = ScriptedSession(made.snapshot(compasses=each))
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "too early" in screen(pilot.app))
        assert "REJECTED" not in screen(pilot.app)
        session.change(early=False)
        await until(pilot, lambda: "REJECTED" in screen(pilot.app))


async def test_a_fit_that_is_tried_too_early_is_not_called_rejected(tmp_path):
    session = ScriptedSession()
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        pilot.app.set_work(made.work(Grade.REJECTED, live=True))
        pilot.app.action_go("fit")
        await until(pilot, lambda: "Too early for compass 1: The current" in screen(pilot.app))
        assert "[1] … too early" in screen(pilot.app)
        assert "press B, record more" in screen(pilot.app)
        session.change(early=False)
        await until(pilot, lambda: "Compass 1 is rejected: The current" in screen(pilot.app))


async def test_a_bad_address_is_told_and_what_was_typed_can_be_mended(tmp_path):
    async with scripted.app(tmp_path).run_test() as pilot:
        await until(pilot, lambda: pilot.app.choices)
        await press(pilot, "a", *"udp:x", "enter")
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        await press(pilot, "enter", "s")
        field = pilot.app.screen.query_one(AddressInput)
        assert field.has_focus
        assert field.value == "udp:xs"


async def test_disarming_is_asked_for_only_while_armed(tmp_path):
    session = disarmed()
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await fitted(pilot)
        assert "isarm" not in screen(pilot.app).split("Next")[1]
        session.change(armed=True)
        await until(pilot, lambda: "Land and disarm, then press W" in screen(pilot.app))


async def test_a_rejected_fit_says_why_first_and_has_no_key_for_writing(tmp_path):
    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        await until(pilot, lambda: app.choices)
        app.set_work(made.work(Grade.REJECTED))
        app.action_go("fit")
        await until(pilot, lambda: "Heading error" in screen(app))
        shown = screen(app)
        assert shown.index("The current never rose above 8 A") < shown.index("method")
        assert "n Write" not in shown
        await press(pilot, "n")
        assert app.current_mode == "fit"


async def test_a_snapshot_that_waits_for_the_link_does_not_hold_up_the_keys(tmp_path):
    waits, release = threading.Event(), threading.Event()

    class Slow(ScriptedSession):
        def snapshot(self):
            waits.set()
            release.wait(scripted.PATIENCE_S)
            return self.shown

    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        app.follow(Slow())
        await until(pilot, waits.is_set)
        await press(pilot, "l")
        assert app.theme == "sun"
        assert app.live is None
        release.set()
        await until(pilot, lambda: app.live is not None)


async def test_a_snapshot_that_fails_is_told_once_and_the_app_goes_on(tmp_path):
    class Broken(ScriptedSession):
        def snapshot(self):
            raise LinkError("udp:1:2 is gone")

    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        app.follow(Broken())
        await until(pilot, lambda: isinstance(app.screen, Message))
        assert "Udp:1:2 is gone." in screen(app)
        await press(pilot, "enter")
        assert app.is_running


async def test_how_the_vehicle_is_moved_can_be_said_by_a_key(tmp_path):
    session = ScriptedSession()
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "Throttle levels" in screen(pilot.app))
        words = {"flight": "flown", "stand": "on a stand", "sweep": "tied down"}
        for way, said in words.items():
            await press(pilot, "m")
            assert session.manoeuvre is Manoeuvre(way)
            await until(pilot, lambda said=said: said in screen(pilot.app))
        await press(pilot, "m")
        assert session.manoeuvre is None
        await until(pilot, lambda: "Taken as" not in screen(pilot.app))


async def test_when_it_is_enough_the_next_step_is_named(tmp_path):
    session = ScriptedSession(made.snapshot(guidance=Guidance("that is enough", 1.0, enough=True)))
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "That is enough. Then press N." in screen(pilot.app))


# --- write ------------------------------------------------------------------------------------


async def test_writing_asks_backs_up_shows_each_parameter_and_can_be_undone(tmp_path):
    session = disarmed()
    before = dict(session.held)
    async with scripted.app(tmp_path, session=session).run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "w")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        assert session.held == before
        assert pilot.app.writing.backup is None
        await press(pilot, "y")
        await until(pilot, lambda: pilot.app.work.kept)
        assert pilot.app.writing.backup.is_file()
        assert str(pilot.app.writing.backup) in pilot.app.farewell
        assert {row.state for row in pilot.app.writing.rows} == {"✓ read back"}
        assert "All 13 parameters read back as written." in screen(pilot.app)
        assert session.held["COMPASS_MOTCT"] == 2.0
        assert session.held["COMPASS_MOT_X"] == -1.5
        backup = read_parameter_file(pilot.app.writing.backup)
        assert {name: backup.values[name] for name in before} == before

        await press(pilot, "u")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        await press(pilot, "y")
        await until(pilot, lambda: "Undone" in screen(pilot.app))
        assert session.held == before
        assert not pilot.app.work.kept


async def test_what_the_vehicle_shows_of_a_write_is_said_after_it_and_while_verifying(tmp_path):
    session = disarmed()
    session.acts = "PX4 corrects its compass by what was written: within 1.4 mGauss"
    app = scripted.app(tmp_path, session=session)
    async with app.run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "w", "y")
        await until(pilot, lambda: app.work.kept)
        assert f"{session.acts}." in screen(app)
        await press(pilot, "n")
        await until(pilot, lambda: f"{session.acts}." in screen(app))
        assert "worked out from the backup" in screen(app)


async def test_a_written_vehicle_that_cannot_be_looked_at_is_written_all_the_same(tmp_path):
    session = disarmed()
    session.acts = LinkTimeoutError("The vehicle does not answer.")
    app = scripted.app(tmp_path, session=session)
    async with app.run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "w", "y")
        await until(pilot, lambda: app.work.kept == "the vehicle")
        assert "could not be looked at" in screen(app)


async def test_the_safe_answer_writes_nothing(tmp_path):
    session = disarmed()
    before = dict(session.held)
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "w")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        await press(pilot, "enter")
        assert session.held == before
        assert not list((tmp_path / "flights").glob("backup*"))


async def test_only_the_chosen_compasses_are_written(tmp_path):
    session = disarmed()
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "2", "w")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        assert "compasses 1 and 3" in screen(pilot.app)
        await press(pilot, "y")
        await until(pilot, lambda: pilot.app.work.kept)
        assert session.held["COMPASS_MOT2_X"] == 0.0
        assert session.held["COMPASS_MOT3_X"] == -1.5


async def test_a_compass_left_out_whose_stored_vector_would_act_is_set_to_0(
    tmp_path,
):
    session = disarmed()
    async with scripted.app(tmp_path, session=session).run_test(size=(120, 40)) as pilot:
        work = await fitted(pilot)
        stored = ParameterChange(1.0, "COMPASS_MOT2_X", 9.0)
        history = ParameterHistory((*work.recording.parameters.changes, stored))
        recording = replace(work.recording, parameters=history)
        pilot.app.set_work(replace(work, recording=recording))
        await press(pilot, "2")
        await until(
            pilot, lambda: "vector (9, 0, 0) would act, so it is set to 0" in screen(pilot.app)
        )


async def test_a_rejected_compass_cannot_be_chosen(tmp_path):
    async with scripted.app(tmp_path, session=disarmed()).run_test() as pilot:
        await fitted(pilot, Grade.GOOD, Grade.REJECTED)
        await press(pilot, "2")
        assert pilot.app.work.chosen == {1}
        assert "[–] 2 ○ REJECTED" in screen(pilot.app)


async def test_nothing_is_written_while_armed(tmp_path):
    session = ScriptedSession(made.snapshot(armed=True))
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "w")
        await until(pilot, lambda: "The vehicle is armed." in screen(pilot.app))
        assert "Next: Land and disarm it, then press W." in screen(pilot.app)


async def test_a_parameter_that_is_not_taken_is_told_with_what_stands(tmp_path):
    session = disarmed()
    session.refuses = "COMPASS_MOT3_Y"
    before = dict(session.held)
    async with scripted.app(tmp_path, session=session).run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "w", "y")
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        await until(pilot, lambda: "the vehicle holds everything as before" in screen(pilot.app))
        await press(pilot, "enter")
        assert "Not written; everything as before." in screen(pilot.app)
        assert session.held == before
        assert not pilot.app.work.kept


@pytest.mark.parametrize(
    "trouble",
    [
        VehicleRefusedError("the vehicle must be system 1; instead it is system 2"),
        LinkTimeoutError("system 1 must send its parameters; instead nothing came"),
        WriteError("COMPASS_MOT_X must exist on the vehicle; instead it does not"),
        OSError(28, "No space left on device", "backup.param"),
        ZeroDivisionError("division by zero"),
    ],
)
async def test_every_trouble_is_a_sentence_with_a_next_step(tmp_path, trouble):
    session = disarmed()
    session.trouble = trouble
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "w")
        await until(pilot, lambda: "Next:" in screen(pilot.app))
        assert "Traceback" not in screen(pilot.app)
        await press(pilot, "enter")
        assert pilot.app.is_running


# --- verify -----------------------------------------------------------------------------------


async def test_the_improvement_is_seen_as_the_throttle_changes(tmp_path):
    session = disarmed()
    session.change(armed=True, current=0.0, compasses=(_at(0.0),))
    async with scripted.app(tmp_path, session=session).run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "n")
        await until(pilot, lambda: "Heading before and after" in screen(pilot.app))
        await press(pilot, "m")
        session.change(current=24.0, compasses=(_at(24.0),))
        await until(pilot, lambda: "24.0 A" in screen(pilot.app))
        pair = pilot.app.screen._pairs[0]
        assert abs(pair.moved_before) > 15.0
        assert abs(pair.moved_after) < 0.1
        assert pair.largest_before == pytest.approx(abs(pair.moved_before))


async def test_after_writing_before_is_worked_out_from_the_backup(tmp_path):
    session = disarmed()
    session.change(current=24.0, compasses=(_at(24.0),))
    async with scripted.app(tmp_path, session=session).run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "w", "y")
        await until(pilot, lambda: pilot.app.work.kept)
        unwritten = _at(24.0).heading_deg
        session.change(compasses=(_at(24.0, written=True),))
        await press(pilot, "n")
        await until(pilot, lambda: "worked out from the backup" in screen(pilot.app))
        shown = pilot.app.screen
        await until(pilot, lambda: shown._pairs[0].after == pytest.approx(315.0, abs=0.2))
        assert shown._pairs[0].before == pytest.approx(unwritten, abs=0.2)


async def test_after_the_next_flight_the_promise_stands_beside_what_was_measured(tmp_path):
    flown = read(FIXTURES / "mission_compensated.tlog")
    session = disarmed()
    app = scripted.app(tmp_path, session=session)
    async with app.run_test(size=(120, 40)) as pilot:
        await fitted(pilot)
        await press(pilot, "w", "y")
        await until(pilot, lambda: app.work.kept)
        await press(pilot, "n")
        await until(pilot, lambda: "Fly as before and land" in screen(app))
        app.writing = replace(app.writing, since_s=0.0)
        session.recorded = flown
        session.change(armed=True, situation=Situation.FLYING)
        await until(pilot, lambda: app.writing.flying)
        assert not app.writing.measured
        session.change(armed=False)
        await until(pilot, lambda: app.writing.measured)
        await until(pilot, lambda: "promised at most" in screen(app))
        worst = {
            number: max(r.before for r in v.heading_error) for number, v in check(flown).items()
        }
        hover = {c.fit.compass: quoted(c)["u"] for c in app.writing.promised.compasses}
        for promise in app.writing.measured:
            assert promise.u == hover[promise.compass]
            assert 0.0 < promise.measured <= worst[promise.compass]
            assert promise.promised == pytest.approx(0.1 + 0.006 * promise.u, abs=1e-6)


@pytest.mark.parametrize(
    ("measured", "doubt", "says"),
    [
        (0.3, 0.1, "promised at most 0.4°, measured 0.3° ✓"),
        (0.5, 0.2, "measured 0.5° ?: more than promised, but"),
        (1.2, 0.2, "measured 1.2° ✗: more than promised, so fit this flight"),
    ],
)
def test_a_promise_is_kept_broken_or_not_to_be_told(measured, doubt, says):
    assert says in Promise(1, 24.0, "current", 0.4, measured, doubt).sentence


def measured(*errors: tuple[float, float, float]) -> Verdict:
    """What a flight shows: load, error in force, at most."""
    rows = tuple(HeadingError(u, before, before, p95) for u, before, p95 in errors)
    return replace(made.result(1).verdict, heading_error=rows)


def test_a_promise_is_told_of_the_hover_and_of_another_load_only_where_it_is_broken_there():
    analysis = made.analysis(Grade.GOOD)
    hover = quoted(analysis.compasses[0])["u"]
    kept = measured((hover - 10.0, 0.0, 0.1), (hover + 10.0, 0.1, 0.2))
    broken = measured((hover - 10.0, 0.0, 0.1), (hover, 0.1, 0.2), (hover + 10.0, 9.0, 9.5))
    unsure = measured((hover - 10.0, 0.0, 0.1), (hover, 0.1, 0.2), (hover + 10.0, 0.9, 9.5))
    for found in (kept, unsure):
        (promise,) = promises(analysis, {1: found})
        assert (promise.u, promise.kept, promise.elsewhere) == (hover, Kept.YES, None)
    (promise,) = promises(analysis, {1: broken})
    assert promise.u == hover
    at = words.quantity(hover + 10.0, "current")
    assert f"✓, but at {at}: promised" in promise.sentence
    assert promise.sentence.endswith("so fit this flight and write again")


def test_a_promise_is_not_told_of_a_load_that_was_not_flown():
    analysis = made.analysis(Grade.GOOD)
    hover = quoted(analysis.compasses[0])["u"]
    (promise,) = promises(analysis, {1: measured((hover + 5.0, 0.1, 0.2), (hover + 9.0, 0.2, 0.3))})
    assert promise.u == hover + 5.0


def _at(current: float, *, written: bool = False):
    """Compass 1 looking north-west, level, as the vehicle reports it at a current."""
    field = [150.0, 150.0, 430.0]
    pushed = [
        f + (0.0 if written else current * k) for f, k in zip(field, made.INTERFERENCE, strict=True)
    ]
    heading = math.degrees(math.atan2(-pushed[1], pushed[0])) % 360.0
    return made.compass_now(1, field=tuple(map(float, pushed)), heading_deg=heading)


# --- the unforeseen ---------------------------------------------------------------------------


async def test_even_a_mistake_of_ours_ends_in_a_sentence_and_not_in_a_traceback(
    tmp_path, monkeypatch, capsys
):
    def mistaken(screen) -> None:
        raise ZeroDivisionError("division by zero")

    app = scripted.app(tmp_path)

    async def go_wrong() -> None:
        async with app.run_test() as pilot:
            await until(pilot, lambda: app.choices)
            monkeypatch.setattr(type(app.screen), "draw", mistaken)
            app.call_later(app.redraw)
            await until(pilot, lambda: not app.is_running)

    with pytest.raises(ZeroDivisionError):
        await go_wrong()
    said = capsys.readouterr().err
    assert "This should not have happened: ZeroDivisionError: division by zero." in said
    assert "Traceback" not in said
    assert app.return_code == 1


# --- leaving ----------------------------------------------------------------------------------


async def test_quitting_with_unwritten_results_asks(tmp_path):
    async with scripted.app(tmp_path, session=disarmed()).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "q")
        await until(pilot, lambda: "not written anywhere yet" in screen(pilot.app))
        await press(pilot, "enter")
        assert pilot.app.is_running
        await press(pilot, "q")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        await pilot.press("y")
        await until(pilot, lambda: not pilot.app.is_running)


async def test_quitting_in_the_middle_of_a_write_puts_everything_back_first(tmp_path):
    session = disarmed()
    session.slow = True
    before = dict(session.held)
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await fitted(pilot)
        await press(pilot, "w")
        await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))
        await pilot.press("y")
        await until(pilot, session.writing.is_set)
        await pilot.press("q")
        await until(pilot, lambda: "puts everything back" in screen(pilot.app))
        await pilot.press("y")
        await until(pilot, lambda: not pilot.app.is_running)
    assert session.closed
    assert session.held == before


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
async def test_leaving_while_a_flight_is_recorded_asks(tmp_path, key):
    session = ScriptedSession(made.snapshot(situation=Situation.FLYING))
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await press(pilot, "n", key)
        await until(pilot, lambda: "The recording goes on." in screen(pilot.app))
        await press(pilot, "ctrl+c")
        assert isinstance(pilot.app.screen, Confirm)
        await press(pilot, "n")
        assert not isinstance(pilot.app.screen, Confirm)
        assert pilot.app.is_running


async def test_quitting_with_nothing_to_lose_does_not_ask_and_closes_the_link(tmp_path):
    session = disarmed()
    session.change(situation=Situation.GROUND)
    async with scripted.app(tmp_path, session=session).run_test() as pilot:
        await connected(pilot)
        await pilot.press("q")
        await until(pilot, lambda: not pilot.app.is_running)
    assert session.closed
