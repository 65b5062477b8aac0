"""COMMAND_LONG, made ready to be sent."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_PARAMETERS = 7


def command_long(to: tuple[int, int], number: int, *parameters: float) -> mavlink.MAVLink_message:
    """Make a COMMAND_LONG.

    Parameters
    ----------
    to
        System and component.
    number
        MAV_CMD.
    parameters
        Up to seven; those left out are 0.

    Examples
    --------
    >>> from pymavlink.dialects.v20 import ardupilotmega as mavlink
    >>> made = command_long((1, 1), mavlink.MAV_CMD_REQUEST_MESSAGE, 148)
    >>> made.target_system, made.command, made.param1, made.param7
    (1, 512, 148, 0.0)
    """
    padded = (*parameters, *[0.0] * (_PARAMETERS - len(parameters)))
    return mavlink.MAVLink_command_long_message(*to, number, 0, *padded)


def every(to: tuple[int, int], message: int, interval_us: float) -> mavlink.MAVLink_message:
    """Ask for a message at an interval: microseconds, 0 for the vehicle's default, −1 for never."""
    return command_long(to, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval_us)
