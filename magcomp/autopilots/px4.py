"""PX4: its names. What it does to a reading is not known here yet, and is refused in words."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import NoReturn

from magcomp.autopilots.protocol import (
    FieldMeaning,
    Kind,
    LagPrior,
    LagPriors,
    MotorOutputs,
    ParameterName,
)
from magcomp.errors import InputError, MissingDataError
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Compass,
    Correction,
    InForce,
    ParameterHistory,
    Recording,
    Vehicle,
)

SLOTS = range(4)
COMPENSATION_SWITCH = "CAL_MAG_COMP_TYP"

_VECTORS = {
    "COMP": Kind.MOTOR,
    "OFF": Kind.OFFSET,
    "SCALE": Kind.DIAGONAL,
    "ODIAG": Kind.OFF_DIAGONAL,
}
_VECTOR = re.compile(r"CAL_MAG([0-3])_([XYZ])(OFF|SCALE|ODIAG|COMP)")
_SINGLE = re.compile(r"CAL_MAG([0-3])_(ID|ROT|PRIO)")
_INT32 = 6  # MAV_PARAM_TYPE


class Px4:
    """See :class:`magcomp.autopilots.protocol.Autopilot`."""

    key = "px4"
    title = "PX4"
    mavlink_number = 12
    integers_as_bytes = True
    switch = COMPENSATION_SWITCH
    compass_prefix = "CAL_MAG"
    device_id_names = tuple(f"CAL_MAG{slot}_ID" for slot in SLOTS)
    batteries = (0, 1)
    device_ids_describe = "bus, address and type of a sensor, which are alike in vehicles of a kind"

    def require_fittable(self, recording: Recording) -> None:
        """Refuse: the correction is not known."""
        raise self._unknown(recording.source)

    def field_meaning(self, source_format: str) -> FieldMeaning:
        """On the link whole mGauss, in the log floats."""
        return FieldMeaning(truncated=source_format != "ulog", applied_later_s=0.0)

    def lag_priors(self, source_format: str) -> LagPriors:
        """The log stamps a reading with the mean time of what it is made of."""
        width = 0.05 if source_format == "ulog" else 0.1
        return LagPriors(LagPrior(0.0, width), LagPrior(0.0, 0.1))

    def motor_outputs(
        self,
        parameters: ParameterHistory,  # noqa: ARG002
        outputs: int,  # noqa: ARG002
    ) -> MotorOutputs | None:
        """Not known."""
        return None

    def parse(self, name: str) -> ParameterName | None:
        """Take a name apart; slot 0 is compass 1."""
        if name == COMPENSATION_SWITCH:
            return ParameterName(Kind.SWITCH, 0, name)
        if vector := _VECTOR.fullmatch(name):
            whole = f"CAL_MAG{vector[1]}_{vector[3]}"
            return ParameterName(_VECTORS[vector[3]], int(vector[1]) + 1, whole, vector[2])
        if single := _SINGLE.fullmatch(name):
            kind = Kind.DEVICE if single[2] == "ID" else Kind.SETTING
            return ParameterName(kind, int(single[1]) + 1, name)
        return None

    def integer_type(self, name: str) -> int | None:
        """INT32 for all that hold whole numbers."""
        found = self.parse(name)
        if found is None or found.kind not in (Kind.SWITCH, Kind.DEVICE, Kind.SETTING):
            return None
        return _INT32

    def choices(self, name: str) -> tuple[int, ...]:
        """CAL_MAG_COMP_TYP is off, by thrust, or by the current of battery 0 or 1."""
        return (0, 1, 2, 3) if name == COMPENSATION_SWITCH else ()

    def compasses(self, values: Mapping[str, float]) -> tuple[Compass, ...]:
        """By CAL_MAGn_ID; CAL_MAGn_ROT is −1 for internal ones, CAL_MAGn_PRIO 0 for unused ones."""
        found = []
        for slot, name in zip(SLOTS, self.device_id_names, strict=True):
            device = values.get(name, 0.0)
            if math.isfinite(device) and device:
                rotation = values.get(f"CAL_MAG{slot}_ROT")
                priority = values.get(f"CAL_MAG{slot}_PRIO")
                found.append(
                    Compass(
                        slot=slot + 1,
                        device_id=int(device),
                        external=None if rotation is None else rotation >= 0,
                        orientation=None if rotation is None or rotation < 0 else int(rotation),
                        used=None if priority is None else priority != 0,
                    )
                )
        return tuple(found)

    def changes(
        self,
        parameters: ParameterHistory,  # noqa: ARG002
        *,
        told_per_reading: bool = False,  # noqa: ARG002
    ) -> tuple[float, ...]:
        """Not known."""
        return self._refuse()

    def in_force(self, values: Mapping[str, float], compass: int) -> InForce:  # noqa: ARG002
        """Not known."""
        return self._refuse()

    def in_force_at(
        self,
        parameters: ParameterHistory,  # noqa: ARG002
        compass: int,  # noqa: ARG002
        time: float,  # noqa: ARG002
    ) -> InForce:
        """Not known."""
        return self._refuse()

    def regressor(self, values: Mapping[str, float]) -> str | None:
        """By thrust or by the current of the first battery; no other is a quantity here."""
        return {1.0: THROTTLE, 2.0: CURRENT}.get(values.get(COMPENSATION_SWITCH, 0.0))

    def left_out(self, parameters: ParameterHistory) -> Mapping[int, InputError]:  # noqa: ARG002
        """None by itself."""
        return {}

    def correction_parameters(
        self,
        correction: Correction,  # noqa: ARG002
        compass: int,  # noqa: ARG002
        values: Mapping[str, float],  # noqa: ARG002
        *,
        soft_iron_fitted: bool,  # noqa: ARG002
    ) -> dict[str, float]:
        """Not known."""
        return self._refuse()

    def switch_parameters(
        self,
        regressor: str,  # noqa: ARG002
        compasses: Collection[int],  # noqa: ARG002
        values: Mapping[str, float],  # noqa: ARG002
    ) -> dict[str, float]:
        """Not known."""
        return self._refuse()

    def neutral_parameters(
        self,
        compass: int,  # noqa: ARG002
        regressor: str,  # noqa: ARG002
        values: Mapping[str, float],  # noqa: ARG002
    ) -> dict[str, float]:
        """Not known."""
        return self._refuse()

    def relevant_names(self) -> tuple[str, ...]:
        """The switch, and each slot's id and vectors."""
        vectors = (f"CAL_MAG{n}_{axis}{kind}" for n in SLOTS for kind in _VECTORS for axis in "XYZ")
        return (COMPENSATION_SWITCH, *self.device_id_names, *vectors)

    def useful_names(self) -> tuple[str, ...]:
        """None known."""
        return ()

    def output_names(self) -> tuple[str, ...]:
        """None known."""
        return ()

    def warnings(self, values: Mapping[str, float]) -> tuple[str, ...]:  # noqa: ARG002
        """None known."""
        return ()

    def write_warnings(
        self,
        asked: Mapping[str, float],
        values: Mapping[str, float],
    ) -> tuple[str, ...]:
        """Of vectors without their switch."""
        vectors = any(
            value and (found := self.parse(name)) is not None and found.kind is Kind.MOTOR
            for name, value in asked.items()
        )
        if vectors and values.get(COMPENSATION_SWITCH) == 0:
            return (f"{COMPENSATION_SWITCH} stays 0: the compensation will not be in force",)
        return ()

    def multiplied(self, vehicle: Vehicle) -> tuple[str, ...]:  # noqa: ARG002
        """Thrust and current, whatever the vehicle."""
        return (CURRENT, THROTTLE)

    def how_to_record(self, quantity: str, source_format: str) -> str:  # noqa: ARG002
        """A bit of SDLOG_PROFILE."""
        return f"set SDLOG_PROFILE to 1, which logs the {quantity}, and fly again"

    def no_compass_hint(self) -> str:
        """Telemetry sends no compass by itself."""
        return "does the link carry SCALED_IMU?"

    def _unknown(self, source: str) -> MissingDataError:
        return MissingDataError(
            f"{source} must be of a vehicle with ArduPilot; instead it is of one with "
            f"{self.title}, whose compass correction is not known yet"
        )

    def _refuse(self) -> NoReturn:
        raise self._unknown("The recording")
