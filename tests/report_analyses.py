"""Analyses of recordings, made once for all tests of reports."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from typing import Any

import recordings

from magcomp.analysis import Options
from magcomp.model import Analysis, Recording
from magcomp.report import as_json


@dataclass(frozen=True, eq=False)
class Case:
    recording: Recording
    analysis: Analysis
    options: Options

    @property
    def document(self) -> dict[str, Any]:
        """What ``magcomp fit --json`` prints, read back."""
        document: dict[str, Any] = json.loads(as_json.dumps(as_json.analysis_object(self.analysis)))
        return document

    @property
    def present(self) -> dict[str, float]:
        history = self.recording.parameters
        return {name: history.last(name, 0.0) for name in history.names}


@cache
def case(name: str, options: Options | None = None) -> Case:
    wanted = Options() if options is None else options
    return Case(recordings.recording(name), recordings.analysis(name, wanted), wanted)


def still() -> Case:
    """A sweep: throttle, three compasses, good."""
    return case("sweep_throttle_only")


def flown() -> Case:
    """A flight, one compass, current, good."""
    return case("flight", Options(compass=1))


def refused() -> Case:
    """The end of a flight, straight home: rejected."""
    return case("flight", Options(compass=1, start=240.0))
