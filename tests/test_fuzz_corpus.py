"""The fuzzers' inputs that once failed, and a few new ones each time (benchmarks/fuzz)."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "fuzz"))

from mutate import changed, of_bytes, of_frames
from run import fault_of
from seeds import CORPUS, seeds
from targets import FRAMED, TARGETS

from magcomp.mavlink import header
from magcomp.mavlink.records import records
from magcomp.mavlink.stream import is_sound

QUICK = sorted(set(TARGETS) - {"analysis"})
FOUND = sorted(path for path in CORPUS.glob("*/*"))


@pytest.mark.parametrize("path", FOUND, ids=[path.name for path in FOUND])
def test_what_once_failed_does_not_again(path: Path) -> None:
    assert fault_of(TARGETS[path.parent.name], path.read_bytes()) == ""


@pytest.mark.parametrize("name", QUICK)
def test_hostile_bytes_are_read_or_refused_in_words(name: str) -> None:
    chance, begin = random.Random(20_240_601), seeds(name)
    for _ in range(12):
        assert fault_of(TARGETS[name], of_bytes(chance, begin)) == ""


@pytest.mark.parametrize("name", sorted(FRAMED - {"analysis"}))
def test_sound_frames_of_hostile_values_are_read_or_refused_in_words(name: str) -> None:
    chance, begin = random.Random(20_240_601), seeds(name)
    for _ in range(12):
        assert fault_of(TARGETS[name], of_frames(chance, begin)) == ""


def test_a_changed_frame_is_still_sound() -> None:
    # Else the fuzzer would only try the checksum.
    frames = [frame for _, frame in records(seeds("telemetry")[0])]
    for frame in frames[:200]:
        other = changed(frame, 3, b"\xff\xff\xff\x7f")
        assert is_sound(other)
        assert len(header.payload(other)) == len(header.payload(frame))


def test_a_fault_would_be_found() -> None:
    def faulty(data: bytes) -> None:
        raise ZeroDivisionError(str(len(data)))

    assert "ZeroDivisionError" in fault_of(faulty, b"x")
