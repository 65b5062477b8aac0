"""What to do after an error: a sentence for each kind of it."""

from __future__ import annotations

from magcomp.errors import (
    AddressError,
    ChooseVehicleError,
    FitRejectedError,
    LinkError,
    LinkTimeoutError,
    LogError,
    MagcompError,
    MissingDataError,
    OutputError,
    ParameterFileError,
    UsageError,
    VehicleRefusedError,
    WriteError,
)
from magcomp.report import words

# The first kind that fits counts: special ones stand before what they are derived from.
_STEPS: tuple[tuple[type[MagcompError], str], ...] = (
    (AddressError, "Type the address as in one of the examples, or choose a line of the list."),
    (ChooseVehicleError, "Start again with: magcomp tui --system N"),
    (MissingDataError, "Record again with what is missing, or choose another regressor."),
    (LogError, "Choose another log: a .tlog, .BIN or .ulg of a flight with motors on."),
    (ParameterFileError, "Read the parameters from the vehicle again, then repeat this step."),
    (OutputError, "Choose another file or folder, or free some room on the disk."),
    (UsageError, "Change what the sentence names, and try again."),
    (FitRejectedError, "Choose another method or time range, or record again."),
    (VehicleRefusedError, "Disarm the vehicle, check that it is the right one, and try again."),
    (LinkTimeoutError, "Check power, cable, baud rate and address, then try again."),
    (LinkError, "Check the cable and that no other program holds the port, then try again."),
    (WriteError, "Read the result line: it says what the vehicle holds. Undo, or write again."),
)


def explain(error: BaseException) -> tuple[str, str]:
    """One sentence for what happened, one for what to do next."""
    for kind, step in _STEPS:
        if isinstance(error, kind):
            return _told(str(error)), step
    if isinstance(error, OSError):
        named = f"{error.filename}: " if error.filename else ""
        return words.sentence(f"{named}{error.strerror or error}"), "Check the file and the disk."
    return (
        f"This should not have happened: {type(error).__name__}: {error}.",
        "Go on, or save what you have and start again; please report it.",
    )


def _told(text: str) -> str:
    """A sentence; a command that it ends with stands on a line of its own, as it is typed."""
    said, _, command = text.partition("\n")
    if not command:
        return words.sentence(said)
    return f"{said[:1].upper()}{words.printable(said[1:])}\n{words.printable(command.strip())}"
