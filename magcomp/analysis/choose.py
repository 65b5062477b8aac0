"""Which of several batteries, and which attitude, a recording is to be fitted by."""

from __future__ import annotations

from dataclasses import replace

from magcomp.errors import MissingDataError
from magcomp.model import SPEED_CONTROLLERS, Recording


def with_battery(recording: Recording, number: int) -> Recording:
    """The same recording with the current of another battery in front.

    Parameters
    ----------
    recording
        From any source.
    number
        Battery instance.

    Raises
    ------
    MissingDataError
        Where the recording holds no current of this battery.
    """
    if recording.current is not None and number == recording.battery:
        return recording
    others = dict(recording.other_currents)
    current = others.pop(number, None)
    if current is None:
        known = sorted([*others, *([] if recording.current is None else [recording.battery])])
        holds = f"that of {', '.join(map(str, known))}" if known else "none"
        raise MissingDataError(
            f"{recording.source} must hold the current of battery {number}; instead it holds "
            f"{holds}"
        )
    if recording.current is not None:
        others[recording.battery] = recording.current
    return replace(recording, current=current, voltage=None, battery=number, other_currents=others)


def with_speed_controllers(recording: Recording) -> Recording:
    """The same recording with the current of the speed controllers in front.

    Raises
    ------
    MissingDataError
        Where they report none.
    """
    current = recording.esc_current
    if current is None:
        raise MissingDataError(
            f"{recording.source} must hold the current of speed controllers; instead it holds none"
        )
    others = dict(recording.other_currents)
    if recording.current is not None:
        others[recording.battery] = recording.current
    return replace(
        recording,
        current=current,
        voltage=None,
        battery=SPEED_CONTROLLERS,
        other_currents=others,
        esc_currents={},
    )


def with_attitude(recording: Recording, source: str) -> Recording:
    """The same recording with the attitude of another message in front.

    Parameters
    ----------
    recording
        From any source.
    source
        Message, such as ``"XKF1"``; upper and lower case are alike.

    Raises
    ------
    MissingDataError
        Where the recording holds no attitude of this message.
    """
    wanted = source.upper()
    if recording.attitude is not None and wanted == recording.attitude_source.upper():
        return recording
    by_name = {name.upper(): name for name in recording.other_attitudes}
    if wanted not in by_name:
        known = [*filter(None, [recording.attitude_source]), *recording.other_attitudes]
        raise MissingDataError(
            f"{recording.source} must hold the attitude of {source}; instead it holds "
            f"{'that of ' + ', '.join(known) if known else 'none'}"
        )
    name = by_name[wanted]
    others = dict(recording.other_attitudes)
    attitude = others.pop(name)
    if recording.attitude is not None:
        others[recording.attitude_source] = recording.attitude
    return replace(recording, attitude=attitude, attitude_source=name, other_attitudes=others)
