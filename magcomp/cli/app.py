"""The command group, and what becomes of every error.

A command is a module of its own with a click command named as in `COMMANDS`; it is imported
when it is called. Adding one is one line in that table.
"""

from __future__ import annotations

import importlib
import os
import sys
import traceback
from typing import NamedTuple, NoReturn

import click

from magcomp.cli.output import complain, flush
from magcomp.cli.version import show_version
from magcomp.errors import ExitCode, MagcompError, NoLogError


class _Command(NamedTuple):
    module: str
    summary: str


COMMANDS = {
    "fit": _Command(
        "magcomp.cli.fit", "Find the motors' shift in a log, judge it, write it to a file."
    ),
    "check": _Command("magcomp.cli.check", "Judge the calibration that a log was flown with."),
    "info": _Command("magcomp.cli.info", "Show what a log holds, and what it lacks for a fit."),
    "report": _Command("magcomp.cli.report", "Fit a log and write a report to look at."),
    "heading": _Command(
        "magcomp.cli.heading", "Show the heading raw, corrected and fused with the gyro."
    ),
    "reproduce": _Command("magcomp.cli.reproduce", "Reproduce the paper's experiments."),
    "calibrate": _Command(
        "magcomp.cli.calibrate", "Guide, record and fit a live vehicle; write the answer to it."
    ),
    "sweep": _Command(
        "magcomp.cli.sweep", "Spin the motors on the ground, step by step; fit and write."
    ),
    "record": _Command("magcomp.cli.record", "Record a live vehicle into a .tlog."),
    "upload": _Command("magcomp.cli.upload", "Write a parameter file to a vehicle, and prove it."),
    "restore": _Command("magcomp.cli.restore", "Bring a vehicle back to a backup."),
    "fleet": _Command("magcomp.cli.fleet", "Fit a fleet's logs; tell what needs attention."),
    "simulate": _Command("magcomp.cli.simulate", "Run a simulated vehicle to try everything on."),
    "tui": _Command("magcomp.cli.tui", "Do all of it on one screen of the terminal."),
    "demo": _Command("magcomp.cli.demo", "Show the whole job on a simulated vehicle."),
}


class LazyGroup(click.Group):
    """A group that imports a command's module when the command is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Names of all commands, in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import and return one command."""
        if cmd_name not in COMMANDS:
            return None
        command = getattr(importlib.import_module(COMMANDS[cmd_name].module), cmd_name)
        if not isinstance(command, click.Command):
            raise TypeError(f"{COMMANDS[cmd_name].module}.{cmd_name} must be a click command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or say which ones are spelt much alike."""
        try:
            return super().resolve_command(ctx, args)
        except click.NoSuchCommand as error:
            # Click knows only commands that have been imported.
            raise click.NoSuchCommand(error.command_name, possibilities=COMMANDS, ctx=ctx) from None

    def format_commands(
        self,
        ctx: click.Context,  # noqa: ARG002
        formatter: click.HelpFormatter,
    ) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.summary) for name, command in COMMANDS.items()])


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 good, 1 fit rejected, 2 usage or unreadable input, 3 link, 4 timeout, "
    "5 write or read-back mismatch, 130 interrupted.",
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=show_version,
    help="Show the version and the commit, and exit.",
)
@click.option("--debug", is_flag=True, help="Show the traceback of an unexpected error.")
def app(debug: bool) -> None:
    """Find how a multirotor's motors shift its compass, and what cancels the shift.

    \b
    Start with:  magcomp fit flight.tlog
    """  # noqa: D301 - \b tells click to keep the line


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and end the process with one of `ExitCode`.

    Parameters
    ----------
    arguments
        Without the program's name; those of the process by default.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    code = run(arguments)
    flush()
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run the command line and return the exit code; every error becomes one sentence."""
    try:
        code = app.main(arguments, prog_name="magcomp", standalone_mode=False)
    except (click.Abort, KeyboardInterrupt):
        complain("interrupted")
        return ExitCode.INTERRUPTED
    except Exception as error:
        sentence, code, foreseen = _explain(error)
        complain(sentence)
        if isinstance(error, NoLogError):
            # What reads logs is imported by now, and this with it.
            from magcomp.cli.places import where_logs_are  # noqa: PLC0415

            complain(where_logs_are())
        for note in getattr(error, "__notes__", ()):
            complain(note)
        if not foreseen and ("--debug" in arguments or os.environ.get("MAGCOMP_DEBUG")):
            traceback.print_exception(error)
        return code
    return code if isinstance(code, int) else ExitCode.GOOD


def _explain(error: Exception) -> tuple[str, ExitCode, bool]:
    """A sentence, an exit code, and whether this error is one that users make happen."""
    match error:
        case MagcompError():
            return str(error), error.exit_code, True
        case click.exceptions.NoArgsIsHelpError():
            return "a command must be given. Try 'magcomp --help'", ExitCode.USAGE, True
        case click.ClickException():
            context = getattr(error, "ctx", None)
            said = error.format_message().rstrip(".")
            said += "" if said.endswith(("?", "?)")) else "."
            hint = f" Try '{context.command_path} --help'" if context is not None else ""
            return said + hint, ExitCode.USAGE, True
        case OSError() | UnicodeError():
            return _sentence(error), ExitCode.USAGE, False
        case MemoryError():
            return "the work must fit in memory; instead there is none left", ExitCode.USAGE, False
    return (
        f"this should not have happened: {type(error).__name__}: {error}. Please report it with "
        "what --debug before the command shows",
        ExitCode.USAGE,
        False,
    )


def _sentence(error: OSError | UnicodeError) -> str:
    if isinstance(error, UnicodeError):
        return f"a name must be text in the system's encoding; instead received: {error}"
    what = error.strerror or str(error)
    return f"{error.filename}: {what}" if error.filename is not None else what
