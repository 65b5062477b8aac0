"""What firmware from 3.0 to 4.7 wrote under other names, in other units or in other messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dataflash_writer import FMT, MAG, MSG, Form, Writer

from magcomp.model import Recording
from magcomp.sources import read

ROWS = 20


def recorded(folder: Path, log: Writer) -> Recording:
    path = folder / "log.BIN"
    path.write_bytes(log.binary())
    return read(path)


def filled(*rows: tuple[Form, tuple[float | str, ...]]) -> Writer:
    """Each form's row again and again, at 10 Hz."""
    forms = {form.name: form for form, _ in rows}
    log = Writer(forms=(FMT, MSG, MAG, *forms.values()))
    for k in range(ROWS):
        for form, values in rows:
            log.add(form, 100_000 * (k + 1), *values)
    return log


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (Form(1, "CURR", "Qhh", "TimeUS,Volt,Curr"), Form(2, "CUR2", "Qhh", "TimeUS,Volt,Curr")),
        (Form(1, "CURR", "Qff", "TimeUS,Volt,Curr"), Form(2, "CUR2", "Qff", "TimeUS,Volt,Curr")),
        (Form(1, "BAT", "Qff", "TimeUS,Volt,Curr"), Form(2, "BAT2", "Qff", "TimeUS,Volt,Curr")),
    ],
    ids=["centiamperes", "amperes", "BAT without a number"],
)
def test_a_second_battery_may_have_a_message_of_its_own(tmp_path, first, second) -> None:
    unit = 100.0 if "h" in first.kinds else 1.0
    found = recorded(
        tmp_path, filled((first, (12.0 * unit, 30.0 * unit)), (second, (6.0 * unit, 2.0 * unit)))
    )
    assert set(found.current.value) == {30.0}
    assert set(found.voltage.value) == {12.0}
    assert {n: set(each.value) for n, each in found.other_currents.items()} == {1: {2.0}}


@pytest.mark.parametrize("name", ["Instance", "Inst"])
def test_batteries_of_one_message_are_told_apart_by_its_number(tmp_path, name) -> None:
    form = Form(1, "BAT", "QBff", f"TimeUS,{name},Volt,Curr")
    found = recorded(
        tmp_path, filled(*((form, (n, 12.0, amps)) for n, amps in enumerate((30.0, 2.0, 4.0))))
    )
    assert set(found.current.value) == {30.0}
    assert {n: set(each.value) for n, each in found.other_currents.items()} == {1: {2.0}, 2: {4.0}}


@pytest.mark.parametrize(
    ("banner", "column", "kind", "told", "share"),
    [
        ("ArduCopter V4.6.3 (0)", "ThO", "f", 0.4, 0.4),
        ("APM:Copter V3.2.1 (0)", "ThrOut", "h", 400, 0.4),
        ("ArduPlane V3.8.2 (0)", "ThrOut", "h", 40, 0.4),
        ("ArduPlane V4.5.7 (0)", "ThO", "f", 40.0, 0.4),
        ("ArduPlane V4.5.7 (0)", "ThO", "f", -40.0, -0.4),
    ],
)
def test_a_throttle_is_a_share_of_one_whatever_its_scale(
    tmp_path, banner, column, kind, told, share
) -> None:
    log = filled((Form(1, "CTUN", f"Q{kind}", f"TimeUS,{column}"), (told,)))
    log.add(MSG, 1, banner)
    assert recorded(tmp_path, log).throttle.value == pytest.approx(share)


def test_outputs_above_the_fourteenth_are_in_messages_of_their_own(tmp_path) -> None:
    first = Form(1, "RCOU", "QHH", "TimeUS,C1,C14")
    second = Form(2, "RCO2", "QHHHH", "TimeUS,C15,C16,C17,C18")
    third = Form(3, "RCO3", "QHH", "TimeUS,C19,C32")
    log = filled((first, (1101, 1114)), (second, (1115, 1116, 1117, 1118)), (third, (1119, 1132)))
    value = recorded(tmp_path, log).outputs.value
    assert value.shape == (ROWS, 32)
    driven = {int(n): set(value[:, n]) for n in np.flatnonzero(value.any(axis=0))}
    assert driven == {n - 1: {1100.0 + n} for n in (1, 14, 15, 16, 17, 18, 19, 32)}


