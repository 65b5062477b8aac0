"""A simulated flight as a .tlog, made as fast as the machine can."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from magcomp.errors import OutputError
from magcomp.mavlink.records import record as record_of
from magcomp.simulate.ground import DEFAULT_RATES, PX4_RATES, Asker
from magcomp.simulate.programs import Compensation, scenario
from magcomp.simulate.truth import Truth
from magcomp.simulate.vehicle import DEFAULT_START_UNIX_S, Frame, Vehicle

_QUIET_S = 5.0


def record(
    vehicle: Vehicle,
    *,
    seconds: float | None = None,
    rates: Mapping[int, float] = DEFAULT_RATES,
) -> Iterator[Frame]:
    """Every frame a ground station would hear.

    Parameters
    ----------
    vehicle
        Freshly switched on.
    seconds
        How long; None for the whole programme and five seconds more.
    rates
        Message number to the rate asked for, Hz.
    """
    ground = Asker()
    vehicle.receive(ground.parameter_list(), 0.0)
    for message, hertz in rates.items():
        vehicle.receive(ground.rate(message, hertz), 0.0)
    length = vehicle.duration_s + _QUIET_S if seconds is None else seconds
    for second in range(1, int(length) + 1):
        yield from vehicle.advance(float(second))
        vehicle.receive(ground.heartbeat(), float(second))
    yield from vehicle.advance(length)


def write_tlog(
    path: Path,
    *,
    program: str = "flight",
    seed: int = 1,
    calibrated: bool | None = None,
    compensation: Compensation = "off",
    motor_spread: float | None = None,
    parameters: Mapping[str, float] | None = None,
    rates: Mapping[int, float] | None = None,
    autopilot: str = "ardupilot",
    start_unix_s: float = DEFAULT_START_UNIX_S,
) -> Truth:
    """Fly a programme without a link and write what a ground station would have recorded.

    Parameters
    ----------
    path
        The .tlog; overwritten.
    program, seed, calibrated, compensation, motor_spread
        See :func:`magcomp.simulate.programs.scenario`.
    parameters
        Parameters that differ at boot, for example ``{"BATT_MONITOR": 0}``.
    rates
        Message number to the rate asked for, Hz; None for those of recordings of its firmware.
    autopilot
        ``"ardupilot"`` or ``"px4"``.
    start_unix_s
        Date of power-up, and of the first frame.

    Returns
    -------
    Truth
        What a fit of the recording should find.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    chosen = scenario(
        program,
        seed,
        calibrated=calibrated,
        compensation=compensation,
        motor_spread=motor_spread,
    )
    vehicle = Vehicle(chosen, start_unix_s=start_unix_s, parameters=parameters, autopilot=autopilot)
    if rates is None:
        rates = PX4_RATES if autopilot == "px4" else DEFAULT_RATES
    try:
        with path.open("wb") as stream:
            for frame in record(vehicle, rates=rates):
                stamp = round((start_unix_s + frame.time) * 1e6)
                stream.write(record_of(stamp, frame.data))
    except OSError as error:
        raise OutputError(
            f"{path} must be writable for the simulated recording; "
            f"instead received: {error.strerror or error}"
        ) from error
    return vehicle.truth
