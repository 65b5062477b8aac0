"""``magcomp simulate``: a vehicle to try everything on."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import click

from magcomp.cli.linking import stop_on_interrupt
from magcomp.cli.output import answer, complain
from magcomp.cli.work import read_parameters
from magcomp.errors import ExitCode
from magcomp.link import read_signing_key
from magcomp.simulate import AUTOPILOTS, PROGRAMS, Faults, Scenario, Vehicle, scenario, serve

_ADDRESS = "udpout:127.0.0.1:14550"

_Result = TypeVar("_Result")


def _fault_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command what goes wrong on the link."""

    @click.option(
        "--loss",
        type=float,
        default=0.0,
        show_default=True,
        metavar="P",
        help="Share of the frames lost, each way, 0 … 1.",
    )
    @click.option(
        "--latency",
        type=float,
        default=0.0,
        show_default=True,
        metavar="S",
        help="Time every frame takes, each way.",
    )
    @functools.wraps(command)
    def with_faults(loss: float, latency: float, **others: object) -> _Result:
        faults = Faults(loss=loss, latency_s=latency) if loss or latency else None
        return command(faults=faults, **others)

    return with_faults


def _scenario_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command which vehicle flies what."""

    @click.option("--seed", type=int, default=1, show_default=True, help="Which vehicle.")
    @click.option(
        "--program",
        type=click.Choice(PROGRAMS),
        default="flight",
        show_default=True,
        help="What it does once a ground station speaks to it.",
    )
    @click.option(
        "--motor-spread",
        type=click.FloatRange(0.0, 10.0),
        metavar="SHARE",
        help="How unequally its motors disturb, as a share of the interference; 0.05 by default.",
    )
    @functools.wraps(command)
    def with_scenario(
        seed: int, program: str, motor_spread: float | None, **others: object
    ) -> _Result:
        chosen = scenario(program, seed, motor_spread=motor_spread)
        return command(chosen=chosen, program=program, **others)

    return with_scenario


@click.command("simulate")
@click.argument("address", default=_ADDRESS)
@click.option(
    "--autopilot",
    type=click.Choice(list(AUTOPILOTS)),
    default=next(iter(AUTOPILOTS)),
    show_default=True,
    help="Whose firmware it has.",
)
@_scenario_options
@click.option(
    "--speed",
    type=float,
    default=1.0,
    show_default=True,
    metavar="X",
    help="How many times faster than real time.",
)
@_fault_options
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Write what the vehicle really is.",
)
@click.option(
    "--parameters",
    type=click.Path(path_type=Path),
    metavar="FILE.param",
    help="What it holds when it is switched on.",
)
@click.option(
    "--signing-key",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Sign every frame, and take none that is not signed.",
)
@click.option(
    "--system",
    type=click.IntRange(1, 250),
    metavar="N",
    default=1,
    show_default=True,
    help="Its MAVLink system, where several share a link.",
)
def simulate(
    address: str,
    chosen: Scenario,
    program: str,
    autopilot: str,
    speed: float,
    faults: Faults | None,
    truth: Path | None,
    parameters: Path | None,
    signing_key: Path | None,
    system: int,
) -> ExitCode:
    """Run a simulated copter with three compasses at ADDRESS (udpout:127.0.0.1:14550).

    It behaves as ArduCopter 4.6 or, with --autopilot px4, as PX4 1.15 on a telemetry radio.

    ADDRESS may be udpout:HOST:PORT, udp:HOST:PORT, tcpin:HOST:PORT, tcp:HOST:PORT or pty. It
    waits for a ground station, carries out its programme, and is then disarmed and ready to be
    written. Its compasses are disturbed by its motors; --truth says how. Ctrl-C ends it.
    """
    key = None if signing_key is None else read_signing_key(signing_key)
    held = {} if parameters is None else read_parameters(parameters).values
    vehicle = Vehicle(
        chosen,
        start_unix_s=time.time(),
        wait_for_ground=True,
        signing_key=key,
        parameters=held,
        autopilot=autopilot,
        system=system,
    )
    if truth is not None:
        vehicle.write_truth(truth)

    def announce(reached_at: str) -> None:
        complain(
            f"A simulated vehicle ({autopilot}, seed {chosen.truth.seed}) waits for a ground "
            f"station, then: {program}, {vehicle.duration_s / speed:.0f} s. Reach it with:\n"
            f"  magcomp calibrate {reached_at}"
        )
        answer(f"{reached_at}\n")

    with stop_on_interrupt() as stop:
        serve(address, vehicle, speed=speed, faults=faults, announce=announce, stop=stop)
    return ExitCode.GOOD
