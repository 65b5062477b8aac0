"""Records a terminal session as a picture: commands as typed, and what they really print.

    python docs/session.py [FOLDER]

Runs in a pseudo-terminal of 84 columns, in a folder of its own, on the fixtures' logs.
"""

from __future__ import annotations

import os
import pty
import shutil
import struct
import subprocess
import sys
import tempfile
from fcntl import ioctl
from io import StringIO
from pathlib import Path
from termios import TIOCSWINSZ

from rich.console import Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
COLUMNS, ROWS = 84, 40
SESSION = (
    "magcomp info flight.tlog",
    "magcomp fit flight.tlog -o compass.param",
    "magcomp check next-flight.tlog",
)
LOGS = {"flight.tlog": "flight.tlog", "next-flight.tlog": "mission_compensated.tlog"}


def said(command: str, folder: Path) -> str:
    """What a command prints on a terminal, without the progress it takes away again."""
    ours, theirs = pty.openpty()
    ioctl(theirs, TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
    name, *arguments = command.split()
    program = Path(sys.executable).parent / name
    environment = {**os.environ, "TERM": "xterm-256color", "LC_ALL": "C.UTF-8"}
    environment.pop("COLUMNS", None)
    with subprocess.Popen(
        [program, *arguments],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
    ):
        os.close(theirs)
        shown = bytearray()
        while some := _read(ours):
            shown += some
    os.close(ours)
    return shown.decode().replace("\r\n", "\n")


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # how Linux says that nobody holds the other end any more
        return b""


def record(folder: Path) -> Text:
    """The whole session as text with its colours."""
    for name, fixture in LOGS.items():
        shutil.copy(FIXTURES / fixture, folder / name)
    session = Text()
    for command in SESSION:
        session.append("$ ", style="bold green")
        session.append(f"{command}\n", style="bold")
        session.append_text(Text.from_ansi(said(command, folder)))
        session.append("\n\n")
    return session


def picture(session: Text) -> str:
    """The session as SVG."""
    console = Console(record=True, width=COLUMNS, file=StringIO(), force_terminal=True)
    console.print(session)
    return console.export_svg(title="magcomp", theme=MONOKAI, unique_id="magcomp-session")


if __name__ == "__main__":
    where = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    with tempfile.TemporaryDirectory() as scratch:
        (where / "session.svg").write_text(picture(record(Path(scratch))), encoding="utf-8")
