"""What a write is going to do, and to which vehicle it may do it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from fake_autopilot import DEVICES, NEW, OLD, QUAD, WANTED, FakeAutopilot

from magcomp.errors import ParameterFileError, VehicleRefusedError, WriteError
from magcomp.model import ParameterSet, Vehicle, compasses_of
from magcomp.writing.events import (
    Intends,
    Outcome,
    Progress,
    Reason,
    Restarted,
    Stage,
    Standing,
    Written,
)
from magcomp.writing.files import parse_parameters, read_parameter_file, write_parameter_file
from magcomp.writing.journal import Journal, journal_path, mark_restored, read_journal
from magcomp.writing.plan import Change, plan, relevant_names

HELD = FakeAutopilot(OLD).values


def wanting(vehicle: Vehicle | None = QUAD, **values: float) -> ParameterSet:
    return ParameterSet(values, vehicle)


def test_the_difference_is_told_old_to_new_with_the_switch_last() -> None:
    changes = plan(HELD, wanting(COMPASS_MOTCT=1.0, COMPASS_MOT_X=5.0), QUAD).changes
    assert changes == (
        Change("COMPASS_MOT_X", OLD["COMPASS_MOT_X"], 5.0),
        Change("COMPASS_MOTCT", 2.0, 1.0),
    )


def test_differences_below_float32_are_none() -> None:
    wanted = wanting(COMPASS_MOT_X=OLD["COMPASS_MOT_X"] + 1e-12)
    assert plan(HELD, wanted, QUAD).changes == ()


def test_the_backup_holds_every_calibration_value_and_the_devices(tmp_path: Path) -> None:
    backup = plan(HELD, wanting(COMPASS_MOT_X=5.0), replace(QUAD, compasses=())).backup
    assert {name: backup.values[name] for name in OLD} == OLD
    assert backup.vehicle == QUAD
    write_parameter_file(tmp_path / "b.param", backup)
    assert read_parameter_file(tmp_path / "b.param") == backup


def test_restoring_is_a_plan_of_the_backup() -> None:
    backup = plan(HELD, WANTED, QUAD).backup
    after = {**HELD, **NEW}
    changes = plan(after, backup, QUAD).changes
    assert {change.name: change.new for change in changes} == OLD


def test_vectors_without_switch_keep_the_switch() -> None:
    todo = plan(HELD, wanting(COMPASS_MOT_X=5.0), QUAD)
    assert todo.switches == {"COMPASS_MOTCT": 2.0, "COMPASS_PMOT_EN": 0.0}
    assert todo.warnings == ()


def test_vectors_that_will_not_be_in_force_are_warned_about() -> None:
    todo = plan({**HELD, "COMPASS_MOTCT": 0.0}, wanting(COMPASS_MOT_X=5.0), QUAD)
    assert todo.warnings == ("COMPASS_MOTCT stays 0: the compensation will not be in force.",)


@pytest.mark.parametrize(
    ("held", "wanted", "warning"),
    [
        ({}, {"COMPASS_OFS_X": -1900.0}, "COMPASS_OFS_X -1900 is beyond COMPASS_OFFS_MAX 1800"),
        ({"COMPASS_OFFS_MAX": 500.0}, {"COMPASS_OFS2_Z": 600.0}, "beyond COMPASS_OFFS_MAX 500"),
        ({}, {"COMPASS_SCALE2": 1.7}, "COMPASS_SCALE2 1.7 is out of limits"),
        ({"COMPASS_PMOT_EN": 1.0}, {"COMPASS_MOT_X": 1.0}, "COMPASS_PMOT_EN is on"),
    ],
)
def test_what_the_firmware_will_not_like_is_warned_about(
    held: dict[str, float], wanted: dict[str, float], warning: str
) -> None:
    warnings = plan({**HELD, **held}, wanting(**wanted), QUAD).warnings
    assert any(warning in text for text in warnings)


def test_what_is_not_compass_calibration_is_left_out() -> None:
    wanted = wanting(COMPASS_MOT_X=5.0, ARMING_CHECK=1.0, COMPASS_DEV_ID=float(DEVICES[0]))
    todo = plan(HELD, wanted, QUAD)
    assert todo.left_out == ("ARMING_CHECK", "COMPASS_DEV_ID")
    assert [change.name for change in todo.changes] == ["COMPASS_MOT_X"]


FULL = wanting(
    COMPASS_MOT_X=5.0,
    COMPASS_PRIMARY=0.0,
    COMPASS_DEV_ID=float(DEVICES[0]),
    STAT_RUNTIME=9.0,
    ARMING_CHECK=1.0,
    COMPASS_USE2=0.0,
    OLD_NAME=3.0,
)
"""As an old firmware saved it: the vehicle no longer knows COMPASS_PRIMARY and OLD_NAME."""
NOW = {**HELD, "ARMING_CHECK": 72.0, "COMPASS_USE2": 1.0, "STAT_RUNTIME": 5.0}


def test_of_an_old_full_file_only_the_compass_calibration_is_written() -> None:
    todo = plan(NOW, FULL, QUAD)
    assert [change.name for change in todo.changes] == ["COMPASS_MOT_X"]
    assert set(todo.left_out) == set(FULL.values) - {"COMPASS_MOT_X"}


def test_the_rest_of_a_full_file_is_written_on_request_and_can_be_brought_back() -> None:
    todo = plan(NOW, FULL, QUAD, everything=True)
    assert todo.changes == (
        Change("COMPASS_MOT_X", OLD["COMPASS_MOT_X"], 5.0),
        Change("ARMING_CHECK", 72.0, 1.0),
        Change("COMPASS_USE2", 1.0, 0.0),
    )
    assert todo.left_out == ("COMPASS_PRIMARY", "COMPASS_DEV_ID", "STAT_RUNTIME", "OLD_NAME")
    back = plan({**NOW, **todo.new}, todo.backup, QUAD, everything=True)
    assert {c.name: c.new for c in back.changes} == {c.name: c.old for c in todo.changes}


def test_of_the_rest_what_no_backup_could_bring_back_is_left_out() -> None:
    todo = plan({**NOW, "ARMING_CHECK": float("nan")}, FULL, QUAD, everything=True)
    assert "ARMING_CHECK" in todo.left_out


def test_what_a_file_leaves_in_doubt_is_warned_about() -> None:
    wanted = replace(wanting(COMPASS_MOT_X=5.0), warnings=("A stands twice",))
    assert plan(HELD, wanted, QUAD).warnings == ("A stands twice.",)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (wanting(ARMING_CHECK=1.0), "must hold compass calibration"),
        (wanting(COMPASS_MOTCT=3.0), "COMPASS_MOTCT must be one of 0, 1, 2; instead received 3"),
        (wanting(COMPASS_MOT_X=float("nan")), "COMPASS_MOT_X"),
    ],
)
def test_a_set_that_makes_no_sense_is_refused(wanted: ParameterSet, message: str) -> None:
    with pytest.raises(ParameterFileError, match=message):
        plan(HELD, wanted, QUAD)


def test_a_name_the_vehicle_does_not_know_is_refused() -> None:
    wanted = wanting(COMPASS_MOT_X=5.0, CAL_MAG0_XOFF=1.0)
    with pytest.raises(WriteError, match="CAL_MAG0_XOFF must exist on the vehicle"):
        plan(HELD, wanted, QUAD)


def test_a_vehicle_that_cannot_be_backed_up_is_refused() -> None:
    with pytest.raises(WriteError, match="COMPASS_OFS3_X must be a finite number on the vehicle"):
        plan({**HELD, "COMPASS_OFS3_X": float("nan")}, WANTED, QUAD)


STRANGERS = [
    replace(QUAD, autopilot="px4"),
    replace(QUAD, system=7),
    replace(QUAD, compasses=compasses_of((1, 2, 3))),
    replace(QUAD, compasses=compasses_of((*DEVICES[1:], DEVICES[0]))),
    replace(QUAD, compasses=compasses_of((*DEVICES, 4))),
    replace(QUAD, compasses=compasses_of((DEVICES[0], DEVICES[2]))),
    replace(QUAD, uid="270051001551353337393732"),
    replace(QUAD, uid="", board="board 9"),
]


@pytest.mark.parametrize("owner", STRANGERS)
def test_another_vehicle_is_refused_with_both_named(owner: Vehicle) -> None:
    wanted = wanting(owner, COMPASS_MOT_X=5.0)
    with pytest.raises(VehicleRefusedError) as refused:
        plan(HELD, wanted, QUAD)
    devices = ", ".join(map(str, owner.device_ids))
    title = {"ardupilot": "ArduPilot", "px4": "PX4"}[owner.autopilot]
    named = f"{title} system {owner.system} with compasses {devices}, {owner.board}"
    assert named in str(refused.value)
    if owner.uid:
        assert f"flight controller {owner.uid}" in str(refused.value)
    assert (
        "ArduPilot system 1 with compasses 97539, 131874, 263178, board 140 and flight controller "
        "270051001551353337393731"
    ) in str(refused.value)


@pytest.mark.parametrize("owner", STRANGERS)
def test_another_vehicle_is_written_on_request_and_warned_about(owner: Vehicle) -> None:
    todo = plan(HELD, wanting(owner, COMPASS_MOT_X=5.0), QUAD, any_vehicle=True)
    assert "Another vehicle is written on request" in todo.warnings[0]


def test_a_log_that_knew_fewer_compasses_is_the_same_vehicle() -> None:
    owner = replace(QUAD, compasses=QUAD.compasses[1:])
    assert plan(HELD, wanting(owner, COMPASS_MOT_X=5.0), QUAD).warnings == ()


def test_a_set_without_owner_is_refused_unless_it_holds_device_ids() -> None:
    with pytest.raises(VehicleRefusedError, match="must say which vehicle they belong to"):
        plan(HELD, wanting(None, COMPASS_MOT_X=5.0), QUAD)
    dump = {"COMPASS_DEV_ID": DEVICES[0], "COMPASS_DEV_ID2": DEVICES[1], "COMPASS_MOT_X": 5.0}
    (warning,) = plan(HELD, wanting(None, **dump), QUAD).warnings
    assert "The parameters give no number of the flight controller" in warning
    with pytest.raises(VehicleRefusedError, match="the vehicle must be compasses 5"):
        plan(HELD, wanting(None, **{**dump, "COMPASS_DEV_ID": 5.0}), QUAD)


def test_a_set_without_device_ids_is_warned_about() -> None:
    owner = replace(QUAD, compasses=(), uid="")
    assert "name no compass" in plan(HELD, wanting(owner, COMPASS_MOT_X=5.0), QUAD).warnings[0]


def test_a_vehicle_without_number_is_warned_about() -> None:
    (warning,) = plan(HELD, wanting(COMPASS_MOT_X=5.0), replace(QUAD, uid="")).warnings
    assert "The vehicle gives no number of the flight controller" in warning


def test_a_board_that_only_its_firmware_names_is_not_compared() -> None:
    owner = replace(QUAD, board="CUBEPILOT_CUBEORANGE")
    assert plan(HELD, wanting(owner, COMPASS_MOT_X=5.0), QUAD).warnings == ()


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_relevant_names_are_names_and_hold_what_is_wanted(autopilot: str) -> None:
    names = relevant_names(autopilot, wanting(COMPASS_PMOT1_X=1.0, ARMING_CHECK=1.0))
    assert "COMPASS_PMOT1_X" in names
    assert "ARMING_CHECK" not in names
    rest = relevant_names(autopilot, wanting(ARMING_CHECK=1.0, STAT_RUNTIME=1.0), everything=True)
    assert "ARMING_CHECK" in rest
    text = "".join(f"{name},0\n" for name in names)
    assert parse_parameters(text, "names").values == dict.fromkeys(names, 0.0)


OFF = Intends(Stage.OFF, {"COMPASS_MOTCT": 0.0})
WRITE = Intends(Stage.WRITE, {"COMPASS_MOT_X": 5.0})
ON = Intends(Stage.ON, {"COMPASS_MOTCT": 1.0})
WROTE = Written("COMPASS_MOT_X", 5.0)


@pytest.mark.parametrize(
    ("events", "standing"),
    [
        ([], Standing.OLD),
        ([Restarted("a gap")], Standing.OLD),
        ([OFF], Standing.UNSURE),
        ([OFF, WRITE, WROTE], Standing.OFF),
        ([OFF, WRITE, OFF], Standing.UNSURE),
        ([OFF, WRITE, ON], Standing.UNSURE),
        ([OFF, WRITE, Restarted("a reboot")], Standing.UNSURE),
        ([OFF, WRITE, ON, Outcome(Standing.NEW)], Standing.NEW),
        ([OFF, Outcome(Standing.OLD, Reason.STOPPED, "it was interrupted")], Standing.OLD),
    ],
)
def test_a_journal_tells_what_stands(tmp_path: Path, events: list, standing: Standing) -> None:
    backup = tmp_path / "b.param"
    with Journal(backup, plan(HELD, WANTED, QUAD)) as journal:
        journal.record([*events, Progress(Stage.OFF, "COMPASS_MOTCT", 1, 1)])
    state = read_journal(backup)
    assert (state.backup, state.standing) == (backup, standing)
    assert state.outcome == next((e for e in events if isinstance(e, Outcome)), None)


def test_a_journal_cut_anywhere_still_tells(tmp_path: Path) -> None:
    backup = tmp_path / "b.param"
    with Journal(backup, plan(HELD, WANTED, QUAD)) as journal:
        journal.record([OFF, WRITE, WROTE])
    path = journal_path(backup)
    whole = path.read_bytes()
    first = whole.index(b"\n") + 1
    for end in range(first, len(whole)):
        path.write_bytes(whole[:end])
        assert read_journal(path).standing in {Standing.OLD, Standing.UNSURE, Standing.OFF}
        mark_restored(backup)
        assert read_journal(path).restored


@pytest.mark.parametrize("text", ["", "{}\n", "not json\n", '{"event": "Outcome"}\n', "[]\n"])
def test_what_is_no_journal_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "b.journal"
    path.write_text(text)
    with pytest.raises(ParameterFileError, match="must be a journal that magcomp wrote"):
        read_journal(path)


def test_a_missing_journal_is_one_sentence_and_needs_no_mark(tmp_path: Path) -> None:
    with pytest.raises(ParameterFileError, match="must be a readable journal"):
        read_journal(tmp_path / "b.param")
    mark_restored(tmp_path / "b.param")
    assert not list(tmp_path.iterdir())
