"""Parameter files: Mission Planner .param, MAVProxy .parm, QGroundControl .params.

The suffix chooses what is written. What is read is recognised row by row: two
fields are name and value, five are QGroundControl's vehicle, component, name,
value and type; fields stand apart by comma, space or tab. Lines that begin
with ``#`` before the first row are comments for people, except one, which
says whose parameters these are::

    # magcomp-vehicle: {"autopilot": ..., "kind": "copter", "system": 1, ...}
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from magcomp import autopilots
from magcomp.errors import OutputError, ParameterFileError, UsageError
from magcomp.mavlink.parameters import REAL32
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.owner import document, vehicle_of

SUFFIXES = (".param", ".parm", ".params")

_LARGEST_FILE = 16 * 1024 * 1024
_AUTOPILOT_COMPONENT = 1

_NAME = re.compile(r"[A-Z0-9_]{1,16}", re.ASCII)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_SEPARATOR = re.compile(r"[ \t]*,[ \t]*|[ \t]+")
_NOT_TEXT = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")

_VEHICLE_MARK = "magcomp-vehicle:"
_QGC_TITLE = "Onboard parameters for Vehicle"
_QGC_COLUMNS = "Vehicle-Id Component-Id Name Value Type"


@dataclass(frozen=True)
class _Row:
    line: int
    name: str
    value: float
    system: int | None = None
    component: int | None = None


def as_float32(value: float) -> float:
    """Round to the nearest float32, the precision in which autopilots hold parameters.

    Raises
    ------
    ValueError
        Where the value is not finite, is beyond float32, or would become 0.
    """
    with np.errstate(over="ignore", under="ignore"):
        rounded = float(np.float32(value))
    if not np.isfinite(rounded) or (rounded == 0.0 and value != 0.0):
        raise ValueError(f"a value must fit a 32-bit float; instead received {value!r}")
    return rounded


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
    # Comments written on Windows need not be UTF-8; a damaged name fails as a name.
    return parse_parameters(content.decode("utf-8-sig", errors="replace"), str(path))


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
        components of one vehicle, those of the autopilot.

    Raises
    ------
    ParameterFileError
        At the first line that is no parameter: a bad name, a value that is not
        finite or does not fit float32, a duplicate, two vehicles, binary data;
        or where the file holds no parameter.
    """
    rows: list[_Row] = []
    comments: list[str] = []
    vehicle: Vehicle | None = None
    for number, line in enumerate(_lines(text), start=1):
        where = f"{source}, line {number}"
        if _NOT_TEXT.search(line):
            raise ParameterFileError(
                f"{where}: a parameter file must be text; instead received binary data"
            )
        content, mark, comment = line.partition("#")
        if content.strip():
            rows.append(_parse_row(content.strip(), number, where))
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
    return ParameterSet(_unique(rows, source), vehicle, tuple(comments))


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
        _check_name(name, "to be written")
        _rounded(value, name, "to be written")
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


def _parse_row(content: str, number: int, where: str) -> _Row:
    fields = _SEPARATOR.split(content)
    match fields:
        case [name, value]:
            return _Row(number, _check_name(name, where), _parse_value(value, name, where))
        case [system, component, name, value, _]:
            return _Row(
                number,
                _check_name(name, where),
                _parse_value(value, name, where),
                _parse_identity(system, "vehicle", where),
                _parse_identity(component, "component", where),
            )
        case _:
            raise ParameterFileError(
                f"{where}: a line must be NAME and VALUE, or QGroundControl's five columns; "
                f"instead received {_shown(content)}"
            )


def _parse_identity(text: str, what: str, where: str) -> int:
    if not re.fullmatch(r"\d{1,3}", text, re.ASCII) or int(text) > 255:
        raise ParameterFileError(
            f"{where}: the {what} must be a number from 0 to 255; instead received {_shown(text)}"
        )
    return int(text)


def _check_name(name: str, where: str) -> str:
    if not _NAME.fullmatch(name):
        raise ParameterFileError(
            f"{where}: a parameter name must be 1 to 16 of A-Z, 0-9 and _; "
            f"instead received {_shown(name)}"
        )
    return name


def _parse_value(text: str, name: str, where: str) -> float:
    if _NOT_FINITE.fullmatch(text):
        raise ParameterFileError(f"{where}: {name} must be finite; instead received {text}")
    if not _NUMBER.fullmatch(text):
        raise ParameterFileError(
            f"{where}: {name} must be a number; instead received {_shown(text)}"
        )
    return _rounded(float(text), name, where, text)


def _rounded(value: float, name: str, where: str, text: str | None = None) -> float:
    try:
        return as_float32(value)
    except ValueError as error:
        raise ParameterFileError(
            f"{where}: {name} must fit a 32-bit float; "
            f"instead received {_shown(text) if text else value}"
        ) from error


def _unique(rows: Iterable[_Row], source: str) -> Mapping[str, float]:
    rows = list(rows)
    if any(row.component == _AUTOPILOT_COMPONENT for row in rows):
        rows = [row for row in rows if row.component in {None, _AUTOPILOT_COMPONENT}]
    first: dict[str, _Row] = {}
    for row in rows:
        if row.system != rows[0].system:
            raise ParameterFileError(
                f"{source}, line {row.line}: a parameter file must belong to one vehicle; "
                f"instead received {_named_system(row)} after {_named_system(rows[0])}"
            )
        earlier = first.setdefault(row.name, row)
        if earlier is not row:
            raise ParameterFileError(
                f"{source}, line {row.line}: {row.name} must stand once; "
                f"instead it stands in line {earlier.line} too"
            )
    return {row.name: row.value for row in rows}


def _named_system(row: _Row) -> str:
    return "a row without vehicle" if row.system is None else f"vehicle {row.system}"


def _parse_vehicle(text: str, where: str) -> Vehicle:
    try:
        return vehicle_of(text)
    except ValueError as error:
        raise ParameterFileError(
            f"{where}: the vehicle must be as magcomp wrote it; instead received {_shown(text)}"
        ) from error


def _shown(text: str) -> str:
    text = text.strip()
    return ascii(text if len(text) <= 40 else f"{text[:37]}...")


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
    component = vehicle.component if vehicle else _AUTOPILOT_COMPONENT
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
