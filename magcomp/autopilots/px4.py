"""Every fact of PX4 that magcomp needs, release/1.12 to 1.17: docs/autopilots.md, PX4."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from magcomp.autopilots import px4_settings
from magcomp.autopilots.motor_test import Px4MotorTest
from magcomp.autopilots.px4_correction import (
    MGAUSS,
    REGRESSOR_OF,
    Compensation,
    after_start,
    compensation_of,
    in_force,
    offset_zone,
    stored,
    stretches,
    unseen,
)
from magcomp.autopilots.px4_emission import noticed
from magcomp.autopilots.px4_names import (
    COMPENSATION_SWITCH,
    KEPT,
    integer_type,
    parse,
    single_name,
    vector_names,
)
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.autopilots.px4_settings import NUMBERS
from magcomp.autopilots.px4_telemetry import by_slot
from magcomp.autopilots.terms import (
    FieldMeaning,
    LagPrior,
    LagPriors,
    Leeway,
    MotorLaw,
    MotorOutputs,
    ParameterName,
    ThrustCurve,
)
from magcomp.errors import InputError, MissingDataError
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Compass,
    Correction,
    FloatArray,
    InForce,
    ParameterHistory,
    Recording,
    Series,
    Vehicle,
)

FIRST_VERSION = (1, 12)
"""Before it the correction was another one, or there was none."""

_THRUST_CURVE = "THR_MDL_FAC"
_LOW, _HIGH = 1000.0, 2000.0
_LOGGED = LagPriors(LagPrior(0.0, 0.05), LagPrior(0.0, 0.1))
"""A log stamps a reading with the moment of measurement."""
_LINK = LagPriors(LagPrior(0.0, 0.1), LagPrior(0.0, 0.1))

_ALL_CURRENTS = "fit by throttle, or let one sensor measure what all the motors draw"
_USUAL_TOPICS = "set SDLOG_PROFILE to 65 (the usual topics, and each compass at 10 Hz)"
_LOG_BITS = {
    "compass": f"{_USUAL_TOPICS}, and fly again",
    "more readings": f"fly longer, or {_USUAL_TOPICS}",
    "control": f"{_USUAL_TOPICS}, and fly again",
    "current": f"set up a current sensor, {_USUAL_TOPICS}, and fly again",
    "all currents": _ALL_CURRENTS,
    "attitude": f"{_USUAL_TOPICS}, and fly again",
    "parameters": "give the whole log, which has them at its beginning",
    "position": "fly where satellites are seen",
}
_SEVERAL = 2
_OTHER_COMPASSES = ("SCALED_IMU2", "SCALED_IMU3")
_OWN_LOG = "give the vehicle's own log of the same flight (.ulg)"
_LINK_MESSAGES = {
    "compass": f"{_OWN_LOG}, or ask for SCALED_IMU, SCALED_IMU2 and SCALED_IMU3 at 10 Hz",
    "more readings": f"{_OWN_LOG}, or ask for SCALED_IMU, SCALED_IMU2 and SCALED_IMU3 at 10 Hz",
    "control": f"{_OWN_LOG}, or ask for BATTERY_STATUS and VFR_HUD at 10 Hz",
    "current": f"{_OWN_LOG}, or set up a current sensor and ask for BATTERY_STATUS at 10 Hz",
    "all currents": _ALL_CURRENTS,
    "attitude": f"{_OWN_LOG}, or ask for ATTITUDE at 20 Hz",
    "parameters": f"{_OWN_LOG}, or let the ground station read all parameters while it records",
    "position": "ask for GLOBAL_POSITION_INT, and fly where satellites are seen",
}


class Px4:
    """See :class:`magcomp.autopilots.protocol.Autopilot`."""

    key = "px4"
    title = "PX4"
    mavlink_number = 12
    integers_as_bytes = True
    switch = COMPENSATION_SWITCH
    compass_prefix = "CAL_MAG"
    device_id_names = tuple(single_name("ID", number) for number in NUMBERS)
    log_folder = "log"
    kept_names = KEPT
    batteries = (0, 1)
    takes_over_all = False
    parameter_file = ".params"
    first_slot_leads = False
    first_compass_message = "SCALED_IMU"
    offset_decimals = 4
    corrected_message = "HIGHRES_IMU"
    corrected_unit = MGAUSS
    truth_message = "HIL_STATE_QUATERNION"
    storage_s = 2.5  # it saves all at once, 0.3 s after a change and not again for 2 s
    motor_test = Px4MotorTest()
    device_ids_describe = "bus, address and type of a sensor, which are alike in vehicles of a kind"

    def require_fittable(self, recording: Recording) -> None:
        """Refuse firmware before 1.12, and recordings without the compasses' parameters."""
        version = recording.vehicle.firmware
        numbers = tuple(int(part) for part in re.findall(r"\d+", version)[:2])
        if numbers and numbers < FIRST_VERSION:
            raise MissingDataError(
                f"{recording.source} must be of {self.title} 1.12 or newer; instead it is of "
                f"{version}, which corrects its compasses in another way or not at all: update "
                "the vehicle, calibrate it and record again"
            )
        if COMPENSATION_SWITCH not in recording.parameters.names:
            raise MissingDataError(
                f"{recording.source} must tell the vehicle's {COMPENSATION_SWITCH}; instead it "
                + (
                    "holds no parameters: give the .ulg of the same flight"
                    if not recording.parameters.names
                    else "does not: its firmware is older than 1.12, or its parameters are not "
                    "whole; update it and record again, or give the whole .ulg"
                )
            )

    def field_meaning(self, source_format: str) -> FieldMeaning:
        """On the link whole mGauss, in the log floats."""
        return FieldMeaning(truncated=source_format != "ulog", applied_later_s=0.0)

    def compass_messages(self, values: Mapping[str, float]) -> Mapping[int, str]:
        """In the order of the slots that are in use; which sensor has which, no message says."""
        slots = [compass.slot for compass in px4_settings.compasses(values)]
        return dict(zip(slots, (self.first_compass_message, *_OTHER_COMPASSES), strict=False))

    def from_telemetry(
        self, told: Mapping[int, Series], values: Mapping[str, float]
    ) -> tuple[Mapping[int, Series], frozenset[int]]:
        """The sensors' own fields, turned into body axes; none while no slot is known."""
        found = by_slot(told, values)
        return found, frozenset(found)

    def lag_priors(self, source_format: str) -> LagPriors:
        """The log stamps a reading with the mean time of what it is made of."""
        return _LOGGED if source_format == "ulog" else _LINK

    def motor_outputs(self, parameters: ParameterHistory, outputs: int) -> MotorOutputs | None:
        """All that are driven; THR_MDL_FAC says how far thrust goes with their square."""
        factor = float(np.clip(parameters.last(_THRUST_CURVE, 0.0), 0.0, 1.0))
        curve = ThrustCurve(factor if np.isfinite(factor) else 0.0, 0.0, 1.0)
        return MotorOutputs(tuple(range(outputs)), _LOW, _HIGH, curve)

    def parse(self, name: str) -> ParameterName | None:
        """Take a name apart; slot 0 is compass 1."""
        return parse(name)

    def integer_type(self, name: str) -> int | None:
        """INT32 for all that hold whole numbers."""
        return integer_type(name)

    def choices(self, name: str) -> tuple[int, ...]:
        """CAL_MAG_COMP_TYP is off, by thrust, or by the current of battery 0 or 1."""
        return tuple(Compensation) if name == COMPENSATION_SWITCH else ()

    def compasses(self, values: Mapping[str, float]) -> tuple[Compass, ...]:
        """By CAL_MAGn_ID."""
        return px4_settings.compasses(values)

    def orientation_name(self, compass: int) -> str:
        """CAL_MAGn_ROT of the compass."""
        return single_name("ROT", compass)

    def changes(
        self,
        parameters: ParameterHistory,
        *,
        armed: Series | None = None,
        told_per_reading: bool = False,  # noqa: ARG002
    ) -> tuple[float, ...]:
        """Times at which something else came into force, which is later than it was set."""
        return tuple(
            sorted(
                {time for n in NUMBERS for time, _ in stretches(parameters, n, armed)[1:]},
            )
        )

    def in_force(self, values: Mapping[str, float], compass: int) -> InForce:
        """As after a start with these values."""
        return in_force(after_start(values, compass), sensor_to_body(values, compass))

    def in_force_at(self, parameters: ParameterHistory, compass: int, time: float) -> InForce:
        """What of the parameters had been taken over by a vehicle that was never armed."""
        return self.in_force_over(parameters, compass, (time,), armed=None)[0]

    def in_force_over(
        self,
        parameters: ParameterHistory,
        compass: int,
        times: Sequence[float],
        *,
        armed: Series | None,
    ) -> tuple[InForce, ...]:
        """What of the parameters had been taken over."""
        found = stretches(parameters, compass, armed)
        rotation = sensor_to_body(parameters.latest, compass)
        missing = unseen(parameters, compass)
        forces = [in_force(calibration, rotation, missing) for _, calibration in found]
        since = [time for time, _ in found]
        return tuple(forces[bisect_right(since, time) - 1] for time in times)

    def regressor(self, values: Mapping[str, float]) -> str | None:
        """CAL_MAG_COMP_TYP serves all compasses; values that the firmware does not know are off."""
        return REGRESSOR_OF.get(stored(values, 1).compensation)

    def left_out(self, parameters: ParameterHistory) -> Mapping[int, InputError]:
        """Compasses with a value that is none, or without a slot."""
        return px4_settings.left_out(parameters)

    def correction_parameters(
        self,
        correction: Correction,
        compass: int,
        values: Mapping[str, float],
        *,
        regressor: str,
        soft_iron_fitted: bool,
        leeway: Leeway,
    ) -> dict[str, float]:
        """COMP and OFF, and SCALE and ODIAG where fitted, such that the firmware notices them."""
        made = noticed(
            correction,
            after_start(values, compass),
            sensor_to_body(values, compass),
            offset_zone(values),
            leeway,
            compensation=compensation_of(regressor, 0),
            soft_iron_too=soft_iron_fitted,
        )
        found = _vector("COMP", compass, made.motor) | _vector("OFF", compass, made.offset)
        if soft_iron_fitted:
            found |= _vector("SCALE", compass, made.scale)
            found |= _vector("ODIAG", compass, made.off_diagonal)
        return found

    def motor_law(self, compass: int, values: Mapping[str, float]) -> MotorLaw | None:  # noqa: ARG002
        """None: PX4 multiplies one quantity for all motors."""
        return None

    def per_motor_parameters(
        self,
        correction: Correction,  # noqa: ARG002
        exponent: float,  # noqa: ARG002
        compass: int,  # noqa: ARG002
        values: Mapping[str, float],  # noqa: ARG002
        *,
        soft_iron_fitted: bool,  # noqa: ARG002
    ) -> dict[str, float]:
        """None, as there is no such law."""
        return {}

    def switch_parameters(
        self,
        regressor: str,
        compasses: Collection[int],
        values: Mapping[str, float],
        *,
        battery: int = 0,
    ) -> dict[str, float]:
        """CAL_MAG_COMP_TYP, and zeros for what it would wake."""
        made = {COMPENSATION_SWITCH: float(compensation_of(regressor, battery))}
        for compass in NUMBERS:
            woken = any(values.get(name, 0.0) for name in vector_names("COMP", compass))
            if compass not in compasses and woken:
                made |= self.neutral_parameters(compass, regressor, values)
        return made

    def neutral_parameters(
        self, compass: int, regressor: str, values: Mapping[str, float]
    ) -> dict[str, float]:
        """COMP of zeros, unless it is in force for the same quantity already."""
        if self.regressor(values) == regressor:
            return {}
        return _vector("COMP", compass, np.zeros(3))

    def relevant_names(self) -> tuple[str, ...]:
        """The switch, and each slot's id, rotation, priority and vectors."""
        return px4_settings.relevant_names()

    def useful_names(self) -> tuple[str, ...]:
        """How the board and the compasses are turned, the thrust curve, the number of motors."""
        return (*px4_settings.turning_names(), _THRUST_CURVE, self.motor_test.count_name)

    def output_names(self) -> tuple[str, ...]:
        """None: the log says by itself which outputs are motors."""
        return ()

    def warnings(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """Of CAL_MAG_COMP_TYP, PRIO and ROT."""
        return tuple(px4_settings.warnings(values))

    def write_warnings(
        self,
        asked: Mapping[str, float],
        held: Mapping[str, float],
    ) -> tuple[str, ...]:
        """Of vectors without their switch, and of a restart."""
        return tuple(px4_settings.write_warnings(asked, held))

    def multiplied(self, vehicle: Vehicle) -> tuple[str, ...]:  # noqa: ARG002
        """Thrust and current, whatever the vehicle."""
        return (CURRENT, THROTTLE)

    def how_to_record(self, quantity: str, source_format: str) -> str:
        """A bit of SDLOG_PROFILE; telemetry as it is sends too little of everything."""
        asked = _LOG_BITS if source_format == "ulog" else _LINK_MESSAGES
        return asked[quantity]

    def link_notes(self, compasses: int) -> tuple[str, ...]:
        """Of messages that do not say which compass is which."""
        if compasses < _SEVERAL:
            return ()
        return (
            "the link does not tell which compass is which: each is taken for the calibration slot "
            f"that fits it best; {_OWN_LOG} to be sure",
        )

    def reading_notes(self, recording: Recording) -> tuple[str, ...]:
        """Of telemetry that does not say which compass is which."""
        if recording.format == "ulog" or len(recording.field) < 2:
            return ()
        named = ", ".join(single_name("ID", number) for number in sorted(recording.field))
        return (
            "telemetry does not say which compass is which: its messages are taken for "
            f"{named} by how well each calibration fits; {_OWN_LOG} to be sure",
        )

    def deaf_hint(self) -> str:
        """It takes every ground station; a link may carry one way only."""
        return "does the link carry anything to the vehicle, or only from it?"

    def no_compass_hint(self) -> str:
        """Telemetry sends no compass by itself."""
        return "does the link carry SCALED_IMU?"


def _vector(kind: str, compass: int, vector: FloatArray) -> dict[str, float]:
    return {
        name: float(np.float32(value))
        for name, value in zip(vector_names(kind, compass), vector, strict=True)
    }
