"""Nothing is said by colour alone, and every number has its name."""

from __future__ import annotations

import queue
import re
import subprocess
import sys
import threading
from dataclasses import replace

import made
import numpy as np
import pytest
import scripted
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from scripted import screen, until
from textual.color import Color

from magcomp.analysis import Options
from magcomp.errors import WriteError
from magcomp.live.guide import Guidance
from magcomp.live.progress import Bound, HoverBound, hover_bound
from magcomp.model import Grade, ParameterSet
from magcomp.report.ascii import is_ascii_only, plain
from magcomp.tui.before_after import HeadingPair, HeadingWatch, heading_pairs
from magcomp.tui.changes import after_event, change_rows
from magcomp.tui.fits import difference_deg, fit_rows
from magcomp.tui.next_step import explain
from magcomp.tui.pictures import round_ticks
from magcomp.tui.state import State
from magcomp.tui.themes import SUN
from magcomp.tui.watcher import Watcher
from magcomp.tui.widgets.bars import bar
from magcomp.tui.widgets.coverage_map import LevelRow, LevelTable
from magcomp.tui.widgets.heading_ring import HeadingRing, Ring
from magcomp.tui.widgets.live_facts import Facts, LiveFacts, bound_words, sparkline, trend
from magcomp.tui.widgets.plots import vector_words
from magcomp.tui.work import Writing
from magcomp.writing.events import Mismatch, Outcome, Reason, RollingBack, Standing, Written


def test_importing_the_command_line_does_not_import_textual():
    code = (
        "import sys, magcomp.cli.app, magcomp.cli.tui\n"
        "sys.exit(sum(name.startswith('textual') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_first_screen_does_not_wait_for_what_only_a_fit_needs():
    code = "import sys, magcomp.tui; sys.exit('scipy' in sys.modules or 'plotly' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_without_a_terminal_the_command_says_what_to_use():
    command = [sys.executable, "-m", "magcomp", "tui"]
    ended = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert "magcomp tui must run in a terminal" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize("grade", list(Grade))
async def test_a_grade_is_a_word_and_a_sign_without_any_colour(tmp_path, monkeypatch, grade):
    monkeypatch.setenv("NO_COLOR", "1")
    app = scripted.app(tmp_path)
    async with app.run_test() as pilot:
        app.set_work(made.work(grade, Grade.GOOD))
        app.action_go("fit")
        await until(pilot, lambda: "Heading error" in screen(app))
        sign = {"good": "●", "marginal": "◐", "rejected": "○"}[grade]
        assert f"[1] {sign} {grade.upper()}" in screen(app)


async def test_an_unhealthy_compass_has_a_sign_of_its_own(tmp_path):
    session = scripted.ScriptedSession()
    app = scripted.app(tmp_path, session=session)
    async with app.run_test() as pilot:
        app.follow(session)
        app.set_work(made.work(live=True))
        app.action_go("record")
        await until(pilot, lambda: "Compasses" in screen(app))
        await until(pilot, lambda: "! 3 481 mG" in screen(app))


def test_in_sunlight_every_colour_stands_out_seven_to_one():
    def luminance(name: str) -> float:
        parts = [part / 255 for part in Color.parse(name).rgb]
        linear = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))

    paper = luminance(SUN.background)
    inks = (SUN.foreground, SUN.primary, SUN.accent, SUN.success, SUN.warning, SUN.error)
    for ink in (*inks, SUN.variables["quiet"]):
        assert (paper + 0.05) / (luminance(ink) + 0.05) >= 7.0


def test_fits_that_agree_are_not_apart_and_one_per_ampere_off_is_apart_by_its_angle():
    one = made.result(1).fit
    assert difference_deg(one, one) < 1e-9
    off = replace(one.correction, motor=one.correction.vector + np.array([0.0, 1.0, 0.0]))
    horizontal = np.sqrt(one.strength**2 - one.vertical**2)
    level = np.degrees(np.arcsin(min(54.0 / horizontal, 1.0)))
    assert difference_deg(one, replace(one, correction=off)) >= level * 0.95


