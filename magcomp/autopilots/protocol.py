"""What magcomp must know of a firmware: its names, its habits, and what it does to a reading.

An implementation owns every such fact. Nothing outside this package names a firmware or one of
its compass parameters; it asks the implementation, which :func:`magcomp.autopilots.of` finds.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

from magcomp.autopilots.motor_test import MotorTest
from magcomp.autopilots.terms import (
    FieldMeaning,
    LagPriors,
    Leeway,
    MotorLaw,
    MotorOutputs,
    ParameterName,
)
from magcomp.errors import InputError
from magcomp.model import (
    Compass,
    Correction,
    InForce,
    ParameterHistory,
    Recording,
    Series,
    Vehicle,
)


class Autopilot(Protocol):
    """A firmware.

    ``values`` are parameters by name as they stand at one moment; where a name is missing, the
    firmware's default stands for it.
    """

    @property
    def key(self) -> str:
        """As in ``Vehicle.autopilot``."""
        ...

    @property
    def title(self) -> str:
        """Its name for people."""
        ...

    @property
    def mavlink_number(self) -> int:
        """HEARTBEAT.autopilot (MAV_AUTOPILOT)."""
        ...

    @property
    def integers_as_bytes(self) -> bool:
        """Whether PARAM_VALUE carries an integer's own bytes; else it is cast to float."""
        ...

    @property
    def switch(self) -> str:
        """The parameter that switches motor compensation for all compasses."""
        ...

    @property
    def compass_prefix(self) -> str:
        """How every name that belongs to the compasses begins, known here or not."""
        ...

    @property
    def device_id_names(self) -> tuple[str, ...]:
        """Parameters that hold the compasses' device ids, in the order of the slots."""
        ...

    @property
    def log_folder(self) -> str:
        """Where on the vehicle's card its logs are."""
        ...

    @property
    def kept_names(self) -> re.Pattern[str]:
        """Parameters whose values the vehicle itself keeps: a write would not last."""
        ...

    @property
    def first_slot_leads(self) -> bool:
        """Whether the heading comes from the compass of the first slot that is used."""
        ...

    @property
    def batteries(self) -> tuple[int, ...]:
        """Battery instances whose current the firmware can multiply."""
        ...

    @property
    def parameter_file(self) -> str:
        """How a parameter file's name ends that its usual ground station loads."""
        ...

    @property
    def takes_over_all(self) -> bool:
        """Whether every value that is written comes into force, however little it changes."""
        ...

    @property
    def first_compass_message(self) -> str:
        """Telemetry message that carries the first compass."""
        ...

    @property
    def offset_decimals(self) -> int:
        """So many decimals of an offset are finer than a heading can tell."""
        ...

    @property
    def corrected_message(self) -> str | None:
        """Telemetry message with what the firmware makes of the compass it uses, in body axes.

        None where the compasses' own messages say it.
        """
        ...

    @property
    def corrected_unit(self) -> float:
        """MGauss of one in that message."""
        ...

    @property
    def truth_message(self) -> str:
        """Telemetry message in which a vehicle that is simulated says how it really stands."""
        ...

    @property
    def storage_s(self) -> float:
        """Seconds after which a write survives a restart."""
        ...

    @property
    def motor_test(self) -> MotorTest:
        """How motors are spun on the ground."""
        ...

    @property
    def device_ids_describe(self) -> str:
        """What a device id says, in words, where it does not tell one vehicle from its twin."""
        ...

    def require_fittable(self, recording: Recording) -> None:
        """Refuse a recording that no fit can be made of because of its firmware.

        Raises
        ------
        MissingDataError
            The firmware's correction is not known.
        """
        ...

    def field_meaning(self, source_format: str) -> FieldMeaning:
        """What the readings of a source are, by ``Recording.format``."""
        ...

    def compass_messages(self, values: Mapping[str, float]) -> Mapping[int, str]:
        """The telemetry message that is taken for each compass, by its number."""
        ...

    def from_telemetry(
        self, told: Mapping[int, Series], values: Mapping[str, float]
    ) -> tuple[Mapping[int, Series], frozenset[int]]:
        """The compasses of telemetry, whose messages need not mean the same in each firmware.

        Parameters
        ----------
        told
            What the first, second and third message of compass readings hold, mGauss, (n, 3).

        Returns
        -------
        fields
            By compass number, in body axes.
        raw
            Those of them whose readings are the sensor's own.
        """
        ...

    def lag_priors(self, source_format: str) -> LagPriors:
        """What is known of the lags beforehand, by ``Recording.format``."""
        ...

    def motor_outputs(self, parameters: ParameterHistory, outputs: int) -> MotorOutputs | None:
        """Which of so many servo outputs drive motors; None where the parameters contradict."""
        ...

    def parse(self, name: str) -> ParameterName | None:
        """Take a name apart; None where it is no compass parameter known here."""
        ...

    def integer_type(self, name: str) -> int | None:
        """MAV_PARAM_TYPE of a compass parameter that holds whole numbers; None for all others."""
        ...

    def choices(self, name: str) -> tuple[int, ...]:
        """The positions a switch has; empty for all other names."""
        ...

    def compasses(self, values: Mapping[str, float]) -> tuple[Compass, ...]:
        """The compasses that the parameters tell of, in the order of their slots."""
        ...

    def orientation_name(self, compass: int) -> str:
        """The parameter that says how a compass is mounted."""
        ...

    def changes(
        self,
        parameters: ParameterHistory,
        *,
        armed: Series | None = None,
        told_per_reading: bool = False,
    ) -> tuple[float, ...]:
        """Times at which anything that acts on a reading changed, in order.

        Parameters
        ----------
        armed
            1 armed, 0 disarmed, where known: a firmware may take values over only while disarmed.
        told_per_reading
            The log tells offset and motor correction with every reading, so that changes of
            these two do not count.
        """
        ...

    def in_force(self, values: Mapping[str, float], compass: int) -> InForce:
        """What given parameters do to a compass; nothing counts as unseen."""
        ...

    def in_force_at(self, parameters: ParameterHistory, compass: int, time: float) -> InForce:
        """What was in force at a time, in seconds; −∞ is the beginning.

        Raises
        ------
        ParameterFileError
            A parameter that acts on this compass is not a finite number.
        """
        ...

    def in_force_over(
        self,
        parameters: ParameterHistory,
        compass: int,
        times: Sequence[float],
        *,
        armed: Series | None,
    ) -> tuple[InForce, ...]:
        """What was in force at each of many times, in the time of one look at the history.

        Parameters
        ----------
        times
            Seconds, in order.
        armed
            1 armed, 0 disarmed, where known: a firmware may take values over only while disarmed.

        Raises
        ------
        ParameterFileError
            As :meth:`in_force_at`.
        """
        ...

    def regressor(self, values: Mapping[str, float]) -> str | None:
        """The control quantity the motor correction is multiplied by; None where it is off."""
        ...

    def left_out(self, parameters: ParameterHistory) -> Mapping[int, InputError]:
        """Compasses whose readings cannot be fitted, with the error that says why."""
        ...

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
        """Parameters that make this vehicle apply a correction.

        Parameters
        ----------
        values
            Every parameter known of the vehicle; what its firmware does not have is left out.
        regressor
            The control quantity that the motor vector is multiplied by.
        soft_iron_fitted
            The soft iron is not the one in force, so it belongs to the offsets.
        leeway
            What to do where the firmware cannot take a value over as it is.
        """
        ...

    def motor_law(self, compass: int, values: Mapping[str, float]) -> MotorLaw | None:
        """How it can correct a compass motor by motor; None where it cannot."""
        ...

    def per_motor_parameters(
        self,
        correction: Correction,
        exponent: float,
        compass: int,
        values: Mapping[str, float],
        *,
        soft_iron_fitted: bool,
    ) -> dict[str, float]:
        """Parameters that make this vehicle apply a correction motor by motor, switch included.

        Parameters
        ----------
        correction
            Its motor vectors are per volt to the power of ``exponent``, in the order of the
            law's motors.
        soft_iron_fitted
            As for :meth:`correction_parameters`.
        """
        ...

    def switch_parameters(
        self,
        regressor: str,
        compasses: Collection[int],
        values: Mapping[str, float],
        *,
        battery: int = 0,
    ) -> dict[str, float]:
        """The switch, and zeros for the stored vectors it would wake on all other compasses.

        Parameters
        ----------
        battery
            Instance of the battery whose current it is.
        """
        ...

    def neutral_parameters(
        self, compass: int, regressor: str, values: Mapping[str, float]
    ) -> dict[str, float]:
        """What a compass that gets no correction needs when the switch goes on."""
        ...

    def relevant_names(self) -> tuple[str, ...]:
        """What to read from a vehicle before it is fitted or written."""
        ...

    def useful_names(self) -> tuple[str, ...]:
        """What else a fit likes to know of a live vehicle."""
        ...

    def output_names(self) -> tuple[str, ...]:
        """Which outputs drive motors: not there on small boards, so asking in vain takes time."""
        ...

    def warnings(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """What stands in the way of a good calibration, a sentence each without its full stop."""
        ...

    def write_warnings(
        self, asked: Mapping[str, float], held: Mapping[str, float]
    ) -> tuple[str, ...]:
        """What a pilot must know of a write, beyond :meth:`warnings`.

        Parameters
        ----------
        asked
            What shall be written.
        held
            What the vehicle holds before.
        """
        ...

    def multiplied(self, vehicle: Vehicle) -> tuple[str, ...]:
        """The control quantities that the firmware of a kind of vehicle can multiply."""
        ...

    def how_to_record(self, quantity: str, source_format: str) -> str:
        """What to set so that the next recording of a format holds a quantity.

        Parameters
        ----------
        quantity
            ``"compass"``, ``"more readings"`` (of it), ``"control"`` (current and throttle),
            ``"current"``, ``"all currents"`` (of several batteries as one), ``"attitude"``,
            ``"parameters"`` or ``"position"``.
        source_format
            As in ``Recording.format``.
        """
        ...

    def link_notes(self, compasses: int) -> tuple[str, ...]:
        """What a user must know of a live link with so many compasses; a clause each."""
        ...

    def reading_notes(self, recording: Recording) -> tuple[str, ...]:
        """What a user must know of how the readings were understood, a sentence each."""
        ...

    def deaf_hint(self) -> str:
        """What to look for where a vehicle speaks but answers nothing; a clause."""
        ...

    def no_compass_hint(self) -> str:
        """What to look for where no compass reports."""
        ...
