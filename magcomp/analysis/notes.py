"""What a user should know of an analysis besides its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from magcomp import autopilots
from magcomp.align import has_position
from magcomp.analysis.compare import Judged, comparison
from magcomp.analysis.multiplied import multiplied_notes
from magcomp.errors import MissingDataError
from magcomp.model import Recording, quantity_of


def lacking_notes(
    lacking: Mapping[int, MissingDataError], judged: Mapping[str, list[Judged]]
) -> Iterable[str]:
    """Which compasses could not be fitted by any quantity, and why."""
    done = {j.fit.compass for results in judged.values() for j in results}
    for compass, why in sorted(lacking.items()):
        if compass not in done:
            yield f"compass {compass} is left out: {why}"


def notes_of(
    recording: Recording,
    compass: int | None,
    held_out: Mapping[str, tuple[float, ...]],
    chosen: str,
) -> Iterable[str]:
    """What a user should know of a recording, and why this quantity was chosen.

    Parameters
    ----------
    recording
        What was fitted.
    compass
        The one asked for; None for all.
    held_out, chosen
        As for :func:`magcomp.analysis.compare.comparison`.
    """
    if len(held_out) > 1:
        yield comparison(held_out, chosen)
    elif quantity_of(chosen).is_throttle and recording.current is None:
        yield "the log holds no battery current, so throttle is used"
    if not has_position(recording):
        yield "the log holds no position: the earth's field is taken from the readings themselves"
    yield from multiplied_notes(recording, chosen)
    autopilot = autopilots.of(recording)
    yield from autopilot.reading_notes(recording)
    yield from autopilot.warnings(recording.parameters.latest)
    for number, why in sorted(autopilot.left_out(recording.parameters).items()):
        if number in recording.field and compass is None:
            yield f"compass {number} is left out: {why}"
    if not recording.parameters.names:
        yield (
            "the log holds no parameters: the calibration in force is unknown, so only the motor "
            "vector is given, and it is right only if no motor compensation was in force"
        )
    yield from recording.report.notes
    others = recording.report.others
    if others:
        named = ", ".join(f"{system}:{component}" for system, component in others)
        yield f"messages of other systems were left out ({named})"
    if recording.report.bad_checksum:
        yield f"{recording.report.bad_checksum} damaged messages were left out"
