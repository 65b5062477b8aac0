"""What magcomp reads from, writes to, and refuses in parameter files."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest
import truth
from hypothesis import given
from hypothesis import strategies as st

from magcomp.errors import OutputError, ParameterFileError, UsageError
from magcomp.model import Compass, ParameterSet, Vehicle, compasses_of
from magcomp.writing.files import (
    SUFFIXES,
    format_parameters,
    parse_parameters,
    read_parameter_file,
    write_parameter_file,
)

QUAD = Vehicle("ardupilot", "copter", 1, 1, "4.6.3", compasses_of((97539, 131874, 263178)))
ANSWER = ParameterSet(
    {"COMPASS_MOTCT": 2.0, "COMPASS_MOT_X": float(np.float32(-1.83)), "COMPASS_MOT_Y": 0.0},
    QUAD,
    ("magcomp 0.1.0, from flight.tlog", "verdict: good"),
)

names = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_", min_size=1, max_size=16)
float32s = st.floats(width=32, allow_nan=False, allow_infinity=False)
comment_lines = (
    st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=40)
    .map(str.strip)
    .filter(
        lambda line: not line.startswith(("magcomp-vehicle:", "Onboard", "Vehicle-Id", "\ufeff"))
    )
)
plain_compasses = st.lists(st.integers(1, 2**24), max_size=3).map(compasses_of)
told_compasses = st.lists(
    st.builds(
        Compass,
        slot=st.integers(1, 4),
        device_id=st.integers(0, 2**24),
        external=st.none() | st.booleans(),
        orientation=st.none() | st.integers(0, 42),
        used=st.none() | st.booleans(),
    ),
    max_size=3,
).map(tuple)
vehicles = st.builds(
    Vehicle,
    autopilot=st.sampled_from(["ardupilot", "px4"]),
    kind=st.sampled_from(["copter", "plane", "unknown"]),
    system=st.integers(1, 255),
    component=st.integers(1, 255),
    firmware=st.text(max_size=10),
    board=st.text(max_size=10),
    compasses=plain_compasses | told_compasses,
    uid=st.text("0123456789abcdef", max_size=36),
)
parameter_sets = st.builds(
    ParameterSet,
    values=st.dictionaries(names, float32s, min_size=1, max_size=8),
    vehicle=st.none() | vehicles,
    comments=st.lists(comment_lines, max_size=3).map(tuple),
)


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(parameters=parameter_sets)
def test_what_is_written_reads_back_the_same(suffix: str, parameters: ParameterSet) -> None:
    text = format_parameters(parameters, suffix)
    assert parse_parameters(text, "file") == parameters


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(parameters=parameter_sets)
def test_windows_line_ends_and_a_byte_order_mark_change_nothing(
    suffix: str, parameters: ParameterSet
) -> None:
    text = "\ufeff" + format_parameters(parameters, suffix).replace("\n", "\r\n")
    assert parse_parameters(text, "file") == parameters


def test_mission_planner_form_is_name_comma_value() -> None:
    assert format_parameters(ANSWER, ".param").splitlines() == [
        "# magcomp 0.1.0, from flight.tlog",
        "# verdict: good",
        '# magcomp-vehicle: {"autopilot": "ardupilot", "kind": "copter", "system": 1, '
        '"component": 1, "firmware": "4.6.3", "device_ids": [97539, 131874, 263178], '
        '"board": ""}',
        "COMPASS_MOTCT,2",
        "COMPASS_MOT_X,-1.83",
        "COMPASS_MOT_Y,0",
    ]


def test_mavproxy_form_is_columns() -> None:
    rows = format_parameters(ANSWER, ".parm").splitlines()[-3:]
    assert rows == ["COMPASS_MOTCT    2", "COMPASS_MOT_X    -1.83", "COMPASS_MOT_Y    0"]


def test_qgroundcontrol_form_is_five_columns_with_types() -> None:
    rows = format_parameters(ANSWER, ".PARAMS").splitlines()[-4:]
    assert rows == [
        "# Vehicle-Id Component-Id Name Value Type",
        "1\t1\tCOMPASS_MOTCT\t2\t2",
        "1\t1\tCOMPASS_MOT_X\t-1.83\t9",
        "1\t1\tCOMPASS_MOT_Y\t0\t9",
    ]


@pytest.mark.parametrize(
    ("value", "text"),
    [(2.0, "2"), (-0.0, "0"), (0.1, "0.1"), (float(np.float32(0.1)), "0.1"), (97539.0, "97539")],
)
def test_values_are_as_short_as_float32_allows(value: float, text: str) -> None:
    assert format_parameters(ParameterSet({"A": value}), ".param") == f"A,{text}\n"


@pytest.mark.parametrize(
    "row",
    [
        "A,1.5",
        "A 1.5",
        "A\t1.5",
        "  A ,  1.5  ",
        "A   +1.5e0 # why",
        "A,1.5#why",
        "1\t1\tA\t1.5\t9",
        "A=1.5",
        "A = 1.5",
        "A 1.5 @READONLY",
        "A,1.5,@ReadOnly # why",
        "A,1.5,,",
        "// a remark\nA\t=\t1.5",
        "; a remark\nA\t\t1.5",
    ],
)
def test_commas_spaces_tabs_and_trailing_comments_are_read(row: str) -> None:
    text = f"# head\n\n{row}\n# tail\n"
    assert parse_parameters(text, "file") == ParameterSet({"A": 1.5}, None, ("head",))


@pytest.mark.parametrize(("text", "value"), [("0x0F", 15.0), ("0Xff", 255.0), ("0x0", 0.0)])
def test_a_hexadecimal_value_is_read(text: str, value: float) -> None:
    assert parse_parameters(f"A,{text}\n", "file").values == {"A": value}


def test_of_a_name_that_stands_twice_the_last_value_counts_and_the_pilot_is_told() -> None:
    read = parse_parameters("A,1\nB,2\nA,3\nB,2\n", "file")
    assert read.values == {"A": 3.0, "B": 2.0}
    assert read.warnings == (
        "file: A stands in line 1 and, with another value, in line 3; the last one counts",
    )


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_file_that_windows_wrote_is_read(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "windows.param"
    mark = "\ufeff" if encoding[-2:] in ("le", "be") else ""
    path.write_bytes(f"{mark}# 20 °C\r\nA,1\r\n".encode(encoding))
    assert read_parameter_file(path) == ParameterSet({"A": 1.0}, None, ("20 °C",))


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("made_equals.param", 5),
        ("made_hex.param", 6),
        ("made_name_twice.param", 5),
        ("made_readonly.param", 6),
        ("iris_plus.param", 0),
        ("copter_3.5.5_qgc.params", 0),
    ],
)
def test_files_of_the_wild_are_read(name: str, count: int) -> None:
    path = truth.REAL / name
    if not path.exists():
        pytest.skip("the real files are not here")
    read = read_parameter_file(path)
    assert len(read.values) == (count or len(read.values))
    assert len(read.warnings) == (name == "made_name_twice.param")


def test_of_several_components_the_autopilot_counts() -> None:
    text = "1\t154\tA\t7\t9\n1\t1\tA\t1.5\t9\n1\t154\tB\t2\t9\n"
    assert parse_parameters(text, "file").values == {"A": 1.5}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "hold parameters"),
        ("# only words\n", "hold parameters"),
        ("A,1\nB,nan\n", "file, line 2: B must be finite; instead received nan"),
        ("A,-inf\n", "line 1: A must be finite"),
        ("A,1e39\n", "line 1: A must fit a 32-bit float; instead received '1e39'"),
        ("A,1e-60\n", "must fit a 32-bit float"),
        ("A,one\n", "must be a number; instead received 'one'"),
        ("A,1_000\n", "must be a number"),
        ("A,0x\n", "must be a number; instead received '0x'"),
        ("A,0x123456789\n", "must be a number"),
        ("A,\n", "must be NAME and VALUE"),
        ("A=\n", "must be a number; instead received ''"),
        ("A 1 @WRITEONLY\n", "must be NAME and VALUE"),
        ("A,1,5\n", "must be NAME and VALUE"),
        ("a,1\n", "name must be 1 to 16 of A-Z, 0-9 and _; instead received 'a'"),
        ("ABCDEFGHIJKLMNOPQ,1\n", "instead received 'ABCDEFGHIJKLMNOPQ'"),
        ("COMPASS MOT_X,1\n", "must be NAME and VALUE"),
        ("A,1\n\x00\x01\n", "line 2: a parameter file must be text"),
        ("just words\n", "name must be"),
        ("1\t1\tA\t1\t9\n2\t1\tB\t1\t9\n", "must belong to one vehicle"),
        ("1\t1\tA\t1\t9\nB,1\n", "must belong to one vehicle"),
        ("400\t1\tA\t1\t9\n", "vehicle must be a number from 0 to 255"),
        ('# magcomp-vehicle: {"system": 1}\nA,1\n', "line 1: the vehicle must be"),
        ("# magcomp-vehicle: " + "[" * 100_000 + "\nA,1\n", "line 1: the vehicle must be"),
    ],
)
def test_what_cannot_be_trusted_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(ParameterFileError) as refused:
        parse_parameters(text, "file")
    assert message in str(refused.value)
    assert str(refused.value).startswith("file")


@given(st.text() | st.text("AB19,. \t#\n-enaif_\r"))
def test_arbitrary_text_is_read_or_refused(text: str) -> None:
    try:
        parameters = parse_parameters(text, "file")
    except ParameterFileError:
        return
    assert parameters.values


@given(st.binary())
def test_arbitrary_bytes_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "junk.param"
    path.write_bytes(content)
    try:
        parameters = read_parameter_file(path)
    except ParameterFileError:
        return
    assert parameters.values


def test_a_comment_in_a_windows_code_page_does_not_spoil_the_file(tmp_path: Path) -> None:
    path = tmp_path / "old.param"
    path.write_bytes(b"# 20\xb0C\r\nA,1\r\n")
    assert read_parameter_file(path).values == {"A": 1.0}


@pytest.mark.parametrize("name", ["missing.param", "."])
def test_a_missing_file_or_a_directory_is_one_sentence(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParameterFileError, match="must be a readable parameter file"):
        read_parameter_file(tmp_path / name)


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "huge.param"
    with path.open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(ParameterFileError, match="larger than 16 MiB"):
        read_parameter_file(path)


@pytest.mark.parametrize("name", ["answer.txt", "answer"])
def test_an_unknown_suffix_names_the_three(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=r"\.param, \.parm or \.params"):
        write_parameter_file(tmp_path / name, ANSWER)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "values", [{"A": float("nan")}, {"A": 1e39}, {"lower": 1.0}, {"A B": 1.0}, {}]
)
def test_what_could_not_be_read_back_is_not_written(
    tmp_path: Path, values: dict[str, float]
) -> None:
    with pytest.raises(ParameterFileError):
        write_parameter_file(tmp_path / "answer.param", ParameterSet(values))
    assert not list(tmp_path.iterdir())


def test_a_comment_cannot_pose_as_the_vehicle() -> None:
    forged = ParameterSet({"A": 1.0}, QUAD, ("magcomp-vehicle: {}", "two\nlines"))
    read = parse_parameters(format_parameters(forged, ".param"), "file")
    assert read.vehicle == QUAD
    assert read.comments == (" magcomp-vehicle: {}", "two", "lines")


def test_a_file_that_exists_is_kept_without_force(tmp_path: Path) -> None:
    path = tmp_path / "answer.param"
    path.write_text("mine")
    with pytest.raises(OutputError, match="must not exist yet; use --force"):
        write_parameter_file(path, ANSWER)
    assert path.read_text() == "mine"
    write_parameter_file(path, ANSWER, force=True)
    assert read_parameter_file(path) == ANSWER
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_directory_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"must be writable; instead received: No such file"):
        write_parameter_file(tmp_path / "nowhere" / "answer.param", ANSWER)


def test_a_directory_is_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "answer.param"
    target.mkdir()
    with pytest.raises(OutputError, match="instead it is a directory"):
        write_parameter_file(target, ANSWER, force=True)


@pytest.mark.parametrize("fails", ["fsync", "replace"])
def test_a_disk_that_fails_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    path = tmp_path / "answer.param"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(*((os, "fsync") if fails == "fsync" else (Path, "replace")), full)
    with pytest.raises(OutputError, match="No space left on device"):
        write_parameter_file(path, ANSWER, force=True)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
