"""No room but magcomp/mavlink takes a frame apart."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "magcomp"
# Readers of other formats have layouts of their own.
OTHER_FORMATS = ("dataflash", "ulog")
FILES = [
    path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.relative_to(PACKAGE).parts[0] != "mavlink"
    and not any(path.stem.startswith(name) or name in path.parts for name in OTHER_FORMATS)
]
MARKERS = {0xFD, 0xFE}
FRAME_NAMES = {"frame", "raw", "payload", "packet", "msgbuf", "record"}
ROUTES = {"crc_extra", "checksums", "x25crc", "get_payload", "native_format"}
# Where the whole tables of a bulk reader are made, and nothing else.
BULK = {"sources/assemble.py": {"crc_extra"}, "sources/tlog.py": {"crc_extra"}}


def name_of(node: ast.expr) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def apart(source: str, allowed: frozenset[str] | set[str] = frozenset()) -> Iterator[str]:
    """Whatever in a source takes frames apart."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Constant(value=int(value)) if value in MARKERS and not isinstance(value, bool):
                yield f"line {node.lineno}: a frame's marker"
            case ast.Attribute(attr=attr, value=ast.Name(id="struct")) if attr != "error":
                yield f"line {node.lineno}: struct"
            case ast.ImportFrom(module="struct"):
                yield f"line {node.lineno}: struct"
            case ast.Attribute(attr="from_bytes", value=ast.Name(id="int")):
                yield f"line {node.lineno}: int.from_bytes"
            case ast.Subscript(value=value, slice=ast.Constant(value=int())) if (
                name_of(value) in FRAME_NAMES
            ):
                yield f"line {node.lineno}: a byte of {name_of(value)}"
            case ast.Subscript(value=value, slice=ast.Slice()) if name_of(value) in FRAME_NAMES:
                yield f"line {node.lineno}: a slice of {name_of(value)}"
            case ast.Name(id=name) | ast.Attribute(attr=name) if name in ROUTES - allowed:
                yield f"line {node.lineno}: {name}"
            case _:
                pass


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_asks_mavlink_about_a_frame(path: Path) -> None:
    allowed = BULK.get(path.relative_to(PACKAGE).as_posix(), set())
    assert list(apart(path.read_text(encoding="utf-8"), allowed)) == []


@pytest.mark.parametrize(
    "source",
    [
        "x = frame[5] if frame[0] == 0xFE else 0",
        "message = self.raw[7:10]",
        "import struct\nstruct.unpack_from('<I', data)",
        "from struct import unpack",
        "number = int.from_bytes(data, 'little')",
        "MARKER = 253",
        "from x import crc_extra\ncrc_extra()",
    ],
)
def test_the_search_finds_what_takes_frames_apart(source: str) -> None:
    assert list(apart(source))
