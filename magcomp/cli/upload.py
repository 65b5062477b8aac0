"""``magcomp upload``: from a parameter file to a vehicle that holds it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from magcomp.cli.linking import (
    ADDRESS_EPILOG,
    LinkOptions,
    StatusLine,
    address_argument,
    any_vehicle_option,
    link_options,
    stop_on_interrupt,
    yes_option,
)
from magcomp.cli.output import complain
from magcomp.cli.writing import (
    agreed,
    carry_out,
    need_consent,
    say_what_acts,
    say_what_is_held,
    show_difference,
)
from magcomp.errors import ExitCode, UsageError
from magcomp.link import Connection, Replay, connect
from magcomp.live.latest import Latest
from magcomp.live.upload import make_plan, new_file, wait_disarmed, write_plan
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.files import read_parameter_file
from magcomp.writing.plan import WritePlan
from magcomp.writing.writer import restore_command

backup_option = click.option(
    "--backup",
    "backup_to",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Where what the vehicle holds now is kept; by default in magcomp's data directory.",
)
dry_run_option = click.option(
    "--dry-run", is_flag=True, help="Show the difference and write nothing."
)
wait_option = click.option(
    "--wait",
    type=click.FloatRange(min=0.0),
    default=0.0,
    metavar="S",
    help="Wait so long for an armed vehicle to be disarmed.",
)


@dataclass(frozen=True)
class Writing:
    """How a write was asked for.

    Attributes
    ----------
    yes, dry_run, any_vehicle, everything
        The options of these names.
    backup
        None for one in the data directory.
    wait
        Seconds to wait for an armed vehicle.
    """

    yes: bool
    dry_run: bool
    any_vehicle: bool
    backup: Path | None
    wait: float
    everything: bool = False


@click.command("upload", epilog=ADDRESS_EPILOG)
@click.argument("file", type=click.Path(path_type=Path))
@address_argument
@dry_run_option
@yes_option
@any_vehicle_option
@backup_option
@wait_option
@click.option("--all", "everything", is_flag=True, help="Write what is no compass calibration too.")
@link_options
def upload(
    file: Path,
    address: str,
    dry_run: bool,
    yes: bool,
    any_vehicle: bool,
    backup_to: Path | None,
    wait: float,
    everything: bool,
    link: LinkOptions,
) -> ExitCode:
    """Write the compass calibration in FILE to the vehicle at ADDRESS, and prove it arrived.

    Only to a disarmed vehicle, and only to the one the file belongs to. Of a full parameter file
    only the calibration is written, unless --all asks for the rest. What the vehicle held is kept
    in a backup first; a failure or Ctrl-C puts it back, and so does magcomp restore.
    """
    wanted = read_parameter_file(file)
    writing = Writing(yes, dry_run, any_vehicle, backup_to, wait, everything)
    need_consent(yes=yes, dry_run=dry_run)
    with VehicleLink.to(address, link) as there:
        return there.write(wanted, writing)[0]


class VehicleLink:
    """A vehicle to be written, without recording anything."""

    def __init__(
        self, connection: Connection, latest: Latest, vehicle: Vehicle, options: Sequence[str]
    ) -> None:
        self.connection = connection
        self.vehicle = vehicle
        self._options = options
        self._latest = latest

    @classmethod
    @contextlib.contextmanager
    def to(cls, address: str, link: LinkOptions) -> Iterator[VehicleLink]:
        """Connect and find the vehicle.

        Raises
        ------
        UsageError
            The address is a log.
        AddressError, LinkError, LinkTimeoutError
            See ``magcomp.link``.
        """
        latest, status = Latest(), StatusLine()
        connection = connect(
            address,
            baud=link.baud,
            system=link.system,
            component=link.component,
            key=link.key,
            source_system=link.source_system,
            sinks=[latest],
        )
        with connection:
            if isinstance(connection.address, Replay):
                raise UsageError(f"{address} must be a vehicle; instead received a log")
            if status.is_terminal:
                status.show(f"waiting for a heartbeat at {connection.address}")
            try:
                vehicle = connection.wait_vehicle(link.timeout)
            finally:
                status.clear()
            yield cls(connection, latest, vehicle, link.options)

    def write(
        self, wanted: ParameterSet, writing: Writing, *, nothing: str = ""
    ) -> tuple[ExitCode, WritePlan]:
        """Show the difference, ask, write.

        Parameters
        ----------
        nothing
            What to say where the vehicle holds everything already.
        """
        reach = (str(self.connection.address), *self._options)
        plan = self._plan(wanted, writing)
        show_difference(plan, everything=writing.everything)
        if not plan.changes:
            complain(nothing or "The vehicle holds all of this already; nothing is written")
            say_what_is_held(plan, after=False)
            return ExitCode.GOOD, plan
        if writing.dry_run:
            complain("Nothing is written because of --dry-run")
            say_what_is_held(plan, after=False)
            return ExitCode.GOOD, plan
        self._wait_disarmed(writing.wait)
        if not agreed(len(plan.changes), yes=writing.yes):
            complain("Nothing is written")
            return ExitCode.INTERRUPTED, plan
        backup = writing.backup or new_file("backup", ".param", plan.vehicle, time.time())
        with stop_on_interrupt() as stop:
            code = carry_out(
                plan,
                lambda tell, stopped: write_plan(
                    plan,
                    self.connection,
                    self._latest,
                    backup=backup,
                    on_event=tell,
                    stop=stopped,
                ),
                backup,
                reach,
                stop,
            )
        if code is ExitCode.GOOD:
            say_what_acts(plan, self.connection)
            complain(f"To undo this:\n  {restore_command(backup, *reach)}")
        return code, plan

    def _plan(self, wanted: ParameterSet, writing: Writing) -> WritePlan:
        status = StatusLine()
        try:
            return make_plan(
                self.connection,
                self.vehicle,
                wanted,
                any_vehicle=writing.any_vehicle,
                everything=writing.everything,
                on_progress=lambda progress: (
                    status.show("reading the vehicle", f"{progress.done:3d}/{progress.total:<3d}")
                    if status.is_terminal
                    else None
                ),
            )
        finally:
            status.clear()

    def _wait_disarmed(self, seconds: float) -> None:
        wait_disarmed(
            lambda: self._latest.now(self.vehicle).armed if self._is_up() else None,
            seconds=seconds,
            tell=complain,
        )

    def _is_up(self) -> bool:
        return self.connection.statistics().up
