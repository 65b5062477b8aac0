"""Dataflash logs: what pymavlink reads, what the firmware wrote, and what no firmware would."""

from __future__ import annotations

import math
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from dataflash_writer import ATT, BAT, CTUN, FMT, HEAD, MAG, MSG, PARM, Form, Writer, short_flight
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import DFReader
from recordings import REAL_LOGS

from magcomp.analysis import analyse
from magcomp.errors import LogError, MagcompError, MissingDataError
from magcomp.model import Recording
from magcomp.sources import read
from magcomp.sources.dataflash import binary, text
from magcomp.sources.dataflash.quantities import MESSAGES
from magcomp.sources.dataflash.table import Unpacked
from magcomp.sources.source import mapped

FLIGHT = Path(__file__).parents[2] / "sitl_fixtures" / "flight.BIN"
TEXT_LOGS = [
    path for path in REAL_LOGS if path.suffix == ".log" and not path.stem.startswith("air_data")
]
BINARY_LOGS = [FLIGHT, *(path for path in REAL_LOGS if path.suffix.lower() == ".bin")]


def taken_apart(path: Path) -> Unpacked:
    with mapped(path) as data:
        return (text if path in TEXT_LOGS else binary).unpack(data, MESSAGES)


def from_bytes(folder: Path, data: bytes) -> Recording:
    path = folder / "log"
    path.write_bytes(data)
    return read(path)


# ---------------------------------------------------------------- against pymavlink


EACH = [
    pytest.param(path, marks=() if path in (FLIGHT, *BINARY_LOGS[-1:]) else pytest.mark.slow)
    for path in (*BINARY_LOGS, *TEXT_LOGS)
]


@pytest.mark.parametrize("path", EACH, ids=lambda path: path.stem)
def test_every_column_of_every_wanted_message_is_what_pymavlink_reads(path: Path) -> None:
    ours = taken_apart(path).tables
    theirs: dict[str, list[list[object]]] = {}
    names: dict[str, list[str]] = {}
    is_text = path in TEXT_LOGS
    reader = (DFReader.DFReader_text if is_text else DFReader.DFReader_binary)(str(path))
    while (message := reader.recv_match(type=list(MESSAGES))) is not None:
        kind = message.get_type()
        names[kind] = message.get_fieldnames()
        theirs.setdefault(kind, []).append([getattr(message, name) for name in names[kind]])
    reader.data_map.close()
    reader.filehandle.close()
    assert theirs.keys() == ours.keys()
    for kind, rows in theirs.items():
        for index, name in enumerate(names[kind]):
            column = [row[index] for row in rows]
            if isinstance(column[0], str):
                if kind in {"PARM", "MSG", "VER"}:
                    assert ours[kind].texts(name) == [str(cell).strip() for cell in column]
            else:
                np.testing.assert_allclose(ours[kind].numbers(name), column, rtol=1e-12)


# ---------------------------------------------------------------- what was written


@pytest.fixture(scope="module", params=["binary", "text"])
def flown(request, tmp_path_factory) -> Recording:
    log = short_flight()
    data = log.binary() if request.param == "binary" else log.text()
    return from_bytes(tmp_path_factory.mktemp("flown"), data)


def test_a_flight_is_read_in_the_models_units(flown: Recording) -> None:
    assert (flown.format, flown.duration_s) == ("dataflash", pytest.approx(12.9, abs=0.1))
    assert (flown.vehicle.kind, flown.vehicle.firmware) == ("copter", "4.5.7")
    assert (flown.vehicle.board, flown.vehicle.frame) == ("CubeOrange", "HEXA/X")
    assert flown.vehicle.device_ids == (97539,)
    assert sorted(flown.field) == [1, 2]
    np.testing.assert_array_equal(flown.field[2].value[3], (203, -3, 401))
    np.testing.assert_allclose(flown.attitude.value[5], np.radians((10.5, -3.25, 10.0)))
    np.testing.assert_allclose(flown.throttle.value[:2], (0.25, 0.251), atol=1e-6)
    np.testing.assert_allclose(flown.current.value[:2], (10.0, 11.0))
    np.testing.assert_allclose(flown.other_currents[1].value, 1.5)
    np.testing.assert_array_equal(flown.outputs.value[2, :5], (1502, 1400, 1300, 1200, 0))


def test_the_serial_number_is_that_of_autopilot_version(flown: Recording) -> None:
    words = struct.pack("<III", 0x0037003A, 0x30325116, 0x38393532)
    assert flown.vehicle.uid == words.hex()


