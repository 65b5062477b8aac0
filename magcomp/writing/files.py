"""Parameter files: Mission Planner .param, MAVProxy .parm, QGroundControl .params.

The suffix chooses what is written. What is read is recognised row by row, see
rows.py. Lines that begin with ``#`` before the first row are comments for
people, except one, which says whose parameters these are::

    # magcomp-vehicle: {"autopilot": ..., "kind": "copter", "system": 1, ...}
"""

from __future__ import annotations

import codecs
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from magcomp import autopilots
from magcomp.errors import OutputError, ParameterFileError, UsageError
from magcomp.mavlink.parameters import REAL32
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.owner import document, vehicle_of
from magcomp.writing.rows import (
    AUTOPILOT_COMPONENT,
    Row,
    check_name,
    is_remark,
    parse_row,
    rounded,
    shown,
    values_of,
)

SUFFIXES = (".param", ".parm", ".params")

_LARGEST_FILE = 16 * 1024 * 1024

_NOT_TEXT = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")

_VEHICLE_MARK = "magcomp-vehicle:"
_QGC_TITLE = "Onboard parameters for Vehicle"
_QGC_COLUMNS = "Vehicle-Id Component-Id Name Value Type"


def format_value(value: float) -> str:
    """Give the shortest text that reads back to the same float32; whole numbers without point."""
    with np.errstate(over="ignore", under="ignore"):
        return str(np.float32(value) + np.float32(0.0)).removesuffix(".0")


def read_parameter_file(path: str | Path) -> ParameterSet:
    """Read a parameter file of any of the three kinds.

    Raises
    ------
    ParameterFileError
        Where the file cannot be read, or must not be trusted (see `parse_parameters`).
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise ParameterFileError(
            f"{path} must be a readable parameter file; instead received: {error.strerror}"
        ) from error
    if len(content) > _LARGEST_FILE:
        raise ParameterFileError(
            f"{path} must be a parameter file; instead it is larger than 16 MiB"
        )
    # PowerShell writes UTF-16. Comments written on Windows need not be UTF-8; a damaged name
    # fails as a name.
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return parse_parameters(
        content.decode("utf-16" if wide else "utf-8-sig", errors="replace"), str(path)
    )


def parse_parameters(text: str, source: str) -> ParameterSet:
    """Read the text of a parameter file.

    Parameters
    ----------
    text
        The file's text, any line ends.
    source
        What messages call the file.

    Returns
    -------
    ParameterSet
        Values rounded to float32. Where a QGroundControl file holds several
        components of one vehicle, those of the autopilot. Its warnings name what stands twice.

    Raises
    ------
    ParameterFileError
        At the first line that is no parameter: a bad name, a value that is not
        finite or does not fit float32, two vehicles, binary data;
        or where the file holds no parameter.
    """
    rows: list[Row] = []
    comments: list[str] = []
    vehicle: Vehicle | None = None
    for number, line in enumerate(_lines(text), start=1):
        where = f"{source}, line {number}"
        if _NOT_TEXT.search(line):
            raise ParameterFileError(
                f"{where}: a parameter file must be text; instead received binary data"
            )
        content, mark, comment = line.partition("#")
        if is_remark(content.strip()):
            continue
        if content.strip():
            rows.append(parse_row(content.strip(), number, where))
            continue
        comment = comment.removeprefix(" ").rstrip()
        if not mark or comment.startswith(_QGC_TITLE) or comment == _QGC_COLUMNS:
            continue
        if comment.startswith(_VEHICLE_MARK):
            if vehicle is not None:
                raise ParameterFileError(
                    f"{where}: a parameter file must name one vehicle; instead received a second"
                )
            vehicle = _parse_vehicle(comment.removeprefix(_VEHICLE_MARK), where)
        elif not rows:
            comments.append(comment)
    if not rows:
        raise ParameterFileError(f"{source} must hold parameters; instead received none")
    values, warnings = values_of(rows, source)
    return ParameterSet(values, vehicle, tuple(comments), warnings)


def is_own(parameters: ParameterSet) -> bool:
    """Whether magcomp wrote the file itself: all of it is meant, not only the calibration."""
    return parameters.vehicle is not None


def format_parameters(parameters: ParameterSet, suffix: str) -> str:
    """Write the text of a parameter file.

    Parameters
    ----------
    parameters
        At least one value.
    suffix
        ``.param``, ``.parm`` or ``.params``.

    Raises
    ------
    UsageError
        Where the suffix is none of the three.
    ParameterFileError
        Where a name or a value could not be read back.
    """
    writer = _WRITERS.get(suffix.lower())
    if writer is None:
        raise UsageError(
            f"a parameter file must end in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}; "
            f"instead received {suffix or 'no suffix'!r}"
        )
    if not parameters.values:
        raise ParameterFileError("a parameter file must hold parameters; instead received none")
    for name, value in parameters.values.items():
        check_name(name, "to be written")
        rounded(value, name, "to be written")
    head = [_comment(line) for comment in parameters.comments for line in _comment_lines(comment)]
    if parameters.vehicle is not None:
        named = json.dumps(document(parameters.vehicle))
        head.append(_comment(f"{_VEHICLE_MARK} {named}"))
    return "".join(f"{line}\n" for line in (*head, *writer(parameters)))


def write_parameter_file(
    path: str | Path,
    parameters: ParameterSet,
    *,
    force: bool = False,
    only_mine: bool = False,
) -> None:
    """Write a parameter file: all of it, or nothing.

    The text is written beside the target, forced to the disk and renamed, so
    that a crash leaves the old file or the new one.

    Parameters
    ----------
    path
        Its suffix chooses the format.
    parameters
        What to write.
    force
        Replace a file that is already there.
    only_mine
        Let nobody else read it, as backups of a vehicle.

    Raises
    ------
    UsageError
        Where the suffix is unknown.
    OutputError
        Where the file exists and `force` is not set, or the disk refuses it.
    ParameterFileError
        Where a name or a value could not be read back.
    """
    path = Path(path)
    content = format_parameters(parameters, path.suffix).encode("utf-8", errors="replace")
    try:
        if path.is_dir():
            raise OutputError(f"{path} must be a file; instead it is a directory")
        if path.exists() and not force:
            raise OutputError(f"{path} must not exist yet; use --force to overwrite it")
        _replace(path, content, private if only_mine else None)
    except OSError as error:
        raise OutputError(f"{path} must be writable; instead received: {error.strerror}") from error


def private(path: str, flags: int) -> int:
    """Open a file so that only its owner may read it; an opener for ``open``."""
    return os.open(path, flags, 0o600)


def _replace(path: Path, content: bytes, opener: Callable[[str, int], int] | None) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.unlink(missing_ok=True)
    try:
        with open(temporary, "xb", opener=opener) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_directory(path.parent)


def sync_directory(directory: Path) -> None:
    """Force a directory's entries to the disk, where the system can (Windows cannot)."""
    if os.name == "nt":
        return
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _lines(text: str) -> Iterator[str]:
    # str.splitlines would also split at form feeds and Unicode separators inside comments.
    normal = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return iter(normal.split("\n"))


