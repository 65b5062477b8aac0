"""What commands that speak with a vehicle share: options, interruptions, a status line."""

from __future__ import annotations

import contextlib
import functools
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypedDict, TypeVar

import click

from magcomp.cli.output import complain, takes_ascii_only
from magcomp.cli.vehicle import vehicle_options
from magcomp.errors import AddressError, UsageError
from magcomp.link import (
    GROUND_STATION_SYSTEM,
    Replay,
    SerialLine,
    is_read_by_others,
    parse_address,
    read_signing_key,
)
from magcomp.report.ascii import encodable, plain

_Result = TypeVar("_Result")

_TEXT_WIDTH = 42

HEARTBEAT_S = 10.0
"""How long the first heartbeat is waited for."""


ADDRESS_EPILOG = (
    "ADDRESS says where the vehicle is: udp:14550 listens for one; tcp:HOST:PORT, "
    "udpout:HOST:PORT, /dev/ttyACM0 and COM7,57600 reach one."
)


def say_meaning(address: str) -> str:
    """Say what an address means, where it was typed short; what is none is left to the link."""
    with contextlib.suppress(AddressError):
        meant = parse_address(address)
        if not isinstance(meant, Replay | SerialLine) and str(meant) != address:
            complain(f"{address} means {meant}: {meant.meaning}")
    return address


def _told(_context: click.Context, _parameter: click.Parameter, address: str) -> str:
    return say_meaning(address)


address_argument = click.argument("address", callback=_told)
yes_option = click.option("--yes", is_flag=True, help="Write without asking.")
any_vehicle_option = click.option(
    "--any-vehicle", is_flag=True, help="Write to another vehicle than the parameters belong to."
)


class Reach(TypedDict):
    """What a live session is opened with, so that it finds the vehicle."""

    system: int | None
    component: int | None
    baud: int | None
    signing_key: bytes | None
    source_system: int


@dataclass(frozen=True)
class LinkOptions:
    """How to reach a vehicle.

    Attributes
    ----------
    system, component
        Its MAVLink system; None takes the only one there is. Its autopilot's component; None for
        the usual one.
    baud
        Of a serial port whose address does not say.
    key
        Signing key of 32 bytes, or None.
    timeout
        Seconds to wait for it.
    source_system
        The number that magcomp gives itself.
    key_file
        Where the key was read.
    """

    system: int | None
    component: int | None
    baud: int | None
    key: bytes | None = field(repr=False)
    timeout: float
    source_system: int = GROUND_STATION_SYSTEM
    key_file: Path | None = None

    @property
    def reach(self) -> Reach:
        """The same, as ``LiveSession.open`` takes it."""
        return {
            "system": self.system,
            "component": self.component,
            "baud": self.baud,
            "signing_key": self.key,
            "source_system": self.source_system,
        }

    @property
    def options(self) -> tuple[str, ...]:
        """What to type so that another command reaches the same vehicle the same way."""
        given = {
            "--system": self.system,
            "--component": self.component,
            "--baud": self.baud,
            "--signing-key": self.key_file,
            "--source-system": (
                None if self.source_system == GROUND_STATION_SYSTEM else self.source_system
            ),
        }
        return tuple(
            word
            for name, value in given.items()
            if value is not None
            for word in (name, str(value))
        )


