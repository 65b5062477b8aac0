"""What a recording lacks for a fit, in words, and how to log it next time."""

from __future__ import annotations

from magcomp import autopilots
from magcomp.align import controls, on_lift_alone
from magcomp.errors import MissingDataError
from magcomp.fit import LEAST_READINGS
from magcomp.model import Control, Recording

HOW_TO_HOVER = "hover for two minutes, turning, and climb and descend"


def controls_of(recording: Recording) -> tuple[Control, ...]:
    """The control quantities of a recording.

    Raises
    ------
    MissingDataError
        Where it holds none that changes.
    """
    found = controls(recording)
    if not found:
        raise MissingDataError(
            f"{recording.source} must hold a battery current or a throttle that changes; instead "
            f"it holds {_silent_controls(recording)}"
        )
    return found


def hover_of(recording: Recording) -> tuple[Recording, str]:
    """What can be fitted of a recording, and in words what was left out.

    Raises
    ------
    MissingDataError
        Where nothing is left.
    """
    hover, left_out = on_lift_alone(recording)
    if left_out and not hovers(hover):
        raise MissingDataError(
            f"{recording.source} must hold a hover; instead {left_out.partition(':')[0]}: "
            f"{HOW_TO_HOVER}"
        )
    return hover, left_out


def hovers(hover: Recording) -> bool:
    """Whether what was flown on the lift motors alone is enough for a fit."""
    return any(len(series) >= LEAST_READINGS for series in hover.field.values())


def _silent_controls(recording: Recording) -> str:
    if recording.current is None and recording.throttle is None:
        how = autopilots.of(recording).how_to_record("control", recording.format)
        return f"neither: {how}"
    return "neither: was the vehicle ever armed?"


def no_motors(recording: Recording) -> MissingDataError:
    """Why a recording cannot be fitted motor by motor."""
    lacks = [
        what
        for what, series in (
            ("the battery's current", recording.current),
            ("the motors' outputs (SERVO_OUTPUT_RAW or RCOU)", recording.outputs),
        )
        if series is None
    ]
    holds = (
        f"it lacks {' and '.join(lacks)}" if lacks else "the current does not follow the outputs"
    )
    return MissingDataError(
        f"{recording.source} must hold the battery's current and the outputs of all motors for a "
        f"fit motor by motor; instead {holds}"
    )


def with_cure(recording: Recording, compass: int, lacking: MissingDataError) -> MissingDataError:
    """What a compass lacks, and how to record more of it where it is there at all."""
    if compass not in recording.field:
        return lacking
    how = autopilots.of(recording).how_to_record("more readings", recording.format)
    return MissingDataError(f"{lacking}: {how}")