def _parse_vehicle(text: str, where: str) -> Vehicle:
    try:
        return vehicle_of(text)
    except ValueError as error:
        raise ParameterFileError(
            f"{where}: the vehicle must be as magcomp wrote it; instead received {shown(text)}"
        ) from error


def _comment_lines(comment: str) -> Iterator[str]:
    for line in comment.splitlines() or [""]:
        text = _NOT_TEXT.sub(" ", line)
        # A comment for people must not be read back as the vehicle's identity.
        yield f" {text}" if text.startswith(_VEHICLE_MARK) else text


def _comment(line: str) -> str:
    return f"# {line}".rstrip()


def _mission_planner(parameters: ParameterSet) -> Iterator[str]:
    for name, value in parameters.values.items():
        yield f"{name},{format_value(value)}"


def _mavproxy(parameters: ParameterSet) -> Iterator[str]:
    for name, value in parameters.values.items():
        yield f"{name:<16} {format_value(value)}"


def _qgroundcontrol(parameters: ParameterSet) -> Iterator[str]:
    vehicle = parameters.vehicle
    system = vehicle.system if vehicle else 1
    component = vehicle.component if vehicle else AUTOPILOT_COMPONENT
    yield f"# {_QGC_TITLE} {system}"
    yield f"# {_QGC_COLUMNS}"
    for name, value in parameters.values.items():
        kind = autopilots.integer_type(name) or REAL32
        yield f"{system}\t{component}\t{name}\t{format_value(value)}\t{kind}"


_WRITERS: Mapping[str, Callable[[ParameterSet], Iterator[str]]] = {
    ".param": _mission_planner,
    ".parm": _mavproxy,
    ".params": _qgroundcontrol,
}