def link_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the options that say which vehicle, and how to reach it."""

    @vehicle_options
    @reach_options
    @functools.wraps(command)
    def with_link(
        system: int | None, component: int | None, link: LinkOptions, **others: object
    ) -> _Result:
        return command(link=replace(link, system=system, component=component), **others)

    return with_link


def reach_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give --baud, --signing-key and --timeout to a command that has a --system of its own."""

    @click.option("--baud", type=int, metavar="N", help="Speed of a serial port.")
    @click.option(
        "--signing-key",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Sign what is sent and refuse what is not signed: 32 bytes, or a passphrase.",
    )
    @click.option(
        "--timeout",
        type=click.FloatRange(min=0.1),
        default=HEARTBEAT_S,
        show_default=True,
        metavar="S",
        help="How long to wait for the vehicle.",
    )
    @click.option(
        "--source-system",
        type=click.IntRange(1, 255),
        default=GROUND_STATION_SYSTEM,
        show_default=True,
        metavar="N",
        help="MAVLink system of this ground station, where a vehicle listens to one only.",
    )
    @functools.wraps(command)
    def with_reach(
        baud: int | None,
        signing_key: Path | None,
        timeout: float,
        source_system: int,
        **others: object,
    ) -> _Result:
        key = None if signing_key is None else read_signing_key(signing_key)
        if signing_key is not None and is_read_by_others(signing_key):
            complain(f"{signing_key} can be read by others on this computer: chmod 600 keeps it")
        return command(
            link=LinkOptions(None, None, baud, key, timeout, source_system, signing_key), **others
        )

    return with_reach


def positive_seconds(seconds: float | None) -> float | None:
    """Refuse a duration that is none.

    Raises
    ------
    UsageError
        It is not above 0.
    """
    if seconds is not None and not seconds > 0:
        raise UsageError(f"--seconds must be above 0; instead received {seconds:g}")
    return seconds


def replayed(address: str) -> Path:
    """The log that an address names, if it names one: no output may replace it."""
    return Path(address.rpartition(",")[0] or address)


@contextlib.contextmanager
def stop_on_interrupt() -> Iterator[threading.Event]:
    """Turn the first Ctrl-C, or a polite kill, into an event; the second one interrupts.

    A thread other than the main one gets an event that nothing sets.
    """
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def first(_number: int, _frame: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    kinds = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(kind, first) for kind in kinds]
    try:
        yield stop
    finally:
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)


class StatusLine:
    """What is going on, on stderr: one line kept up to date on a terminal, else a line a change."""

    def __init__(self, *, terminal: bool | None = None) -> None:
        is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self._terminal = is_terminal if terminal is None else terminal
        self._shown = ""
        self._width = 0

    @property
    def is_terminal(self) -> bool:
        """Whether the line is kept up to date."""
        return self._terminal

    def show(self, lasting: str, passing: str = "") -> None:
        """Show a text.

        Parameters
        ----------
        lasting
            Where there is no terminal, a line is written only when this changes.
        passing
            Numbers that change all the time; only a terminal shows them.
        """
        if self._terminal:
            text = f"{lasting:<{_TEXT_WIDTH}}  {passing}" if passing else lasting
            text = text[: max(_columns() - 1, 20)]
            _to_stderr(f"\r{text.ljust(self._width)}")
            self._width = len(text)
        elif lasting != self._shown:
            complain(lasting)
        self._shown = lasting

    def clear(self) -> None:
        """Take the line away."""
        if self._terminal and self._width:
            _to_stderr(f"\r{' ' * self._width}\r")
            self._width = 0

    def say(self, sentence: str) -> None:
        """Write a sentence that stays."""
        self.clear()
        complain(sentence)


class Warnings:
    """Says what a pilot should know of a live vehicle, each sentence once."""

    def __init__(self, status: StatusLine) -> None:
        self._status = status
        self._said: set[str] = set()

    def say(self, warnings: Iterable[str]) -> None:
        """Say those that were not said before."""
        for warning in warnings:
            if warning not in self._said:
                self._said.add(warning)
                self._status.say(warning)


def _columns() -> int:

    return shutil.get_terminal_size((80, 24)).columns


def _to_stderr(text: str) -> None:
    if sys.stderr is not None:
        shown = plain(text) if takes_ascii_only(sys.stderr) else text
        with contextlib.suppress(BrokenPipeError):
            sys.stderr.write(encodable(shown, sys.stderr.encoding or "utf-8"))
            sys.stderr.flush()