def test_a_simulations_truth_is_left_out(flown: Recording) -> None:
    assert not any(name.startswith("SIM_") for name in flown.parameters.names)
    assert flown.parameters.whole


def test_what_was_applied_is_known_per_reading_and_to_its_fraction(flown: Recording) -> None:
    applied = flown.applied[1]
    # COMPASS_OFS_X is 12.75 and logged as 12; of the others no parameter tells the fraction.
    np.testing.assert_allclose(applied.offset.value[0], (12.75, -8.5, 0.0))
    np.testing.assert_allclose(applied.motor.value[0], (3.5, 0.0, -2.5))


def test_a_fraction_that_changes_holds_from_its_change_on(tmp_path: Path) -> None:
    log = short_flight(4.0)
    at = len(log.rows) // 2
    stamp = next(values[0] for form, values in log.rows[at:] if form is MAG)
    log.rows.insert(at, (PARM, (stamp - 50, "COMPASS_OFS_X", 12.25)))
    applied = from_bytes(tmp_path, log.binary()).applied[1].offset
    assert set(applied.value[:, 0]) == {12.25, 12.75}
    assert (np.diff(applied.value[:, 0]) <= 0).all()


def test_compasses_of_old_firmware_have_messages_of_their_own(tmp_path: Path) -> None:
    kinds, columns = "IhhhhhhhhhB", MAG.columns.replace("US,I,", "MS,").replace("MO", "MOfs")[:-2]
    forms = [Form(100 + n, f"MAG{n or ''}".replace("1", "2"), kinds, columns) for n in (0, 1)]
    old = Form(90, "CURR", "IhhhhHf", "TimeMS,ThrOut,ThrInt,Volt,Curr,Vcc,CurrTot")
    thrust = Form(91, "CTUN", "Ihh", "TimeMS,ThrIn,ThrOut")
    log = Writer(forms=(FMT, MSG, *forms, old, thrust))
    log.add(MSG, 10, "APM:Copter V3.2.1 (36b405fb)")
    for k in range(20):
        for n, form in enumerate(forms):
            log.add(form, 100 * k, 200 + n, k, 400, 5, 6, 7, 1, 2, 3, 1)
        log.add(old, 100 * k + 1, 400, 0, 1180, 1234 + k, 5000, 1.0)
        log.add(thrust, 100 * k + 2, 380, 400 + k)
    found = from_bytes(tmp_path, log.binary())
    assert sorted(found.field) == [1, 2]
    assert set(found.field[2].value[:, 0]) == {201.0}
    assert found.applied[1].motor.value[0].tolist() == [1.5, 2.5, 3.5]
    assert found.current.value[0] == pytest.approx(12.34)
    assert found.voltage.value[0] == pytest.approx(11.8)
    assert found.throttle.value[-1] == pytest.approx(0.419)


def test_the_estimators_core_in_use_tells_the_attitude_where_att_is_missing(tmp_path: Path) -> None:
    core = Form(44, "XKF1", "QBccC", "TimeUS,C,Roll,Pitch,Yaw")
    lanes = Form(47, "XKF4", "QBb", "TimeUS,C,PI")
    log = Writer(forms=(FMT, core, lanes))
    for k in range(20):
        for c in (0, 1):
            log.add(core, 1000 * k + c, c, 10.0 * c, 0, 0)
            log.add(lanes, 1000 * k + c, c, 0 if k < 8 else 1)
    roll = np.degrees(from_bytes(tmp_path, log.binary()).attitude.value[:, 0])
    np.testing.assert_allclose(roll, [0.0] * 8 + [10.0] * 12, atol=1e-9)


def test_an_unhealthy_reading_is_no_reading(tmp_path: Path) -> None:
    log = Writer()
    for k in range(20):
        log.add(MAG, 1000 * k, 0, 200, k, 400, 0, 0, 0, 0, 0, 0, int(k >= 5), 0)
    assert len(from_bytes(tmp_path, log.binary()).field[1]) == 15


@pytest.mark.parametrize("numbered", [True, False])
def test_the_speed_controllers_currents_are_summed(tmp_path: Path, numbered: bool) -> None:
    if numbered:
        forms = [Form(101, "ESC", "QBf", "TimeUS,Instance,Curr")] * 2
    else:
        forms = [Form(101 + n, f"ESC{n + 1}", "QH", "TimeUS,Curr") for n in range(2)]
    log = Writer(forms=(FMT, *{form.name: form for form in forms}.values()))
    for k in range(20):
        for n, form in enumerate(forms):
            amperes = 2.0 + n + k
            log.add(form, 1000 * k, *((n, amperes) if numbered else (100 * amperes,)))
    found = from_bytes(tmp_path, log.binary())
    np.testing.assert_allclose(found.esc_current.value, 5.0 + 2.0 * np.arange(20))
    assert found.current is None


