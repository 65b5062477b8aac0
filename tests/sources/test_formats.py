"""A file is what its first bytes say, and an archive is what is in it."""

from __future__ import annotations

import gzip
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from dataflash_writer import short_flight as short_flight_of_dataflash
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from tlog_writer import RECORDINGS, Sender, log, short_flight
from ulog_writer import short_flight as short_flight_of_ulog

from magcomp.errors import ChooseVehicleError, LogError, MagcompError
from magcomp.model import Recording
from magcomp.sources import read
from magcomp.sources.archive import MOST_FILES, unpacked
from magcomp.sources.formats import FORMATS, HEAD, OTHERS, format_of, is_log, other_of
from magcomp.sources.source import is_text

TLOG = log(short_flight(Sender()))
RLOG = b"".join(short_flight(Sender()))
TEXT_LOG = b"9\r\n\r\nArduCopter V3.1\r\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\r\n"
BIN = short_flight_of_dataflash().binary()
ULG = short_flight_of_ulog().binary()
LOGS = {
    "dataflash": BIN,
    "dataflash in text": short_flight_of_dataflash().text(),
    "ulog": ULG,
    "tlog": TLOG,
}
OTHER = {
    "an empty file": b"",
    "raw MAVLink without times (.rlog)": RLOG,
    "an archive that magcomp does not open": b"7z\xbc\xaf\x27\x1c\0\4" + bytes(100),
    "a Git-LFS pointer": b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 9\n",
    "a web page": b"\n<!DOCTYPE html>\n<html><body>Sign in, please</body></html>",
    "a parameter file": b"# made by hand\nCOMPASS_OFS_X,12.5\nCOMPASS_OFS_Y,-3\n",
    "a text table (.csv)": b"mx,my,mz\n1,2,3\n4,5,6\n",
    "a text that is no log": b"Flight went well, no wind.\nNext: change props\n",
}


def written(folder: Path, content: bytes, name: str = "log") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def zipped(folder: Path, **files: bytes) -> Path:
    path = folder / "flight.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def refusal(path: Path) -> str:
    """One sentence that names the file."""
    with pytest.raises(LogError) as caught:
        read(path)
    message = str(caught.value)
    assert str(path) in message
    assert message.endswith(".")
    assert "\n" not in message
    return message


def same(recording: Recording, expected: Recording) -> bool:
    return (recording.report, recording.vehicle, recording.parameters, recording.format) == (
        expected.report,
        expected.vehicle,
        expected.parameters,
        expected.format,
    )


# ---------------------------------------------------------------- what a file is


@pytest.mark.parametrize("what", OTHER)
@pytest.mark.parametrize("suffix", [".tlog", ".zip", ""])
def test_what_is_no_telemetry_log_is_named_with_what_to_do(
    tmp_path: Path, what: str, suffix: str
) -> None:
    message = refusal(written(tmp_path, OTHER[what], f"a{suffix}"))
    assert f"instead received {what}" in message
    assert message.partition(": ")[2]


@pytest.mark.parametrize("what", OTHER)
def test_each_kind_is_recognised_by_one_entry_before_any_other(what: str) -> None:
    other = other_of(OTHER[what])
    assert other is not None
    assert other.title.startswith(what)


def test_every_entry_of_the_tables_has_an_example_here() -> None:
    assert [other_of(content) for content in OTHER.values()] == list(OTHERS)
    assert [format_of(content[:HEAD]) for content in LOGS.values()] == list(FORMATS)
    assert format_of(TEXT_LOG) is FORMATS[1]


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_a_telemetry_log_is_recognised_by_its_first_bytes(path: Path) -> None:
    head = path.read_bytes()[:HEAD]
    found = format_of(head)
    assert found is not None
    assert found.name == "tlog"
    assert other_of(head) is None


@pytest.mark.parametrize("version", [1, 2])
@given(start=st.integers(0, 400))
def test_a_log_cut_anywhere_at_its_beginning_is_still_one(version: int, start: int) -> None:
    data = log(short_flight(Sender(version=version)))[start:]
    assert other_of(data[:HEAD]) is None
    assert format_of(data[:HEAD]) is FORMATS[-1]


@pytest.mark.parametrize("version", [1, 2])
@given(start=st.integers(0, 400))
def test_a_stream_without_times_cut_anywhere_is_none(version: int, start: int) -> None:
    other = other_of(b"".join(short_flight(Sender(version=version)))[start:][:HEAD])
    assert other is not None
    assert ".rlog" in other.title


def test_a_log_whose_beginning_is_damaged_is_read_all_the_same(tmp_path: Path) -> None:
    path = written(tmp_path, b"\xfd\0\1\2" * 5000 + TLOG)
    assert format_of(path.read_bytes()[:HEAD]) is None
    assert read(path).report.used == len(short_flight(Sender()))


@given(st.binary(max_size=600))
def test_any_bytes_can_be_asked_what_they_are(head: bytes) -> None:
    assert is_log(head) == (
        other.is_log if (other := other_of(head)) else format_of(head) is not None
    )
    assert not (head and is_text(head)) or other is not None


# ---------------------------------------------------------------- archives


@pytest.mark.parametrize("beside", [{}, {"README.txt": b"windy, 5 m/s\n", "a.param": b"A_B,1\n"}])
def test_the_one_log_of_a_zip_is_read(tmp_path: Path, beside: dict[str, bytes]) -> None:
    path = zipped(tmp_path, **{"logs/1.tlog": TLOG}, **beside)
    recording = read(path)
    assert same(recording, read(written(tmp_path, TLOG)))
    assert recording.source == str(path)


