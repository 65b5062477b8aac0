"""``magcomp restore``: bring a vehicle back to a backup."""

from __future__ import annotations

from pathlib import Path

import click

from magcomp.cli.linking import (
    ADDRESS_EPILOG,
    LinkOptions,
    address_argument,
    any_vehicle_option,
    link_options,
    yes_option,
)
from magcomp.cli.output import complain
from magcomp.cli.upload import VehicleLink, Writing, backup_option, dry_run_option, wait_option
from magcomp.cli.writing import need_consent
from magcomp.errors import ExitCode
from magcomp.live.upload import finish_restore, read_backup
from magcomp.writing.events import Standing
from magcomp.writing.files import is_own
from magcomp.writing.journal import JournalState

_STANDS = {
    Standing.OLD: "the vehicle held everything as in the backup",
    Standing.NEW: "the vehicle held everything that was written",
    Standing.OFF: "the vehicle's motor compensation was off and some values were changed",
    Standing.UNSURE: (
        "the vehicle held everything as in the backup, everything that was written, or had its "
        "motor compensation off"
    ),
}


@click.command("restore", epilog=ADDRESS_EPILOG)
@click.argument("backup", type=click.Path(path_type=Path))
@address_argument
@dry_run_option
@yes_option
@any_vehicle_option
@backup_option
@wait_option
@link_options
def restore(
    backup: Path,
    address: str,
    dry_run: bool,
    yes: bool,
    any_vehicle: bool,
    backup_to: Path | None,
    wait: float,
    link: LinkOptions,
) -> ExitCode:
    """Bring the vehicle at ADDRESS back to BACKUP, and prove it.

    BACKUP is the file that magcomp made before it wrote, or the journal beside it, which tells
    how far a write came that was cut off.
    """
    wanted, journal = read_backup(backup)
    if journal is not None:
        complain(told(journal))
    need_consent(yes=yes, dry_run=dry_run)
    writing = Writing(yes, dry_run, any_vehicle, backup_to, wait, everything=is_own(wanted))
    with VehicleLink.to(address, link) as there:
        code, plan = there.write(
            wanted,
            writing,
            nothing="The vehicle holds everything as in the backup; nothing is written",
        )
    if code is ExitCode.GOOD and not (dry_run and plan.changes):
        finish_restore(backup)
    return code


def told(journal: JournalState) -> str:
    """What a journal says, in a sentence."""
    if journal.restored:
        return "The journal says that this backup was restored before"
    ended = "was cut off" if journal.outcome is None else "ended"
    return f"The journal says that when the write {ended}, {_STANDS[journal.standing]}"
