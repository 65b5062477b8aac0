"""``magcomp heading ADDRESS``: a live vehicle's headings, a line a second."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Event

from magcomp import autopilots
from magcomp.align import expected_earth, has_position
from magcomp.cli.linking import LinkOptions, StatusLine, stop_on_interrupt
from magcomp.cli.output import answer, complain
from magcomp.errors import AddressError, ExitCode
from magcomp.link import Replay, parse_address
from magcomp.live.heading import LiveHeading, Sensors, corrections, live_headings
from magcomp.live.session import LiveSession
from magcomp.model import Recording

_LOOK_S = 0.2
_POSITION_S = 3.0
"""How long a position, which gives the declination, is waited for."""


@dataclass(frozen=True)
class Following:
    """What to show of a live vehicle.

    Attributes
    ----------
    compass
        1, 2 or 3.
    chosen
        Parameters to correct by; empty for the correction in force.
    seconds
        For how long; infinite until Ctrl-C.
    to_json
        One object a line instead of columns.
    """

    compass: int
    chosen: Mapping[str, float]
    seconds: float
    to_json: bool


def is_live(source: str) -> bool:
    """Whether this is the address of a link, not the path of a log."""
    try:
        return not Path(source).is_file() and not isinstance(parse_address(source), Replay)
    except AddressError:
        return False


def follow(address: str, link: LinkOptions, wanted: Following) -> ExitCode:
    """Print a live vehicle's headings, a line for each second of its own clock.

    Raises
    ------
    MagcompError
        As ``LiveSession.open`` and ``LiveSession.wait_ready``.
    InputError
        The correction cannot be told from the one in force.
    """
    with (
        stop_on_interrupt() as stop,
        LiveSession.open(
            address,
            **link.reach,
            refit_share=0.0,
        ) as session,
    ):
        vehicle = session.wait_ready(link.timeout)
        recording = _placed(session, stop)
        shown, present = corrections(recording, wanted.chosen, wanted.compass)
        sensors = Sensors(wanted.compass, vehicle, recording.parameters.latest)
        declination = expected_earth(recording).declination if has_position(recording) else 0.0
        session.listen(sensors)
        status, begun = StatusLine(terminal=False), session.elapsed_s

        def over() -> bool:
            late = session.elapsed_s - begun >= wanted.seconds
            return stop.is_set() or late or session.connection.ended

        for note in autopilots.of(vehicle).link_notes(len(vehicle.compasses)):
            complain(f"{note[:1].upper()}{note[1:]}")
        if not wanted.to_json:
            answer(f"{'time, s':>10}{'raw':>13}{'corrected':>13}{'fused':>13}\n")
        second = None
        for heading in live_headings(sensors, shown, present, declination, over):
            if math.floor(heading.time) != second:
                second = math.floor(heading.time)
                status.show(session.snapshot().link_text)
                answer(_as_json(heading) if wanted.to_json else _as_text(heading))
        return ExitCode.INTERRUPTED if stop.is_set() else ExitCode.GOOD


def _placed(session: LiveSession, stop: Event) -> Recording:
    """What has been received once it says where the vehicle is, or will not."""
    until = session.elapsed_s + _POSITION_S
    recording = session.recording()
    while not has_position(recording) and session.elapsed_s < until and not stop.wait(_LOOK_S):
        recording = session.recording()
    return recording


def _degrees(angle: float) -> float | None:
    return round(math.degrees(angle) % 360.0, 2) % 360.0 if math.isfinite(angle) else None


def _as_json(heading: LiveHeading) -> str:
    found = {
        "time_s": round(heading.time, 3),
        "raw_deg": _degrees(heading.raw),
        "corrected_deg": _degrees(heading.corrected),
        "fused_deg": _degrees(heading.fused),
    }
    return json.dumps(found, allow_nan=False) + "\n"


def _as_text(heading: LiveHeading) -> str:
    angles = map(_degrees, (heading.raw, heading.corrected, heading.fused))
    cells = ("–" if angle is None else f"{angle:.1f}°" for angle in angles)
    return "".join([f"{heading.time:10.1f}", *(f"{cell:>13}" for cell in cells)]) + "\n"