def test_the_log_of_a_gz_is_read(tmp_path: Path) -> None:
    recording = read(written(tmp_path, gzip.compress(TLOG), "flight.tlog.gz"))
    assert same(recording, read(written(tmp_path, TLOG)))


def test_a_vehicle_is_chosen_in_an_archive_too(tmp_path: Path) -> None:
    frames = [
        frame
        for pair in zip(short_flight(Sender(1)), short_flight(Sender(7)), strict=True)
        for frame in pair
    ]
    path = zipped(tmp_path, **{"two.tlog": log(frames)})
    assert read(path, system=7).vehicle.system == 7
    with pytest.raises(ChooseVehicleError, match="choose with --system 1 or --system 7") as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_a_zip_of_several_logs_is_refused_by_their_names(tmp_path: Path) -> None:
    message = refusal(zipped(tmp_path, **{"a.tlog": TLOG, "b.BIN": BIN}))
    assert "2 logs (a.tlog, b.BIN): unpack it and give one" in message


@pytest.mark.parametrize(
    ("files", "match"),
    [
        ({}, "it holds nothing"),
        ({"notes.txt": b"windy"}, r"no log (notes.txt)"),
        ({"a.zip": b"PK\x03\x04" + bytes(40)}, r"no log (a.zip)"),
        ({"bad\x1b[31m\n.txt": b"x"}, r"no log (bad?[31m?.txt)"),
        ({"a" * 300: b"x"}, "a" * 59 + "…)"),
        ({f"{n}.txt": b"x" for n in range(9)}, "(0.txt, 1.txt, 2.txt, 3.txt, 4.txt …)"),
        ({f"{n}": b"" for n in range(MOST_FILES + 1)}, f"holds {MOST_FILES + 1} files"),
        ({"flight.rlog": OTHER["raw MAVLink without times (.rlog)"]}, "raw MAVLink without times"),
    ],
)
def test_a_zip_without_a_log_is_refused(
    tmp_path: Path, files: dict[str, bytes], match: str
) -> None:
    assert match in refusal(zipped(tmp_path, **files))


def test_what_a_gz_holds_is_named(tmp_path: Path) -> None:
    assert "web page" in refusal(written(tmp_path, gzip.compress(OTHER["a web page"])))


def bomb_zip(folder: Path) -> Path:
    return zipped(folder, **{"a.tlog": TLOG + bytes(3_000_000)})


def bomb_gz(folder: Path) -> Path:
    return written(folder, gzip.compress(TLOG + bytes(3_000_000)))


def lying_zip(folder: Path) -> Path:
    """Announces few bytes and holds many."""
    path = bomb_zip(folder)
    size = len(TLOG) + 3_000_000
    data = path.read_bytes().replace(size.to_bytes(4, "little"), (9000).to_bytes(4, "little"))
    return written(folder, data, "lying.zip")


@pytest.mark.parametrize("made", [bomb_zip, bomb_gz])
def test_a_log_larger_than_the_bound_is_refused_before_it_is_whole(
    tmp_path: Path, made: Callable[[Path], Path]
) -> None:
    path = made(tmp_path)
    with pytest.raises(LogError, match="at most 2 MB"), unpacked(path, is_log, HEAD, limit=2 << 20):
        pytest.fail("unpacked")
    with unpacked(path, is_log, HEAD, limit=4 << 20) as inner:
        assert inner.stat().st_size == len(TLOG) + 3_000_000
    assert not inner.exists()


def test_a_zip_that_lies_about_its_size_is_refused(tmp_path: Path) -> None:
    assert "damaged" in refusal(lying_zip(tmp_path))


def test_a_size_beyond_the_bound_need_only_be_announced(tmp_path: Path) -> None:
    path = zipped(tmp_path, **{"a.tlog": TLOG})
    size = len(TLOG).to_bytes(4, "little")
    data = path.read_bytes().replace(size, (0x7FFF_0000).to_bytes(4, "little"))
    assert "at most 1024 MB" in refusal(written(tmp_path, data, "announced.zip"))


def test_a_locked_zip_is_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path, **{"a.tlog": TLOG})
    data = bytearray(path.read_bytes())
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    assert "a.tlog in it is locked" in refusal(written(tmp_path, bytes(data), "locked.zip"))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_zip_packed_in_a_way_that_cannot_be_bounded_is_refused(
    tmp_path: Path, method: int
) -> None:
    path = tmp_path / "odd.zip"
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("a.tlog", TLOG)
    assert "packed in an unusual way" in refusal(path)


def test_a_name_that_leads_out_of_the_archive_leads_nowhere(tmp_path: Path) -> None:
    path = zipped(tmp_path, **{"../../outside.tlog": TLOG})
    assert read(path).report.used == len(short_flight(Sender()))
    assert [entry.name for entry in tmp_path.iterdir()] == ["flight.zip"]


def packed(kind: str) -> bytes:
    if kind == "gz":
        return gzip.compress(TLOG, mtime=0)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("a.tlog"), TLOG, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", ["zip", "gz"])
@settings(max_examples=examples(60))
@given(data=st.data())
def test_a_damaged_archive_is_read_or_refused_in_words(
    tmp_path_factory: pytest.TempPathFactory, kind: str, data: st.DataObject
) -> None:
    whole = bytearray(packed(kind))
    for _ in range(data.draw(st.integers(0, 6))):
        whole[data.draw(st.integers(2, len(whole) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(whole)) | st.just(len(whole)))
    path = written(tmp_path_factory.mktemp("damaged"), bytes(whole[:cut]), f"a.{kind}")
    message = ""
    try:
        recording = read(path)
    except MagcompError as error:
        message = str(error)
    if message:
        assert str(path) in message
    else:
        assert recording.report.size == len(TLOG)
