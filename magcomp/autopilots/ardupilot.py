"""Every fact of ArduPilot that magcomp needs: docs/autopilots.md, ArduPilot."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from magcomp.autopilots import ardupilot_per_motor, ardupilot_settings
from magcomp.autopilots.ardupilot_correction import (
    COMPENSATION_OF,
    Calibration,
    FloatArray,
    MotorCompensation,
    calibration,
    calibration_at,
    calibration_changes,
    correct,
    correction_parameters,
    in_force,
    scale_in_force,
    soft_iron_matrix,
    soft_iron_parameters,
    unseen,
    vector_parameters,
)
from magcomp.autopilots.ardupilot_names import (
    ACTING,
    COMPASS_COUNT,
    COMPENSATION_SWITCH,
    KEPT,
    NUMBERS,
    PER_MOTOR_SWITCH,
    integer_type,
    parse,
    single_name,
    suffix,
    vector_names,
)
from magcomp.autopilots.ardupilot_recording import LINK_MESSAGES, LOG_BITS
from magcomp.autopilots.motor_test import ArduPilotMotorTest
from magcomp.autopilots.terms import (
    FieldMeaning,
    Kind,
    LagPrior,
    LagPriors,
    Leeway,
    MotorLaw,
    MotorOutputs,
    ParameterName,
    ThrustCurve,
)
from magcomp.errors import InputError
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Compass,
    Correction,
    InForce,
    ParameterHistory,
    Recording,
    Series,
    Vehicle,
)

_MOTOR_FUNCTIONS = {
    function: number for number, function in enumerate([*range(33, 41), *range(82, 86)], start=1)
}
"""SERVOn_FUNCTION to the number of the motor that it drives."""

_PUSHERS = frozenset([70.0, 73.0, 74.0])
"""SERVOn_FUNCTION: throttle, and a left and a right one."""

_DEFAULT_MOTORS = 4
_OUTPUTS_ASKED_FOR = 8
_CURVE_NAMES = ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX")
_PWM_NAMES = ("MOT_PWM_MIN", "MOT_PWM_MAX")
_TOLD_PER_READING = (Kind.OFFSET, Kind.MOTOR, Kind.PER_MOTOR)

_OTHER_COMPASSES = ("SCALED_IMU2", "SCALED_IMU3")
_LINK = LagPriors(LagPrior(0.08, 0.1), LagPrior(0.08, 0.1))
"""A reading is the mean over one update of 0.1 s, and waits for the stream that sends it."""

_LOGGED = LagPriors(LagPrior(0.05, 0.05), LagPrior(0.05, 0.1))
"""A reading is the mean over one update of 0.1 s, and is logged when it is made."""

_WITHOUT_THROTTLE = frozenset(["plane", "rover", "boat"])


class ArduPilot:
    """See :class:`magcomp.autopilots.protocol.Autopilot`."""

    key = "ardupilot"
    title = "ArduPilot"
    mavlink_number = 3
    integers_as_bytes = False
    switch = COMPENSATION_SWITCH
    compass_prefix = "COMPASS_"
    device_id_names = tuple(single_name("DEV_ID", compass) for compass in NUMBERS)
    log_folder = "APM/LOGS"
    kept_names = KEPT
    batteries = (0,)
    takes_over_all = True
    parameter_file = ".param"
    first_slot_leads = True
    first_compass_message = "RAW_IMU"
    offset_decimals = 2
    corrected_message = None
    corrected_unit = 1.0
    truth_message = "SIMSTATE"
    storage_s = 1.0  # a queue of writes, each soon, and the memory's lines after it
    motor_test = ArduPilotMotorTest()
    device_ids_describe = "bus, address and type of a sensor, which are alike in vehicles of a kind"

    def require_fittable(self, recording: Recording) -> None:
        """Everything of ArduPilot that can be read can be fitted."""

    def field_meaning(self, source_format: str) -> FieldMeaning:  # noqa: ARG002
        """The same in every source: the dataflash log casts to int16 as the link does.

        Notes
        -----
        A reading is the mean over one update of 0.1 s, so it is centred 0.05 s ago, and it is
        corrected with the battery or throttle read one update, 0.1 s, ago (ArduCopter 4.6.3; the
        recording flight_wrong_mot shows it).
        """
        return FieldMeaning(truncated=True, applied_later_s=0.05)

    def compass_messages(self, values: Mapping[str, float]) -> Mapping[int, str]:  # noqa: ARG002
        """Each message carries the compass of its number, by priority."""
        return dict(enumerate((self.first_compass_message, *_OTHER_COMPASSES), start=1))

    def from_telemetry(
        self,
        told: Mapping[int, Series],
        values: Mapping[str, float],  # noqa: ARG002
    ) -> tuple[Mapping[int, Series], frozenset[int]]:
        """The messages are of compass priority 1, 2, 3, corrected and in body axes."""
        return told, frozenset()

    def lag_priors(self, source_format: str) -> LagPriors:
        """The dataflash log stamps a reading where it is made, a link where it is sent."""
        return _LOGGED if source_format == "dataflash" else _LINK

    def motor_outputs(self, parameters: ParameterHistory, outputs: int) -> MotorOutputs | None:
        """By SERVOn_FUNCTION, else the first four; their limits MOT_PWM_MIN and _MAX.

        Notes
        -----
        AP_MotorsMulticopter: output = spin_min + (spin_max − spin_min) · c(thrust), with
        thrust = (1 − expo) · c + expo · c².
        """
        functions = [parameters.last(f"SERVO{index + 1}_FUNCTION", 0.0) for index in range(outputs)]
        named = {
            index: _MOTOR_FUNCTIONS[function]
            for index, function in enumerate(functions)
            if function in _MOTOR_FUNCTIONS
        }
        driven = named or {index: index + 1 for index in range(min(_DEFAULT_MOTORS, outputs))}
        low, high = (
            parameters.last(name, 0.0) or default
            for name, default in zip(_PWM_NAMES, (1000.0, 2000.0), strict=True)
        )
        if not high > low:
            return None
        driven = dict(sorted(driven.items(), key=lambda item: item[1]))
        curve = self._thrust_curve(parameters)
        pushers = tuple(n for n, function in enumerate(functions) if function in _PUSHERS)
        numbers = tuple(driven.values())
        return MotorOutputs(tuple(driven), low, high, curve, numbers, pushers, bool(named))

    @staticmethod
    def _thrust_curve(parameters: ParameterHistory) -> ThrustCurve | None:
        if not set(_CURVE_NAMES) <= parameters.names:
            return None
        expo, spin_min, spin_max = (parameters.last(name, 0.0) for name in _CURVE_NAMES)
        if not spin_max > spin_min:
            return None
        return ThrustCurve(float(np.clip(expo, -1.0, 1.0)), spin_min, spin_max)

    def parse(self, name: str) -> ParameterName | None:
        """See :func:`magcomp.autopilots.ardupilot_names.parse`."""
        return parse(name)

    def integer_type(self, name: str) -> int | None:
        """INT8 for switches, INT16 and INT32 for what is larger."""
        return integer_type(name)

    def choices(self, name: str) -> tuple[int, ...]:
        """COMPASS_MOTCT is off, by throttle or by current."""
        if name == COMPENSATION_SWITCH:
            return tuple(MotorCompensation)
        return (0, 1) if name == PER_MOTOR_SWITCH else ()

    def compasses(self, values: Mapping[str, float]) -> tuple[Compass, ...]:
        """By COMPASS_DEV_ID, and what COMPASS_EXTERNAL, ORIENT and USE say of each."""
        return ardupilot_settings.compasses(values)

    def orientation_name(self, compass: int) -> str:
        """COMPASS_ORIENT of the compass."""
        return single_name("ORIENT", compass)

    def changes(
        self,
        parameters: ParameterHistory,
        *,
        armed: Series | None = None,  # noqa: ARG002
        told_per_reading: bool = False,
    ) -> tuple[float, ...]:
        """Any report of an acting parameter with another value than before."""
        names = (*ACTING, *ardupilot_per_motor.NAMES)
        if told_per_reading:
            names = tuple(
                name
                for name in names
                if (found := parse(name)) is None or found.kind not in _TOLD_PER_READING
            )
        return calibration_changes(parameters, names)

    def in_force(self, values: Mapping[str, float], compass: int) -> InForce:
        """Every parameter acts at once, armed or not."""
        return ardupilot_per_motor.over(in_force(calibration(values, compass)), compass, values)

    def in_force_at(self, parameters: ParameterHistory, compass: int, time: float) -> InForce:
        """Every parameter acts from its report, armed or not."""
        found = in_force(calibration_at(parameters, compass, time), unseen(parameters, compass))
        return ardupilot_per_motor.over_at(found, compass, parameters, time)

    def in_force_over(
        self,
        parameters: ParameterHistory,
        compass: int,
        times: Sequence[float],
        *,
        armed: Series | None,  # noqa: ARG002
    ) -> tuple[InForce, ...]:
        """Armed or not."""
        return tuple(self.in_force_at(parameters, compass, time) for time in times)

    def regressor(self, values: Mapping[str, float]) -> str | None:
        """COMPASS_MOTCT serves all compasses."""
        return in_force(calibration(values, 1)).regressor

    def left_out(self, parameters: ParameterHistory) -> Mapping[int, InputError]:
        """Compasses with a value that is none, or a soft iron that cannot be undone."""
        return ardupilot_settings.left_out(parameters)

    def correction_parameters(
        self,
        correction: Correction,
        compass: int,
        values: Mapping[str, float],
        *,
        regressor: str,  # noqa: ARG002
        soft_iron_fitted: bool,
        leeway: Leeway,  # noqa: ARG002
    ) -> dict[str, float]:
        """COMPASS_OFS, DIA, ODI and MOT; COMPASS_SCALE stays as it is.

        A motor vector alone where nothing is known of the vehicle: its offsets are unknown then.
        """
        return self._of_correction(correction, compass, values, soft_iron_fitted=soft_iron_fitted)

    @staticmethod
    def _of_correction(
        correction: Correction,
        compass: int,
        values: Mapping[str, float],
        *,
        soft_iron_fitted: bool,
    ) -> dict[str, float]:
        made = correction_parameters(correction, compass, scale_in_force(values, compass))
        if not values:
            return {name: value for name, value in made.items() if _is(name, Kind.MOTOR)}
        if not any(_is(name, Kind.MOTOR) or name == COMPENSATION_SWITCH for name in values):
            return made
        # A soft iron that was fitted belongs to its offsets, even where the list is not whole.
        return {
            name: value
            for name, value in made.items()
            if name in values or (soft_iron_fitted and _is(name, Kind.DIAGONAL, Kind.OFF_DIAGONAL))
        }

    def motor_law(self, compass: int, values: Mapping[str, float]) -> MotorLaw | None:
        """COMPASS_PMOT, which only compass 1 has, and only in some builds."""
        return ardupilot_per_motor.law(compass, values)

    def per_motor_parameters(
        self,
        correction: Correction,
        exponent: float,
        compass: int,
        values: Mapping[str, float],
        *,
        soft_iron_fitted: bool,
    ) -> dict[str, float]:
        """COMPASS_PMOT in the place of COMPASS_MOT, which the firmware then ignores."""
        made = self._of_correction(correction, compass, values, soft_iron_fitted=soft_iron_fitted)
        rest = {name: value for name, value in made.items() if not _is(name, Kind.MOTOR)}
        return rest | ardupilot_per_motor.parameters(correction.motor, exponent)

    def switch_parameters(
        self,
        regressor: str,
        compasses: Collection[int],
        values: Mapping[str, float],
        *,
        battery: int = 0,  # noqa: ARG002
    ) -> dict[str, float]:
        """COMPASS_MOTCT, and zeros for what it would wake."""
        made = {COMPENSATION_SWITCH: float(COMPENSATION_OF[regressor])}
        if 1 in compasses and values.get(PER_MOTOR_SWITCH, 0.0):
            made[PER_MOTOR_SWITCH] = 0.0
        for compass in NUMBERS:
            stored = (values.get(name, 0.0) for name in vector_names("MOT", compass))
            if compass not in compasses and any(stored):
                made |= self.neutral_parameters(compass, regressor, values)
        return made

    def neutral_parameters(
        self, compass: int, regressor: str, values: Mapping[str, float]
    ) -> dict[str, float]:
        """COMPASS_MOT of zeros, unless it is in force for the same quantity already."""
        if self.regressor(values) == regressor:
            return {}
        return vector_parameters("MOT", compass, np.zeros(3))

    def relevant_names(self) -> tuple[str, ...]:
        """Everything that acts on a reading, and the settings that are warned of."""
        return ardupilot_settings.relevant_names()

    def useful_names(self) -> tuple[str, ...]:
        """The thrust curve, and whether there is a current sensor."""
        return (*_CURVE_NAMES, *_PWM_NAMES, "BATT_MONITOR")

    def output_names(self) -> tuple[str, ...]:
        """SERVOn_FUNCTION of the first eight."""
        return tuple(f"SERVO{n}_FUNCTION" for n in range(1, _OUTPUTS_ASKED_FOR + 1))

    def warnings(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """Of COMPASS_PMOT_EN, LEARN, USE, SCALE, ORIENT and OFFS_MAX."""
        return tuple(ardupilot_settings.warnings(values))

    def write_warnings(
        self, asked: Mapping[str, float], held: Mapping[str, float]
    ) -> tuple[str, ...]:
        """Of vectors without their switch."""
        return tuple(ardupilot_settings.write_warnings(asked, held))

    def multiplied(self, vehicle: Vehicle) -> tuple[str, ...]:
        """The current; in copters and subs, which hand it to the compass, the throttle too."""
        return (CURRENT,) if vehicle.kind in _WITHOUT_THROTTLE else (CURRENT, THROTTLE)

    def how_to_record(self, quantity: str, source_format: str) -> str:
        """A bit of LOG_BITMASK for its own log, a message for telemetry."""
        asked = LOG_BITS if source_format == "dataflash" else LINK_MESSAGES
        return asked[quantity]

    def link_notes(self, compasses: int) -> tuple[str, ...]:  # noqa: ARG002
        """None: each message says whose it is."""
        return ()

    def reading_notes(self, recording: Recording) -> tuple[str, ...]:  # noqa: ARG002
        """None: the messages say what they are."""
        return ()

    def deaf_hint(self) -> str:
        """SYSID_ENFORCE; since 4.7 a bit of MAV_OPTIONS, and the number is MAV_GCS_SYSID."""
        return (
            "with SYSID_ENFORCE on, it listens only to the ground station whose number is its "
            "SYSID_MYGCS: give that number with --source-system"
        )

    def no_compass_hint(self) -> str:
        """The switch of all compasses, and the message of the first."""
        return "is COMPASS_ENABLE 1, and does the link carry RAW_IMU?"


def _is(name: str, *kinds: Kind) -> bool:
    found = parse(name)
    return found is not None and found.kind in kinds


__all__ = [
    "COMPASS_COUNT",
    "COMPENSATION_OF",
    "COMPENSATION_SWITCH",
    "ArduPilot",
    "Calibration",
    "FloatArray",
    "MotorCompensation",
    "calibration",
    "calibration_at",
    "calibration_changes",
    "correct",
    "correction_parameters",
    "in_force",
    "soft_iron_matrix",
    "soft_iron_parameters",
    "suffix",
    "vector_names",
    "vector_parameters",
]