def test_a_number_that_no_compass_or_battery_has_is_damage(tmp_path: Path) -> None:
    log = short_flight(1.0)
    log.add(MAG, 9_000_000, 163, 200, 1, 400, 12, -8, 0, 3, 0, -2, 1, 0)
    log.add(BAT, 9_000_000, 0, 1e30, -1e30)
    found = from_bytes(tmp_path, log.binary())
    assert sorted(found.field) == sorted(found.applied) == [1, 2]
    assert found.current.value.min() == 10.0


# ---------------------------------------------------------------- damage


def test_garbage_between_records_costs_nothing_but_itself(tmp_path: Path) -> None:
    log = short_flight()
    whole = from_bytes(tmp_path, log.binary())
    rng = np.random.default_rng(1)
    pieces = [form.definition() for form in log.forms]
    garbage = 0
    for number, (form, values) in enumerate(log.rows):
        pieces.append(form.record(values))
        if number % 40 == 39:
            junk = rng.integers(0, 256, int(rng.integers(1, 90)), dtype=np.uint8).tobytes()
            # What could be the beginning of a record, too.
            pieces.append(junk + HEAD + bytes([MAG.number]) + junk[:5])
            garbage += len(pieces[-1])
    found = from_bytes(tmp_path, b"".join(pieces))
    assert found.report.skipped == garbage
    assert found.report.used == whole.report.used
    np.testing.assert_array_equal(found.field[1].value, whole.field[1].value)


@pytest.mark.parametrize("told", [0, 3, 30, 60, 255])
def test_a_format_that_lies_about_its_length_costs_no_reading(tmp_path: Path, told: int) -> None:
    log = short_flight()
    whole = from_bytes(tmp_path, log.binary())
    honest = MAG.definition()
    assert log.binary().count(honest) == 1
    found = from_bytes(tmp_path, log.binary().replace(honest, MAG.definition(told)))
    assert found.report.skipped == 0
    assert found.report.frames == whole.report.frames
    np.testing.assert_array_equal(found.field[2].value, whole.field[2].value)


def test_a_header_inside_a_record_is_no_record(tmp_path: Path) -> None:
    log = Writer()
    for k in range(30):
        log.add(MSG, k, HEAD + bytes([BAT.number]) + b"\1" * 30)
        log.add(BAT, 1000 * k, 0, 12.0, 5.0)
    found = from_bytes(tmp_path, log.binary())
    assert set(found.current.value) == {5.0}
    assert found.report.frames == 60 + len(log.forms)
    assert found.report.skipped == 0
    assert found.report.notes == ()


def test_zeros_at_the_end_and_a_cut_record_are_left_out(tmp_path: Path) -> None:
    data = short_flight().binary()
    whole = from_bytes(tmp_path, data)
    for damaged in (data + bytes(70_000), data[:-7]):
        found = from_bytes(tmp_path, damaged)
        assert whole.report.frames - found.report.frames <= 1
        assert len(found.field[1]) == len(whole.field[1])


def test_a_message_redefined_half_way_is_read_by_the_definition_of_its_time(tmp_path: Path) -> None:
    before, after = BAT, Form(BAT.number, "BAT", "QfB", "TimeUS,Curr,Inst")
    records = [FMT.definition(), before.definition()]
    records += [before.record((1000 * k, 0, 12.0, 5.0)) for k in range(5)]
    records += [after.definition(), *(after.record((1000 * k, 7.0, 0)) for k in range(5, 9))]
    current = from_bytes(tmp_path, b"".join(records)).current
    assert current.value.tolist() == [5.0] * 5 + [7.0] * 4


def test_a_clock_that_starts_again_goes_on_and_a_damaged_stamp_does_not_count(
    tmp_path: Path,
) -> None:
    log = Writer()
    for k in range(60):
        t = 5_000_000 + 100_000 * k if k < 30 else 100_000 * (k - 29)
        log.add(BAT, t if k != 12 else 2**62, 0, 12.0, float(k))
    current = from_bytes(tmp_path, log.binary()).current
    assert current.value.tolist() == [float(k) for k in range(60) if k != 12]
    assert np.diff(current.time).max() < 0.3
    assert (np.diff(current.time) >= 0).all()


