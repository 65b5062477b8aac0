"""Whether what was written acts, where a vehicle says what it makes of its compass.

docs/autopilots.md, PX4: in force. A firmware may hold a value and go on with another one. Some
send both the sensor's own field and what they make of it, so that at rest the two tell.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp import autopilots
from magcomp.mavlink.commands import every
from magcomp.model import FloatArray, Series, Vehicle
from magcomp.writing.plan import WritePlan
from magcomp.writing.writer import Connection, fetch

_LOOK_S = 2.0
_STEP_S = 0.1
_HZ = 10.0
_LEAST = 5
_AGREES = 4.0
"""mGauss: means of two seconds differ by a fraction of it, and by what is being drawn at rest."""

_TOLD_APART = 2.0
"""What was before must be this many times farther from what is seen."""


@dataclass(frozen=True)
class Seen:
    """Means over a look at a vehicle at rest.

    Attributes
    ----------
    raw
        What each compass message holds, by message name, mGauss, shape (3,).
    made
        What the firmware makes of the compass it uses, body axes, mGauss, shape (3,).
    """

    raw: Mapping[str, FloatArray]
    made: FloatArray


def in_force_sentence(
    connection: Connection,
    plan: WritePlan,
    clock: Callable[[], float],
    streamed: Mapping[str, float] | None = None,
) -> str:
    """Look whether a write acts, and say it; empty where the firmware shows nothing of it.

    Parameters
    ----------
    plan
        What was written.
    streamed
        Messages that come already, by name; they are left as they are.

    Raises
    ------
    LinkTimeoutError, LinkError
        The vehicle does not answer, or the link is lost.
    """
    autopilot = autopilots.of(plan.vehicle)
    message = autopilot.corrected_message
    if message is None:
        return ""
    names = (*autopilot.relevant_names(), *autopilot.useful_names())
    now = fetch(connection, plan.vehicle, names, clock=clock)
    told = autopilot.compass_messages(now)
    seen = _look(connection, plan.vehicle, (*told.values(), message), clock, streamed or {})
    if seen is None:
        return ""
    return _sentence(plan.vehicle, seen, {**now, **plan.old}, now)


def _sentence(
    vehicle: Vehicle, seen: Seen, before: Mapping[str, float], now: Mapping[str, float]
) -> str:
    title = autopilots.of(vehicle).title
    apart = [
        (_apart(vehicle, seen, slot, now), _apart(vehicle, seen, slot, before))
        for slot in autopilots.of(vehicle).compass_messages(now)
    ]
    # The link does not tell which compass it uses: it may be any that fits what is seen.
    may_be = [each for each in apart if min(each) <= _AGREES]
    if not may_be:
        new, old = min(apart, key=min)
        return (
            f"what {title} has in force cannot be seen: its compass is {new:.0f} mGauss from what "
            f"was written and {old:.0f} from what was before, because its estimator takes off what "
            "it has learned; restart the vehicle to be sure"
        )
    from_new, from_old = zip(*may_be, strict=True)
    if _is_first(from_new, from_old):
        return (
            f"{title} corrects its compass by what was written: within {max(from_new):.1f} mGauss; "
            f"by what it held before it would be {min(from_old):.0f} off"
        )
    if _is_first(from_old, from_new):
        return (
            f"{title} still corrects its compass by what it held before: restart the vehicle, and "
            "it takes over what was written"
        )
    if max(from_new) <= _AGREES:
        return (
            f"{title} corrects its compass as written, within {max(from_new):.1f} mGauss; without "
            "current the new values make too little difference to be seen, or only in a compass "
            "that it may not use"
        )
    return (
        f"what {title} has in force cannot be seen: without current the new values make too little "
        "difference, or only in a compass that it may not use; restart the vehicle to be sure"
    )


def _is_first(these: Sequence[float], others: Sequence[float]) -> bool:
    """Whether these explain what is seen and the others do not, whichever compass is used."""
    return max(these) <= _AGREES and min(others) >= max(_TOLD_APART * max(these), _AGREES)


def _apart(vehicle: Vehicle, seen: Seen, slot: int, values: Mapping[str, float]) -> float:
    """How far the firmware's field is from what given values would make of a compass, mGauss."""
    autopilot = autopilots.of(vehicle)
    said = Series(np.zeros(1), seen.raw[autopilot.compass_messages(values)[slot]][None])
    fields, _ = autopilot.from_telemetry(dict.fromkeys(range(1, 4), said), values)
    correction = autopilot.in_force(values, slot).correction
    return float(np.linalg.norm(correction.apply(fields[slot].value, np.zeros(1))[0] - seen.made))


def _look(
    connection: Connection,
    vehicle: Vehicle,
    names: tuple[str, ...],
    clock: Callable[[], float],
    streamed: Mapping[str, float],
) -> Seen | None:
    """Ask for messages for a while, and give back what was sent before; None where few came."""
    asked = [name for name in names if name not in streamed]
    _ask(connection, vehicle, asked, 1e6 / _HZ)
    heard: dict[str, list[tuple[float, float, float]]] = {name: [] for name in names}
    until = clock() + _LOOK_S
    while (left := until - clock()) > 0.0:
        message = connection.receive(min(left, _STEP_S))
        if message is not None and message.get_type() in heard:
            heard[message.get_type()].append((message.xmag, message.ymag, message.zmag))
    _ask(connection, vehicle, asked, 0.0)
    if any(len(rows) < _LEAST for rows in heard.values()):
        return None
    *raw, made = names
    return Seen(
        {name: np.mean(heard[name], axis=0) for name in raw},
        np.mean(heard[made], axis=0) * autopilots.of(vehicle).corrected_unit,
    )


def _ask(connection: Connection, vehicle: Vehicle, names: list[str], interval_us: float) -> None:
    numbers = {each.msgname: number for number, each in mavlink.mavlink_map.items()}
    for name in names:
        connection.send(every((vehicle.system, vehicle.component), numbers[name], interval_us))