def test_a_fit_made_anew_with_the_same_options_takes_the_place_of_the_old_one():
    work = made.work()
    again = work.with_analysis(made.analysis(), work.pictures)
    assert len(again.tried) == 1
    other = replace(again, options=Options(method="sweep"))
    other = other.with_analysis(made.analysis(Grade.MARGINAL), work.pictures)
    assert len(other.tried) == 2
    back = other.with_other_fit()
    assert back.analysis is again.analysis
    assert back.options == again.options
    assert back.with_other_fit().analysis is other.analysis
    rows = fit_rows(back.tried, back.analysis, 1)
    assert [row.shown for row in rows] == [True, False]
    assert [row.grade for row in rows] == [Grade.GOOD, Grade.MARGINAL]


def test_the_live_bound_is_that_of_the_worst_compass_worth_writing_at_the_hover():
    analysis = made.analysis(Grade.REJECTED, Grade.GOOD)
    bound = hover_bound(analysis, {"current": 25.0, "throttle": 0.4})
    assert (bound.u, bound.regressor) == (25.0, "current")
    assert bound.degrees == pytest.approx((0.1 + 0.006 * 25.0,))
    assert hover_bound(made.analysis(Grade.REJECTED), {}) is None


def test_the_hover_is_the_load_of_half_the_flight_without_the_idling():
    watch = HoverBound()
    for load, times in ((0.4, 50), (22.0, 9), (24.0, 10), (40.0, 8)):
        for _ in range(times):
            watch.look(True, {"current": load}, None, 0.0)
    watch.look(False, {"current": 99.0}, made.analysis(), 0.0)
    assert watch.bound.u == 24.0
    watch.look(True, {"current": 24.0}, made.analysis(), 0.0)
    assert len(watch.bound.degrees) == 2


@pytest.mark.parametrize(
    ("enough_at_s", "recorded_s", "enough", "words"),
    [
        (140.0, 98.0, False, "; about 40 s more"),
        (140.0, 129.0, False, "; about 10 s more"),
        (140.0, 139.5, False, "; about 5 s more"),
        (240.0, 61.0, False, "; about 3 min more"),
        (140.0, 141.0, False, ""),
        (140.0, 98.0, True, ""),
        (None, 98.0, False, ""),
    ],
)
def test_the_bound_says_how_much_longer_until_it_is_enough(enough_at_s, recorded_s, enough, words):
    live = made.snapshot(
        bound=Bound(24.0, "current", (2.0, 1.3), enough_at_s),
        recorded_s=recorded_s,
        guidance=Guidance("keep flying", 0.5, enough=enough),
    )
    assert bound_words(live, 200).endswith(f"at 24 A{words}")


@pytest.mark.parametrize("room", range(28, 90, 3))
def test_what_a_pilot_acts_on_is_said_however_narrow_the_terminal_is(room):
    bound = Bound(24.0, "current", (2.0, 1.7, 1.3), 140.0)
    live = made.snapshot(bound=bound, recorded_s=98.0, guidance=Guidance("keep flying", 0.5))
    said = bound_words(live, room)
    assert said.startswith("at hover at most 1.3°")
    assert said.endswith("; about 40 s more")
    assert len(said) <= max(room, len("at hover at most 1.3°; about 40 s more"))


@pytest.mark.parametrize("width", range(18, 70, 4))
@pytest.mark.parametrize("height", range(5, 30, 3))
def test_two_headings_on_the_ring_never_run_into_one_number(width, height):
    ring = Ring(tuple(range(30, 54)), None, None)
    drawn = HeadingRing().picture(ring, width, height).plain
    assert all(len(digits) <= 2 for digits in re.findall(r"\d+", drawn))


def test_a_ring_too_small_for_numbers_has_a_bar_for_each_heading():
    best = (*(40,) * 12, *(80,) * 11, None)
    drawn = HeadingRing().picture(Ring(best, None, None), 36, 8).plain
    assert (drawn.count("▄"), drawn.count("█"), drawn.count("·")) == (12, 11, 1)


@pytest.mark.parametrize("now", range(10))
@pytest.mark.parametrize("height", [4, 6, 8])
def test_the_throttle_now_is_always_in_the_table_of_levels(now, height):
    rows = tuple(LevelRow(level, 9.0, 3, False, level == now) for level in range(10))
    drawn = LevelTable().picture(rows, 30, height).plain.split("\n")
    assert len(drawn) == height
    assert any(line.startswith(f"▸{10 * now:3d}–") for line in drawn)


