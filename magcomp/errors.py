"""Every way magcomp can fail, and the exit code each one ends the program with.

::

    MagcompError
    ├── UsageError                2   the command line asks for something that cannot be
    │   └── AddressError          2   not a connection string
    ├── InputError                2   a file that cannot be used
    │   ├── LogError              2   a log that is not one, or is cut beyond use
    │   │   └── NoLogError        2   a file that is not there, or is no log at all
    │   ├── MissingDataError      2   a sound log that lacks what a fit needs
    │   ├── ChooseVehicleError    2   several vehicles in one log, none chosen
    │   ├── ParameterFileError    2   a parameter file that must not be trusted
    │   └── OutputError           2   a file that cannot be, or must not be, written
    ├── FitRejectedError          1   an answer was found and the judge does not believe it
    ├── LinkError                 3   the vehicle cannot be reached, or is not the right one
    │   └── VehicleRefusedError   3   armed, another vehicle, or not in a state to be written
    ├── LinkTimeoutError          4   nothing, or not the expected thing, arrived in time
    └── WriteError                5   a parameter was not taken, or reads back differently

Messages read "X must be Y; instead received Z" and name the file, byte, line
or parameter. They are complete sentences, for a pilot, without a traceback.
"""

from __future__ import annotations

from enum import IntEnum
from typing import ClassVar


class ExitCode(IntEnum):
    """How the program ends. Scripts rely on these numbers."""

    GOOD = 0
    REJECTED = 1
    USAGE = 2
    LINK = 3
    TIMEOUT = 4
    WRITE = 5
    INTERRUPTED = 130


class MagcompError(Exception):
    """Root of everything magcomp raises on purpose."""

    exit_code: ClassVar[ExitCode] = ExitCode.USAGE


class UsageError(MagcompError):
    """The command line asks for something that cannot be."""


class AddressError(UsageError):
    """A connection string that no transport understands."""


class InputError(MagcompError):
    """A file that cannot be used."""


class LogError(InputError):
    """A log that is not one, or is damaged beyond use."""


class NoLogError(LogError):
    """A file that is not there, or is no log at all."""


class MissingDataError(InputError):
    """A sound log that lacks what a fit needs."""


class ChooseVehicleError(InputError):
    """Several vehicles in one log and none was chosen."""


class ParameterFileError(InputError):
    """A parameter file, or a parameter in a log, that must not be trusted."""


class OutputError(InputError):
    """A file that cannot be written, or must not be overwritten."""


class FitRejectedError(MagcompError):
    """An answer was found and the judge does not believe it."""

    exit_code = ExitCode.REJECTED


class LinkError(MagcompError):
    """The vehicle cannot be reached."""

    exit_code = ExitCode.LINK


class VehicleRefusedError(LinkError):
    """The vehicle is armed, another one, or not in a state to be written."""


class LinkTimeoutError(MagcompError):
    """Nothing, or not the expected thing, arrived in time."""

    exit_code = ExitCode.TIMEOUT


class WriteError(MagcompError):
    """A parameter was not taken, or reads back as something else."""

    exit_code = ExitCode.WRITE


def unforeseen(error: BaseException) -> str:
    """Name an error that no code meant to happen, as a clause."""
    return f"this should not have happened: {type(error).__name__}: {error}"
