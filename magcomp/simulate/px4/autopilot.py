"""How PX4 1.15 answers: parameters, commands, arming. Messages in, messages out, no I/O.

The rules (docs/autopilots.md, PX4: parameters, and PX4: commands):

- Integers travel with their own bytes in the float field, and a set must name the parameter's
  very type: whatever else is sent, or is not known, gets no answer. NaN is taken.
- A set is answered with the parameter's true index; what a free slot has is not in the list, and
  its index is 65535.
- Every change that is noticed sends all parameters that are not saved yet once more.
- The list begins with _HASH_CHECK. Asked for again half-way, it begins again without it; a set of
  _HASH_CHECK ends it.
- What a command asks for comes before its acknowledgement.
- A message that it does not have fails; a command that it does not have is unsupported.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.parameters import NO_INDEX, Encoding, as_float, decode_values, encode_value
from magcomp.simulate.habits import BOARD_VERSION, Habits
from magcomp.simulate.px4.actuator_test import ActuatorTest
from magcomp.simulate.px4.parameters import Parameters
from magcomp.simulate.px4.streams import DEFAULT_RATES, TELEMETRY
from magcomp.simulate.talker import Talker

FIRMWARE = (1, 15, 2)
CAPABILITIES = 0xE8FF
"""PARAM_FLOAT and PARAM_ENCODE_BYTEWISE among them, PARAM_ENCODE_C_CAST not."""

_HASH = "_HASH_CHECK"
_UINT32 = 5
_LIST_PER_10_MS = 4
_UNSAVED_PER_10_MS = 8
_TEXT = 50

_STABILIZED, _POSITION, _MISSION = 7 << 16, 3 << 16, 4 << 16 | 4 << 24
_MODES = {0: _STABILIZED, 3: _MISSION, 5: _POSITION}
_MANUAL_BASE, _AUTO_BASE = 81, 29


class Px4Talker(Talker):
    """Everything PX4 says and does that has nothing to do with physics.

    Parameters
    ----------
    parameters
        What it holds.
    system, component
        MAVLink identity.
    answers_errors
        Answer with PARAM_ERROR where 1.15 is silent, as newer firmware does.
    habits
        What it does besides.
    """

    def __init__(
        self,
        parameters: Parameters,
        system: int = 1,
        component: int = 1,
        *,
        answers_errors: bool = False,
        habits: Habits | None = None,
    ) -> None:
        super().__init__(TELEMETRY, system, component, habits)
        self._parameters = parameters
        self._answers_errors = answers_errors
        self._now_s = 0.0
        self._texts = 0
        self.start_up()

    def start_up(self) -> None:
        """Forget what a reboot forgets, and begin to send what is sent unasked."""
        self.forget()
        self.mode = _POSITION
        self.actuator_test = ActuatorTest()
        self._list: deque[str] = deque()
        self._changed: deque[str] = deque()
        self._told = self._parameters.version
        for message, hertz in DEFAULT_RATES.items():
            self.schedule.set(message, 1e6 / hertz, 0)

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send a line of text."""
        line = f"{text}\t".encode("ascii")[:_TEXT]
        self.outgoing.append(mavlink.MAVLink_statustext_message(severity, line, self._texts, 0))
        self._texts += 1

    def take_mode(self, copter_mode: int) -> None:
        """Fly in the mode that does what one of ArduCopter's does."""
        self.mode = _MODES.get(copter_mode, _POSITION)

    def send_paced(self, now_s: float) -> None:
        """Save and send the next few parameters; called every 10 ms, in seconds since power-up."""
        self._now_s = now_s
        self.actuator_test.advance(now_s)
        parameters = self._parameters
        parameters.settle(now_s)
        if parameters.version != self._told:
            self._told = parameters.version
            shown = frozenset(parameters.shown)
            self._changed = deque(name for name in parameters.unsaved if name in shown)
        for _ in range(min(_UNSAVED_PER_10_MS, len(self._changed))):
            self._send(self._changed.popleft())
        for _ in range(min(_LIST_PER_10_MS, len(self._list))):
            self._send(self._list.popleft())

    def arm(self, *, force: bool = False) -> bool:  # noqa: ARG002
        """Arm; nothing is in the way here."""
        if not self.armed:
            self.actuator_test = ActuatorTest()
            self.say("Armed by external command")
            self.armed = True
        return True

    def disarm(self, *, force: bool = False) -> bool:
        """Disarm, unless in the air."""
        if self.armed:
            if self.flying and not force:
                self.say("Disarming denied: not landed", mavlink.MAV_SEVERITY_CRITICAL)
                return False
            self.say("Disarmed by external command")
            self.armed = False
        return True

    def heartbeat(self) -> Any:
        """HEARTBEAT."""
        base = _AUTO_BASE if self.mode == _MISSION else _MANUAL_BASE
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        state = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            mavlink.MAV_AUTOPILOT_PX4,
            base | armed,
            self.mode,
            state,
            3,
        )

    def version(self) -> Any:
        """AUTOPILOT_VERSION."""
        major, minor, patch = FIRMWARE
        packed = major << 24 | minor << 16 | patch << 8 | 255
        return mavlink.MAVLink_autopilot_version_message(
            capabilities=CAPABILITIES,
            flight_sw_version=packed,
            middleware_sw_version=packed,
            os_sw_version=0,
            board_version=BOARD_VERSION,
            flight_custom_version=(0,) * 8,
            middleware_custom_version=(0,) * 8,
            os_custom_version=(0,) * 8,
            vendor_id=0,
            product_id=0,
            uid=0,
            uid2=self.uid2(),
        )

    def _send(self, name: str) -> None:
        parameters = self._parameters
        shown = parameters.shown
        kind = parameters.type_of(name)
        value = parameters[name]
        if name in self.habits.not_numbers:
            kind, value = mavlink.MAV_PARAM_TYPE_REAL32, float("nan")
        self._send_value(
            name,
            as_float(encode_value(value, kind, Encoding.BYTEWISE)),
            kind,
            len(shown),
            shown.index(name) if name in shown else NO_INDEX,
        )

    def _send_hash(self) -> None:
        value = as_float(encode_value(self._parameters.hash(), _UINT32, Encoding.BYTEWISE))
        self._send_value(_HASH, value, _UINT32, len(self._parameters.shown), NO_INDEX)

    def _send_value(self, name: str, field: float, kind: int, count: int, index: int) -> None:
        self.outgoing.append(
            mavlink.MAVLink_param_value_message(name.encode("ascii"), field, kind, count, index)
        )

    def _on_list(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        if not self._list:
            self._send_hash()
        self._list = deque(self._parameters.shown)

    def _on_read(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        shown = self._parameters.shown
        if message.param_index >= 0:
            if message.param_index < len(shown):
                self._send(shown[message.param_index])
            else:
                self._object(message, "DOES_NOT_EXIST")
        elif message.param_id == _HASH:
            self._send_hash()
        elif message.param_id in self._parameters:
            self._send(message.param_id)
        else:
            self._object(message, "DOES_NOT_EXIST")

    def _on_set(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        name = message.param_id
        if name == _HASH:
            self._list.clear()
        elif name not in self._parameters:
            self._object(message, "DOES_NOT_EXIST")
        elif message.param_type != self._parameters.type_of(name):
            return
        elif name in self.habits.denied:
            self._object(message, "READ_ONLY")
        elif name not in self.habits.ignored:
            sent = np.array([message.param_value], np.float32)
            (value,) = decode_values(sent, np.array([message.param_type]), Encoding.BYTEWISE)
            if name in self.habits.clamped:
                low, high = self.habits.clamped[name]
                value = min(max(value, low), high)
            self._parameters.set(name, float(value), self._now_s)
            self._send(name)

    def _object(self, message: Any, error: str) -> None:
        """PARAM_ERROR, where the firmware has it."""
        if self._answers_errors:
            self.object_to(message, error)

    def _on_mode(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        self.mode = message.custom_mode

    def _on_command(self, message: Any, now_ms: int) -> None:
        command = self._commands.get(message.command)
        result = mavlink.MAV_RESULT_UNSUPPORTED
        if command is not None:
            result = command(self, message, now_ms)
        self.acknowledge(message, result)

    def _set_interval(self, message: Any, now_ms: int) -> int:
        wanted, interval = int(message.param1), message.param2
        if wanted not in TELEMETRY:
            return int(mavlink.MAV_RESULT_FAILED)
        if interval == 0:
            hertz = DEFAULT_RATES.get(wanted, 0.0)
            interval = 1e6 / hertz if hertz else -1
        self.schedule.set(wanted, interval, now_ms)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _get_interval(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        wanted = int(message.param1)
        interval = max(self.schedule.interval_us(wanted), 0)
        self.outgoing.append(mavlink.MAVLink_message_interval_message(wanted, interval))
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _request_message(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        wanted = int(message.param1)
        if wanted == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self.outgoing.append(self.version())
        elif wanted in TELEMETRY:
            self.once.append(wanted)
        else:
            return int(mavlink.MAV_RESULT_FAILED)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _arm_or_disarm(self, message: Any, now_ms: int) -> int:
        result = self.arm_or_disarm(message, now_ms)
        failed = result == mavlink.MAV_RESULT_FAILED
        return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED) if failed else result

    def _test_actuator(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        if self.armed or not self._parameters.values["COM_MOT_TEST_EN"]:
            return int(mavlink.MAV_RESULT_DENIED)
        function = message.param5 if message.get_type() == "COMMAND_LONG" else message.x
        value, seconds = message.param1, message.param2
        known = self.actuator_test.command(int(function), value, seconds, self._now_s)
        return int(mavlink.MAV_RESULT_ACCEPTED if known else mavlink.MAV_RESULT_UNSUPPORTED)

    def _reboot(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        if self.armed or message.param1 != 1.0:
            return int(mavlink.MAV_RESULT_DENIED)
        self.reboot_wanted = True
        return int(mavlink.MAV_RESULT_ACCEPTED)

    handlers: ClassVar[Mapping[str, Callable[[Px4Talker, Any, int], None]]] = {
        "PARAM_REQUEST_LIST": _on_list,
        "PARAM_REQUEST_READ": _on_read,
        "PARAM_SET": _on_set,
        "TIMESYNC": Talker.on_timesync,
        "SET_MODE": _on_mode,
        "COMMAND_LONG": _on_command,
        "COMMAND_INT": _on_command,
    }

    _commands: ClassVar[Mapping[int, Callable[[Px4Talker, Any, int], int]]] = {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
        mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm_or_disarm,
        mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
        mavlink.MAV_CMD_ACTUATOR_TEST: _test_actuator,
    }