@pytest.mark.parametrize(
    ("width", "said"),
    [
        (78, "missing: headings, climbs and descents, a sure answer"),
        (58, "missing: headings, …"),
    ],
)
def test_what_is_missing_is_not_cut_within_a_name(width, said):
    facts = Facts(0.7, ("headings", "climbs and descents", "a sure answer"), "a.tlog", "1 MB", 9, 9)
    line = LiveFacts().picture(facts, width, 2).plain.split("\n")[0]
    assert line.endswith(said)
    assert len(line) <= width


def test_a_fit_is_outdated_once_more_was_flown_and_not_by_standing_about():
    work = made.work(live=True)
    fitted_s = work.recording.duration_s
    live = made.snapshot(armed_until_s=fitted_s + 30.0, recorded_s=fitted_s + 30.0)
    assert State(work, live=live).is_outdated
    standing = replace(live, armed_until_s=fitted_s, recorded_s=fitted_s + 300.0)
    assert not State(work, live=standing).is_outdated
    asked = replace(work, options=Options(end=60.0))
    assert not State(asked, live=live).is_outdated


def test_no_snapshot_is_posted_before_the_last_one_is_on_the_screen(monkeypatch):
    monkeypatch.setattr("magcomp.tui.watcher.EVERY_S", 0.0)
    posted, on_its_way, overtaken = queue.Queue(), threading.Event(), threading.Event()

    def post(snapshot):
        if on_its_way.is_set():
            overtaken.set()
        on_its_way.set()
        posted.put(snapshot)

    watcher = Watcher(made.snapshot, post, posted.put)
    try:
        for _ in range(50):
            assert posted.get(timeout=scripted.PATIENCE_S)
            on_its_way.clear()
            watcher.drawn()
    finally:
        watcher.close()
    assert not overtaken.is_set()


@pytest.mark.parametrize("room", [32, 45, 80])
def test_the_vector_below_its_picture_keeps_its_unit(room):
    said = vector_words(made.result(1).fit, room)
    assert said.endswith("per A")
    assert len(said) <= room
    assert said.startswith("f " if room == 32 else "forward ")


def test_a_mark_is_forgotten_once_the_vehicle_has_moved_on():
    watch = HeadingWatch()
    watch.mark((HeadingPair(1, 10.0, 10.0),))
    watch.look((HeadingPair(1, 190.0, 180.0),), 0.0)
    watch.unmark()
    (pair,) = watch.look((HeadingPair(1, 190.0, 180.0),), 0.1)
    assert pair.moved_before is None
    assert watch.trace(1).taken_out == (-10.0,)


@pytest.mark.parametrize(
    ("degrees", "word"),
    [
        ((2.0,), "steady"),
        ((4.0, 3.0, 2.0), "falling"),
        ((2.0, 2.02), "steady"),
        ((1.0, 2.0), "rising"),
    ],
)
def test_a_bound_falls_rises_or_is_steady(degrees, word):
    assert trend(Bound(24.0, "current", degrees)) == word


@given(values=st.lists(st.floats(0.0, 180.0), min_size=1, max_size=60))
def test_a_sparkline_has_a_sign_for_each_of_the_last_values(values):
    assert len(sparkline(tuple(values))) == (min(len(values), 12) if max(values) > 0.0 else 0)


@given(text=st.text())
def test_a_terminal_without_unicode_gets_as_many_cells_of_ascii(text):
    assert plain(text).isascii()
    assert cell_len(plain(text)) == cell_len(text)


@pytest.mark.parametrize(
    ("encoding", "environment", "only"),
    [
        ("utf-8", {"LANG": "en_GB.UTF-8"}, False),
        ("utf-8", {}, False),
        ("utf-8", {"LANG": "C"}, True),
        ("utf-8", {"LANG": "C", "LC_CTYPE": "C.UTF-8"}, True),
        ("utf-8", {"LANG": "C", "LC_CTYPE": "en_GB.UTF-8"}, False),
        ("utf-8", {"LANG": "C", "LC_ALL": "C.UTF-8"}, False),
        ("ascii", {"LANG": "en_GB.UTF-8"}, True),
        ("ANSI_X3.4-1968", {}, True),
        (None, {}, False),
    ],
)
def test_who_has_only_ascii_is_known_by_encoding_and_locale(encoding, environment, only):
    assert is_ascii_only(encoding, environment) is only


