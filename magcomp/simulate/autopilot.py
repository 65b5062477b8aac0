"""How the autopilot answers: parameters, commands, arming. Messages in, messages out, no I/O.

The rules, as in ArduCopter 4.6 (docs/autopilots.md, ArduPilot: parameters):

- An unknown parameter, a NaN or an infinity gets no reply.
- A set is answered with index 65535; setting _X answers for Y and Z too.
- A read-only parameter answers with its old value and a warning in words.
- The parameter list comes at its own pace; asking again begins it again.
- At most 20 requests to read one parameter wait; more are dropped.
- A command that is not known is acknowledged as unsupported.
- A motor test is refused in the air, and looks armed while it runs (motor_test.py).
- With SYSID_ENFORCE only the ground station whose system is SYSID_MYGCS is listened to.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate.habits import BOARD_VERSION, Habits
from magcomp.simulate.motor_test import MotorTest
from magcomp.simulate.parameters import ParameterStore, is_read_only
from magcomp.simulate.streams import GROUPS, TELEMETRY
from magcomp.simulate.talker import Talker

FIRMWARE = "4.6.3"
GIT_HASH = "92b0cd78"
BOARD_ID = "magcomp simulated vehicle"

_NO_INDEX = 65535
_LIST_PER_10_MS = 8
_READS_PER_10_MS = 5
_READS_HELD = 20
_MODES = {"stabilize": 0, "auto": 3, "guided": 4, "loiter": 5}


class Autopilot(Talker):
    """Everything ArduCopter says and does that has nothing to do with physics.

    Parameters
    ----------
    store
        The parameters.
    system, component
        MAVLink identity.
    answers_errors
        Answer with PARAM_ERROR where 4.6 is silent, as newer firmware does.
    habits
        What it does besides.
    """

    def __init__(
        self,
        store: ParameterStore,
        system: int = 1,
        component: int = 1,
        *,
        answers_errors: bool = False,
        habits: Habits | None = None,
    ) -> None:
        super().__init__(TELEMETRY, system, component, habits)
        self.store = store
        self._now_s = 0.0
        self._answers_errors = answers_errors
        self.mode = _MODES["stabilize"]
        self.start_up()

    def start_up(self) -> None:
        """Forget what a reboot forgets; announce the firmware."""
        self.forget()
        self.motor_test = MotorTest(self.store["MOT_PWM_MIN"], self.store["MOT_PWM_MAX"])
        self._list: deque[tuple[int, str]] = deque()
        self._reads: deque[Any] = deque()
        self.store.sort_compasses()
        self.store.put("STAT_BOOTCNT", self.store["STAT_BOOTCNT"] + 1)
        self.outgoing.append(self.heartbeat())
        self._banner()
        self.say("ArduPilot Ready")

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_INFO) -> None:
        """Send a line of text."""
        self.outgoing.append(
            mavlink.MAVLink_statustext_message(severity, text.encode("ascii")[:50])
        )

    def send_paced(self, now_s: float) -> None:
        """Store and send the next few parameters; called every 10 ms, in seconds since power-up."""
        self._now_s = now_s
        self.store.settle(now_s)
        if self.motor_test.running:
            self.motor_test.advance(now_s)
            if not self.motor_test.running:
                self._end_motor_test()
        for _ in range(min(_READS_PER_10_MS, len(self._reads))):
            self._answer_read(self._reads.popleft())
        names = len(self.store.listed) if self._list else 0
        for _ in range(min(_LIST_PER_10_MS, len(self._list))):
            index, name = self._list.popleft()
            self._send_parameter(name, index, names)

    def arm(self, *, force: bool = False) -> bool:
        """Arm, unless a check forbids it; whether the motors are armed now."""
        if not self.armed and not self.motor_test.running:
            reason = None if force else self._arming_objection()
            if reason is not None:
                self.say(f"Arm: {reason}", mavlink.MAV_SEVERITY_CRITICAL)
                return False
            self.say("Arming motors")
            self.armed = True
        return True

    def disarm(self, *, force: bool = False) -> bool:
        """Disarm, unless in the air; whether the motors are disarmed now."""
        if self.motor_test.running:
            self._end_motor_test()
        if self.armed:
            if self.flying and not force:
                return False
            self.say("Disarming motors")
            self.armed = False
        return True

    def handle(self, message: Any, now_ms: int) -> None:
        """Act on one message from the ground; answers are in ``outgoing``."""
        stranger = message.get_srcSystem() != self.store["SYSID_MYGCS"]
        if stranger and self.store["SYSID_ENFORCE"]:
            return
        super().handle(message, now_ms)

    def heartbeat(self) -> Any:
        """HEARTBEAT."""
        mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        mode |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        if self.mode in (_MODES["auto"], _MODES["guided"]):
            mode |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        armed = self.armed or self.motor_test.running
        if armed:
            mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return mavlink.MAVLink_heartbeat_message(
            type=mavlink.MAV_TYPE_QUADROTOR,
            autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode=mode,
            custom_mode=self.mode,
            system_status=mavlink.MAV_STATE_ACTIVE if armed else mavlink.MAV_STATE_STANDBY,
            mavlink_version=3,
        )

    def version(self) -> Any:
        """AUTOPILOT_VERSION."""
        major, minor, patch = (int(part) for part in FIRMWARE.split("."))
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        )
        return mavlink.MAVLink_autopilot_version_message(
            capabilities=capabilities,
            flight_sw_version=major << 24 | minor << 16 | patch << 8 | 255,
            middleware_sw_version=0,
            os_sw_version=0,
            board_version=BOARD_VERSION,
            flight_custom_version=tuple(GIT_HASH.encode("ascii")),
            middleware_custom_version=(0,) * 8,
            os_custom_version=(0,) * 8,
            vendor_id=0,
            product_id=0,
            uid=0,
            uid2=self.uid2(),
        )

    def _arming_objection(self) -> str | None:
        most = self.store["COMPASS_OFFS_MAX"]
        for number, suffix in enumerate(("", "2", "3"), start=1):
            offset = [self.store[f"COMPASS_OFS{suffix}_{axis}"] for axis in "XYZ"]
            if np.linalg.norm(offset) > most:
                return f"Compass {number} offsets too high"
        return None

    def _banner(self) -> None:
        self.say(f"ArduCopter V{FIRMWARE} ({GIT_HASH})")
        self.say(BOARD_ID)
        self.say("Frame: QUAD/X")

    def _send_parameter(self, name: str, index: int, count: int | None = None) -> None:
        self.outgoing.append(
            mavlink.MAVLink_param_value_message(
                param_id=name.encode("ascii"),
                param_value=np.nan if name in self.habits.not_numbers else self.store[name],
                param_type=self.store.type_of(name),
                param_count=len(self.store.listed) if count is None else count,
                param_index=index,
            )
        )

    def _on_list(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        self._banner()
        self._list = deque(enumerate(self.store.listed))

    def _on_read(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        if len(self._reads) < _READS_HELD:
            self._reads.append(message)

    def _answer_read(self, message: Any) -> None:
        listed = self.store.listed
        if message.param_index == -1 and message.param_id in self.store:
            self._send_parameter(message.param_id, _NO_INDEX)
        elif 0 <= message.param_index < len(listed):
            self._send_parameter(listed[message.param_index], message.param_index)
        else:
            self._object(message, "DOES_NOT_EXIST")

    def _on_set(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        name, value = message.param_id, message.param_value
        if name not in self.store:
            self._object(message, "DOES_NOT_EXIST")
        elif not np.isfinite(value):
            self._object(message, "VALUE_OUT_OF_RANGE")
        elif name in self.habits.ignored:
            return
        elif is_read_only(name) or name in self.habits.denied:
            self.say(f"Param write denied ({name})", mavlink.MAV_SEVERITY_WARNING)
            self._object(message, "READ_ONLY")
            self._send_parameter(name, _NO_INDEX)
        else:
            low, high = self.habits.clamped.get(name, (-np.inf, np.inf))
            self.store.write(name, min(max(value, low), high), self._now_s)
            for echoed in self.store.echoed(name):
                self._send_parameter(echoed, _NO_INDEX)

    def _object(self, message: Any, error: str) -> None:
        """PARAM_ERROR, where the firmware has it."""
        if self._answers_errors:
            self.object_to(message, error)

    def _on_data_stream(self, message: Any, now_ms: int) -> None:
        rate = message.req_message_rate if message.start_stop else 0
        for wanted in GROUPS.get(message.req_stream_id, ()):
            self.schedule.set(wanted, 1e6 / rate if rate else 0, now_ms)

    def _on_version_request(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        self.outgoing.append(self.version())

    def _on_mode(self, message: Any, now_ms: int) -> None:  # noqa: ARG002
        self.mode = message.custom_mode

    def _on_command(self, message: Any, now_ms: int) -> None:
        command = self._commands.get(message.command)
        result = mavlink.MAV_RESULT_UNSUPPORTED
        if command is not None:
            result = command(self, message, now_ms)
        # The acknowledgement goes before whatever the command has asked for.
        self.acknowledge(message, result)

    def _set_interval(self, message: Any, now_ms: int) -> int:
        wanted = int(message.param1)
        if wanted not in TELEMETRY:
            self.say(f"No ap_message for mavlink id ({wanted})")
            return int(mavlink.MAV_RESULT_DENIED)
        # 0 asks for the default, and by default nothing is streamed.
        self.schedule.set(wanted, message.param2, now_ms)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _get_interval(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        wanted = int(message.param1)
        known = wanted in TELEMETRY
        interval = self.schedule.interval_us(wanted) if known else 0
        self.outgoing.append(mavlink.MAVLink_message_interval_message(wanted, interval))
        return int(mavlink.MAV_RESULT_ACCEPTED if known else mavlink.MAV_RESULT_FAILED)

    def _request_message(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        wanted = int(message.param1)
        if wanted not in (*TELEMETRY, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION):
            return int(mavlink.MAV_RESULT_FAILED)
        self.once.append(wanted)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _request_capabilities(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        self.once.append(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _reboot(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        if message.param1 != 1.0 or self.armed or self.motor_test.running:
            return int(mavlink.MAV_RESULT_FAILED)
        self.reboot_wanted = True
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _test_motor(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        if not self.motor_test.running:
            if self.flying:
                self.say("Motor Test: vehicle not landed", mavlink.MAV_SEVERITY_CRITICAL)
                return int(mavlink.MAV_RESULT_FAILED)
            self.say("starting motor test")
        count = message.param5 if message.get_type() == "COMMAND_LONG" else message.x
        values = (message.param1, message.param2, message.param3, message.param4, count)
        self.motor_test.command(values, self._now_s)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _end_motor_test(self) -> None:
        self.say("finished motor test")
        self.motor_test.stop()
        self.armed = False

    def _set_mode(self, message: Any, now_ms: int) -> int:  # noqa: ARG002
        self.mode = int(message.param2)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    handlers: ClassVar[Mapping[str, Callable[[Autopilot, Any, int], None]]] = {
        "PARAM_REQUEST_LIST": _on_list,
        "PARAM_REQUEST_READ": _on_read,
        "PARAM_SET": _on_set,
        "REQUEST_DATA_STREAM": _on_data_stream,
        "TIMESYNC": Talker.on_timesync,
        "AUTOPILOT_VERSION_REQUEST": _on_version_request,
        "SET_MODE": _on_mode,
        "COMMAND_LONG": _on_command,
        "COMMAND_INT": _on_command,
    }

    _commands: ClassVar[Mapping[int, Callable[[Autopilot, Any, int], int]]] = {
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
        mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _request_capabilities,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM: Talker.arm_or_disarm,
        mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
        mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
        mavlink.MAV_CMD_DO_MOTOR_TEST: _test_motor,
    }
