"""Only the rooms of firmware facts name a firmware or one of its compass parameters."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "magcomp"

OWN_ROOMS = ("autopilots", "simulate")

# A log format is a firmware's own, and its reader says so.
FORMATS = re.compile(r"sources/(dataflash|ulog|formats)\w*(/\w+)?\.py")

FIRMWARE = re.compile(r"ardupilot|arducopter|px4", re.IGNORECASE)
PARAMETER = re.compile(r"COMPASS_[A-Z]|CAL_MAG|\bMOT_[A-Z]|\bBATT_[A-Z]|\bSERVO\w*_FUNCTION")

# The name of MAVLink's dialect in pymavlink, which both firmwares speak.
DIALECT = "ardupilotmega"


def modules() -> Iterator[Path]:
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE)
        if inside.parts[0] not in OWN_ROOMS and not FORMATS.fullmatch(inside.as_posix()):
            yield path


def words_of(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Every identifier and every text of a module with its line; not its docstrings."""
    documentation = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str(text)) if id(node) not in documentation:
                yield node.lineno, text
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
                yield node.lineno, name
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name
            case ast.ImportFrom(module=module):
                yield node.lineno, module or ""
                yield from ((node.lineno, alias.name) for alias in node.names)
            case ast.Import(names=names):
                yield from ((node.lineno, alias.name) for alias in names)
            case _:
                pass


def named(source: str) -> list[str]:
    """What a module's source names of a firmware, a line each."""
    found = []
    for line, text in words_of(ast.parse(source)):
        bare = text.replace(DIALECT, "")
        if FIRMWARE.search(bare) or PARAMETER.search(bare):
            found.append(f"{line}: {text}")
    return found


@pytest.mark.parametrize("path", modules(), ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_no_module_outside_names_a_firmware_or_its_parameters(path: Path) -> None:
    assert named(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "source",
    [
        "from magcomp.autopilots import ardupilot",
        "import magcomp.autopilots.px4",
        "if vehicle.autopilot == 'px4': pass",
        "name = f'COMPASS_MOT{n}_X'",
        "def ask_arducopter(): pass",
        "x = parameters.last('MOT_PWM_MIN', 0.0)",
    ],
)
def test_what_names_one_is_found(source: str) -> None:
    assert named(source)


@pytest.mark.parametrize(
    "source",
    [
        '"""ArduPilot repeats a reading (COMPASS_MOT)."""',
        "x = 1  # PX4 does not",
        'UNIT = 1\n"""COMPASS_MOT is in this."""',
        "from pymavlink.dialects.v20 import ardupilotmega as mavlink",
        "compass_plots = 1",
    ],
)
def test_explanations_and_the_dialect_are_not(source: str) -> None:
    assert named(source) == []