async def test_every_screen_is_drawn_in_ascii_where_there_is_nothing_else(tmp_path):
    app = scripted.app(tmp_path, ascii_only=True)
    async with app.run_test() as pilot:
        app.set_work(made.work())
        app.action_go("fit")
        await until(pilot, lambda: "Heading error" in screen(app))
        assert scripted.picture(app).isascii()
        app.set_work(made.work(live=True))
        app.follow(scripted.ScriptedSession(made.snapshot(connected=False)))
        app.action_go("record")
        await until(pilot, lambda: "as last heard" in screen(app))
        assert scripted.picture(app).isascii()


@given(share=st.floats(allow_nan=False), width=st.integers(0, 200))
def test_a_bar_is_as_wide_as_it_should_be_whatever_it_shows(share, width):
    assert bar(share, width).cell_length == width


@given(
    low=st.floats(-1e6, 1e6),
    span=st.floats(1e-3, 1e6),
    most=st.integers(2, 12),
)
def test_ticks_are_round_few_and_inside(low, span, most):
    ticks = round_ticks(low, low + span, most)
    assert len(ticks) <= most
    for tick in ticks:
        assert low - 1e-6 * span <= tick <= low + span * (1 + 1e-6)


def test_only_what_differs_as_float32_is_a_change():
    wanted = ParameterSet({"COMPASS_OFS_X": 12.1, "COMPASS_MOT_X": -1.5, "COMPASS_DIA_X": 1.0})
    present = {"COMPASS_OFS_X": float(np.float32(12.1)), "COMPASS_MOT_X": 0.0}
    rows = change_rows(present, wanted)
    assert [(row.name, row.old, row.new) for row in rows] == [
        ("COMPASS_MOT_X", "0", "-1.5"),
        ("COMPASS_DIA_X", "?", "1"),
    ]


def test_each_row_tells_how_far_its_parameter_is():
    rows = change_rows({}, ParameterSet({"COMPASS_MOT_X": 1.0, "COMPASS_MOT_Y": 2.0}))
    rows = after_event(rows, Written("COMPASS_MOT_X", 1.0))
    assert [row.state for row in rows] == ["written", ""]
    rows = after_event(rows, Mismatch("COMPASS_MOT_Y", 2.0, 0.5))
    assert [row.state for row in rows] == ["written", "holds 0.5"]
    rows = after_event(rows, RollingBack(Reason.MISMATCH, ""))
    assert {row.state for row in rows} == {"putting back"}
    assert {row.state for row in after_event(rows, Outcome(Standing.NEW))} == {"✓ read back"}
    failed = Outcome(Standing.OFF, Reason.LINK_LOST, "gone")
    assert {row.state for row in after_event(rows, failed)} == {"not sure"}


def test_a_heading_that_passes_north_has_moved_by_little():
    watch = HeadingWatch()
    watch.mark((HeadingPair(1, 359.0, 1.0),))
    (pair,) = watch.look((HeadingPair(1, 3.0, 358.0),), 0.0)
    assert (pair.moved_before, pair.moved_after) == (4.0, -3.0)
    (pair,) = watch.look((HeadingPair(1, 359.0, 1.0),), 0.1)
    assert (pair.moved_before, pair.largest_before, pair.largest_after) == (0.0, 4.0, 3.0)


def test_without_current_nothing_is_invented():
    live = made.snapshot(current=None)
    assert all(pair.after is None for pair in heading_pairs(live, made.work(), Writing()))


def test_a_command_that_a_sentence_ends_with_stands_as_it_is_typed():
    sentence, _ = explain(
        WriteError("the write failed. Bring it back with:\n  magcomp restore a.p")
    )
    assert sentence == "The write failed. Bring it back with:\nmagcomp restore a.p"
    sentence, _ = explain(WriteError("the write failed"))
    assert sentence == "The write failed."
