"""What cannot be used is refused in one sentence; what is damaged is read as far as it is whole."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from tlog_writer import START_US, Sender, log, record, short_flight

from magcomp.errors import LogError, MagcompError
from magcomp.sources import read
from magcomp.sources.assemble import recording_from_bytes


def refused(path: Path, match: str, **arguments: int) -> None:
    """One sentence that names the file."""
    with pytest.raises(LogError, match=match) as caught:
        read(path, **arguments)
    message = str(caught.value)
    assert str(path) in message
    assert message.endswith(".")
    assert "\n" not in message


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    refused(tmp_path / "none.tlog", "no such file")


def test_a_directory_is_refused(tmp_path: Path) -> None:
    refused(tmp_path, "directory")


def test_a_file_that_may_not_be_read_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "secret.tlog"
    path.write_bytes(b"x")

    def deny(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", deny)
    refused(path, "Permission denied")


def test_something_that_is_no_file_is_refused() -> None:
    refused(Path("/dev/null"), "no file")


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "empty"),
        (b"time,roll\n1,2\n" * 50, "text"),
        (np.random.default_rng(5).bytes(200_000), "without one sound frame"),
        (log([Sender(255, 190).heartbeat(6, 8)]), "system 255 component 190"),
        (log([Sender().attitude(5000)]), "no heartbeat"),
        (log([Sender().heartbeat()])[:-1], "without one sound frame"),
    ],
    ids=["empty", "text", "random", "ground station only", "no heartbeat", "cut"],
)
def test_what_holds_no_autopilot_is_refused(tmp_path: Path, content: bytes, match: str) -> None:
    path = tmp_path / "bad.tlog"
    path.write_bytes(content)
    refused(path, match)


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("a.csv", b"x,y\n", r"table \(\.csv\)"),
    ],
)
def test_other_formats_are_named(tmp_path: Path, name: str, content: bytes, match: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    refused(path, match + ": give the")


def test_a_telemetry_log_may_have_any_other_name(tmp_path: Path) -> None:
    path = tmp_path / "flight.mavlog"
    path.write_bytes(log(short_flight(Sender())))
    assert read(path).report.used == len(short_flight(Sender()))


def test_a_hundred_megabytes_of_first_bytes_are_refused_in_bounded_memory(tmp_path: Path) -> None:
    path = tmp_path / "fd.tlog"
    with path.open("wb") as file:
        for _ in range(100):
            file.write(b"\xfd" * 1_000_000)
    tracemalloc.start()
    try:
        refused(path, "without one sound frame")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 20_000_000


def test_a_log_cut_anywhere_in_its_last_two_frames_is_read_without_them() -> None:
    frames = short_flight(Sender())
    data = log(frames)
    last = len(frames[-1]) + 8
    before = len(frames[-2]) + 8
    for cut in range(1, last + before):
        report = recording_from_bytes(data[:-cut], "test.tlog").report
        assert report.used == len(frames) - (1 if cut <= last else 2)
        assert report.skipped == (-cut % last if cut <= last else last + before - cut)


@settings(max_examples=examples(100), deadline=None)
@given(st.binary(max_size=400))
def test_arbitrary_bytes_are_refused_in_words(data: bytes) -> None:
    with pytest.raises(LogError):
        recording_from_bytes(data, "test.tlog")


@settings(max_examples=examples(70), deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(range(48)), st.binary(max_size=12), st.integers(0, 400)),
        max_size=12,
    )
)
def test_a_damaged_log_is_read_or_refused_in_words(damage: list[tuple[int, bytes, int]]) -> None:
    records = [record(START_US + n * 1000, f) for n, f in enumerate(short_flight(Sender(), 1))]
    for at, noise, kept in damage:
        where = at % len(records)
        records[where] = records[where][:kept] + noise + records[where][kept:]
    try:
        recording = recording_from_bytes(b"".join(records), "test.tlog")
    except MagcompError:
        return
    assert recording.report.used > 0