def test_the_outputs_of_early_firmware_are_called_otherwise(tmp_path) -> None:
    log = filled((Form(1, "RCOU", "QHH", "TimeUS,Chan1,Chan2"), (1100, 1200)))
    assert set(map(tuple, recorded(tmp_path, log).outputs.value[:, :2])) == {(1100.0, 1200.0)}


ANGLES = "TimeUS,Roll,Pitch,Yaw"


@pytest.mark.parametrize("core", [0, 1])
def test_two_cores_may_have_messages_of_their_own(tmp_path, core) -> None:
    first, second = Form(1, "NKF1", "QccC", ANGLES), Form(2, "NKF6", "QccC", ANGLES)
    primary = Form(3, "NKF4", "Qb", "TimeUS,PI")
    log = filled((first, (1.0, 0, 0)), (second, (2.0, 0, 0)), (primary, (core,)))
    found = recorded(tmp_path, log)
    assert found.attitude_source == ("NKF6" if core else "NKF1")
    assert np.degrees(found.attitude.value[:, 0]) == pytest.approx(1.0 + core)


def test_the_attitude_is_the_best_that_was_logged(tmp_path) -> None:
    rows = [
        (Form(n, name, "QccC", ANGLES), (float(n), 0, 0))
        for n, name in enumerate(("AHR2", "NKF1", "XKF1", "ATT"), start=1)
    ]
    for count, name in enumerate(("AHR2", "NKF1", "XKF1", "ATT"), start=1):
        found = recorded(tmp_path, filled(*rows[:count]))
        assert found.attitude_source == name
        assert np.degrees(found.attitude.value[:, 0]) == pytest.approx(float(count))
        assert len(found.other_attitudes) == count - 1


@pytest.mark.parametrize(
    "names",
    [("POS",), ("POS", "GPS", "ORGN"), ("GPS", "ORGN"), ("ORGN",)],
    ids=["estimate", "estimate first", "fix before origin", "origin alone"],
)
def test_a_position_is_the_estimate_a_fix_or_the_origin(tmp_path, names) -> None:
    where = {"POS": 45.0, "GPS": 46.0, "ORGN": 47.0}
    rows = []
    for n, name in enumerate(names, start=1):
        status = ("B", ",Status", (3,)) if name == "GPS" else ("", "", ())
        form = Form(n, name, f"Q{status[0]}LLe", f"TimeUS{status[1]},Lat,Lng,Alt")
        rows.append((form, (*status[2], where[name], 8.0, 400.0)))
    assert set(recorded(tmp_path, filled(*rows)).position.value[:, 0]) == {where[names[0]]}


@pytest.mark.parametrize(
    ("form", "on", "off"),
    [
        (Form(1, "ARM", "QB", "TimeUS,ArmState"), 1, 0),
        (Form(1, "STAT", "QB", "TimeUS,Armed"), 1, 0),
        (Form(1, "EV", "QB", "TimeUS,Id"), 10, 11),
    ],
    ids=["ARM", "STAT", "EV"],
)
def test_arming_is_told_in_three_ways(tmp_path, form, on, off) -> None:
    log = filled((Form(9, "ATT", "QccC", ANGLES), (0, 0, 0)))
    log.forms = (*log.forms, form)
    log.add(form, 500_000, on)
    log.add(form, 1_500_000, off)
    armed = recorded(tmp_path, log).armed
    assert armed.value.tolist() == [0.0, 1.0, 0.0, 0.0]
    assert np.diff(armed.time)[1] == pytest.approx(1.0)


@pytest.mark.parametrize("columns", ["GMS,GWk", "TimeMS,Week"])
def test_the_date_is_that_of_the_satellites(tmp_path, columns) -> None:
    form = Form(1, "GPS", "QBIHLLe", f"TimeUS,Status,{columns},Lat,Lng,Alt")
    log = Writer(forms=(FMT, form))
    for k in range(ROWS):
        log.add(form, 1_000_000 + 100_000 * k, 3, 1000 + 100 * k, 2000, 45.0, 8.0, 400.0)
    assert recorded(tmp_path, log).start_unix_s == pytest.approx(
        315964800 - 18 + 2000 * 604800 + 1.0, abs=1.01
    )
