"""What every autopilot does on MAVLink, whatever its make. Messages in, messages out, no I/O."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate.habits import Habits
from magcomp.simulate.streams import Schedule

FORCE = 21196.0
"""COMMAND_LONG.param2 that arms or disarms in spite of everything."""


class Talker:
    """An autopilot's side of the link; subclasses give the habits of a firmware.

    Parameters
    ----------
    telemetry
        Messages that it can stream, in the order in which one moment's are sent.
    system, component
        MAVLink identity.
    habits
        What it does besides.
    """

    def __init__(
        self,
        telemetry: Sequence[int],
        system: int = 1,
        component: int = 1,
        habits: Habits | None = None,
    ) -> None:
        self.telemetry = tuple(telemetry)
        self.habits = habits or Habits()
        self.system = system
        self.component = component
        self.mode = 0
        self.forget()

    def forget(self) -> None:
        """Be as after a reboot."""
        self.armed = False
        self.flying = False
        self.reboot_wanted = False
        self.schedule = Schedule(self.telemetry)
        self.once: deque[int] = deque()
        self.outgoing: deque[Any] = deque()

    def arm(self, *, force: bool = False) -> bool:
        """Arm, unless a check forbids it; whether the motors are armed now."""
        raise NotImplementedError

    def disarm(self, *, force: bool = False) -> bool:
        """Disarm, unless in the air; whether the motors are disarmed now."""
        raise NotImplementedError

    def handle(self, message: Any, now_ms: int) -> None:
        """Act on one message from the ground; answers are in ``outgoing``."""
        for_system = getattr(message, "target_system", 0)
        for_component = getattr(message, "target_component", 0)
        if for_system not in (0, self.system) or for_component not in (0, self.component):
            return
        handler = self.handlers.get(message.get_type())
        if handler is not None:
            handler(self, message, now_ms)

    def companions(self) -> list[tuple[int, Any]]:
        """A heartbeat of everybody else in this system, with the component that sends it."""
        return [
            (
                other.component,
                mavlink.MAVLink_heartbeat_message(
                    other.mav_type, other.autopilot, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
                ),
            )
            for other in self.habits.companions
        ]

    def uid2(self) -> tuple[int, ...]:
        """AUTOPILOT_VERSION.uid2."""
        return tuple((self.habits.uid or b"").ljust(18, b"\0"))

    def acknowledge(self, message: Any, result: int) -> None:
        """Answer a command."""
        self.outgoing.append(
            mavlink.MAVLink_command_ack_message(
                command=message.command,
                result=result,
                target_system=message.get_srcSystem(),
                target_component=message.get_srcComponent(),
            )
        )

    def object_to(self, message: Any, error: str) -> None:
        """PARAM_ERROR, as newer firmware sends it."""
        self.outgoing.append(
            mavlink.MAVLink_param_error_message(
                target_system=message.get_srcSystem(),
                target_component=message.get_srcComponent(),
                param_id=message.param_id.encode("ascii", "replace"),
                param_index=getattr(message, "param_index", -1),
                error=getattr(mavlink, f"MAV_PARAM_ERROR_{error}"),
            )
        )

    def on_timesync(self, message: Any, now_ms: int) -> None:
        """Send the autopilot's time back with the question."""
        if message.tc1 == 0:
            answer = mavlink.MAVLink_timesync_message(tc1=now_ms * 1_000_000 + 1, ts1=message.ts1)
            self.outgoing.append(answer)

    def arm_or_disarm(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        """MAV_CMD_COMPONENT_ARM_DISARM; the result that is acknowledged."""
        force = message.param2 == FORCE
        if message.param1 not in (0.0, 1.0):
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        done = self.arm(force=force) if message.param1 else self.disarm(force=force)
        return int(mavlink.MAV_RESULT_ACCEPTED if done else mavlink.MAV_RESULT_FAILED)

    handlers: ClassVar[Mapping[str, Callable[[Any, Any, int], None]]] = {}
    """Message name to what is done with it."""