def test_a_clock_that_starts_again_is_told_to_the_user(tmp_path: Path) -> None:
    log = Writer()
    for k in range(60):
        log.add(BAT, 100_000 * (k % 30), 0, 12.0, float(k))
    (note,) = from_bytes(tmp_path, log.binary()).report.notes
    assert "starts again at 3 s" in note


def test_rows_without_any_time_stand_in_their_order(tmp_path: Path) -> None:
    mag = Form(100, "MAG", "hhh", "MagX,MagY,MagZ")
    att = Form(101, "ATT", "ccC", "Roll,Pitch,Yaw")
    log = Writer(forms=(FMT, mag, att))
    for k in range(50):
        log.add(att, 1.0, 2.0, float(k))
        log.add(mag, 200, k, 400)
    for data in (log.binary(), log.text()):
        found = from_bytes(tmp_path, data)
        assert len(found.field[1]) == len(found.attitude) == 50
        assert found.duration_s == pytest.approx(4.9, abs=0.2)
        assert "no times" in found.report.notes[0]


def test_parameters_that_are_no_numbers_stay_to_be_named(tmp_path: Path) -> None:
    log = short_flight()
    log.add(PARM, 9_000_000, "COMPASS_MOT_X", float("nan"))
    for data in (log.binary(), log.text()):
        assert math.isnan(from_bytes(tmp_path, data).parameters.last("COMPASS_MOT_X", 0.0))


# ---------------------------------------------------------------- what is missing is named


def test_a_log_of_formats_alone_holds_no_flight(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="its table of formats alone"):
        from_bytes(tmp_path, Writer().binary())


def test_a_log_without_compass_names_the_bit_to_set(tmp_path: Path) -> None:
    log = short_flight()
    log.rows = [row for row in log.rows if row[0] is not MAG]
    with pytest.raises(MissingDataError, match="COMPASS bit of LOG_BITMASK"):
        analyse(from_bytes(tmp_path, log.binary()))


def test_a_log_without_battery_and_throttle_names_the_bits_to_set(tmp_path: Path) -> None:
    log = short_flight()
    log.rows = [row for row in log.rows if row[0] not in (BAT, CTUN)]
    with pytest.raises(MissingDataError, match="CURRENT and CTUN bits of LOG_BITMASK"):
        analyse(from_bytes(tmp_path, log.binary()))


# ---------------------------------------------------------------- what no firmware writes

NAMES = st.sampled_from(sorted(MESSAGES)) | st.text("AZ09_ \0é", max_size=4)
KINDS = st.text("abBcCdeEfghHiILMnNqQZ?", max_size=16)
COLUMNS = st.sampled_from([f.columns for f in (MAG, ATT, BAT, PARM, MSG)]) | st.text(max_size=60)


@st.composite
def hostile(draw) -> bytes:
    """A flight whose table and records were changed by someone who knows the format."""
    log = short_flight(2.0)
    pieces = [form.definition() for form in log.forms]
    pieces += [form.record(values) for form, values in log.rows]
    for _ in range(draw(st.integers(1, 8))):
        at = draw(st.integers(0, len(pieces) - 1))
        what = draw(st.integers(0, 5))
        if what == 0:
            number, size = draw(st.integers(0, 255)), draw(st.integers(0, 255))
            texts = [draw(s).encode() for s in (NAMES, KINDS, COLUMNS)]
            pieces.insert(at, HEAD + struct.pack("<BBB4s16s64s", 128, number, size, *texts))
        elif what == 1:
            pieces.insert(
                at, draw(st.sampled_from(log.forms)).definition(draw(st.integers(0, 255)))
            )
        elif what == 2:
            pieces[at] = pieces[at][:3] + draw(st.binary(min_size=8, max_size=8)) + pieces[at][11:]
        elif what == 3:
            pieces[at] = pieces[at][: draw(st.integers(0, len(pieces[at])))]
        elif what == 4:
            pieces.insert(at, draw(st.binary(max_size=300) | st.just(bytes(300))))
        else:
            other = draw(st.integers(0, len(pieces) - 1))
            pieces[at], pieces[other] = pieces[other], pieces[at]
    return b"".join(pieces)


def read_or_refused(path: Path) -> None:
    message = ""
    try:
        recording = read(path)
    except MagcompError as error:
        message = str(error)
    if message:
        assert str(path) in message
        return
    for series in (*recording.field.values(), recording.current, recording.attitude):
        if series is not None:
            assert (np.diff(series.time) >= 0).all()
            assert np.isfinite(series.time).all()
            assert np.isfinite(series.value).all()


@settings(max_examples=examples(60), deadline=None)
@given(data=hostile())
def test_a_hostile_log_is_read_or_refused_in_words(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("hostile") / "log.BIN"
    path.write_bytes(data)
    read_or_refused(path)


@settings(max_examples=examples(50), deadline=None)
@given(data=st.data())
def test_a_hostile_text_log_is_read_or_refused_in_words(tmp_path_factory, data) -> None:
    lines = short_flight(1.0).text().split(b"\r\n")
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(lines) - 1))
        cells = lines[at].split(b",")
        cell = data.draw(st.integers(0, len(cells) - 1))
        junk = st.binary(max_size=9) | st.sampled_from([b"nan", b"1e999", b"-", b"9" * 400, b"\0"])
        cells[cell] = data.draw(junk)
        lines[at] = b",".join(cells[: data.draw(st.integers(1, len(cells)))])
    path = tmp_path_factory.mktemp("hostile") / "log.log"
    path.write_bytes(b"\n".join(lines))
    read_or_refused(path)


SIZE = 300_000
EMPTY = Form(200, "X", "", "")
REDEFINED = [
    Form(BAT.number, "BAT", BAT.kinds, f"TimeUS,Inst,Volt,C{k}") for k in range(SIZE // 112)
]
COSTLY = {
    "headers alone": lambda: FMT.definition() + HEAD * (SIZE // 2),
    "records of three bytes": lambda: EMPTY.definition() + (HEAD + bytes([200])) * (SIZE // 3),
    "three bytes and one more": lambda: EMPTY.definition() + (HEAD + bytes([200, 0])) * (SIZE // 4),
    "a message redefined each time": lambda: b"".join(
        form.definition() + form.record((k, 0, 1.0, 2.0)) for k, form in enumerate(REDEFINED)
    ),
    "a parameter that changes each time": lambda: b"".join(
        PARM.record((100_000 * k, "COMPASS_OFS_X", float(k))) for k in range(SIZE // 31)
    ),
    "every instance": lambda: b"".join(
        BAT.record((1000 * k, k % 256, 1.0, 2.0)) for k in range(SIZE // 20)
    ),
    "a clock that goes back each time": lambda: b"".join(
        BAT.record((10**12 - 10**7 * k, 0, 1.0, 2.0)) for k in range(SIZE // 20)
    ),
    "empty lines": lambda: b"\n" * SIZE,
    "lines without columns": lambda: b"MAG,\n" * (SIZE // 5),
    "one line": lambda: b"MAG," + b"1," * (SIZE // 2),
    "columns that are no numbers": lambda: (
        b"MAG, 1, 0, x, 3, 4, 5, 6, 7, 8, 9, 1, 1, 4\n" * (SIZE // 44)
    ),
    "formats of everything": lambda: b"".join(
        b"FMT, %d, 9, Z%d, Qf, A,B\n" % (k % 256, k % 999) for k in range(SIZE // 30)
    ),
}


@pytest.mark.parametrize("what", COSTLY)
def test_memory_stays_within_a_multiple_of_the_log(tmp_path: Path, what: str) -> None:
    log = short_flight(2.0)
    costly = COSTLY[what]()
    is_text = costly.endswith((b"\n", b"1,"))
    path = tmp_path / "log"
    path.write_bytes((log.text() if is_text else log.binary()) + costly)
    tracemalloc.start()
    try:
        read_or_refused(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 60 * path.stat().st_size


def test_any_bytes_can_be_taken_apart() -> None:
    for data in (b"", HEAD, HEAD * 5000, HEAD + b"\x80", (HEAD + b"\x80") * 5000):
        octets = np.frombuffer(data, dtype=np.uint8)
        for reader in (binary, text):
            assert reader.unpack(octets, MESSAGES).records >= 0


def test_a_hundred_thousand_formats_are_read_in_one_go() -> None:
    columns = "TimeUS,Inst,Volt,Curr"
    forms = [
        Form(k % 128, "BAT" if k % 9 else f"B{k % 99}", "QBff", columns) for k in range(100_000)
    ]
    data = FMT.definition() + b"".join(form.definition() for form in forms)
    data += BAT.definition() + BAT.record((1, 0, 12.0, 5.0))
    found = binary.unpack(np.frombuffer(data, dtype=np.uint8), MESSAGES)
    assert found.counts["FMT"] == 100_002 if "FMT" in found.counts else found.records == 100_003
    assert found.tables["BAT"].numbers("Curr").tolist() == [5.0]
