"""Drives the whole road of `magcomp tui` by keys alone, in a terminal of 80 by 24 cells.

    pip install pyte
    python examples/whole_road.py [--speed X] [--autopilot NAME]

A simulated vehicle is flown, fitted and written; then its battery is changed, so to speak: it is
switched off and on with what it holds, and flies once more, and the screen tells what was promised
and what was measured. Every screen is printed as a pilot would see it.
"""

from __future__ import annotations

import argparse
import codecs
import fcntl
import os
import pty
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyte

COLUMNS, ROWS = 80, 24
PATIENCE_S = 300.0
SILENCE_S = 8.0
"""A link takes a vehicle that comes from another port for the same one after six seconds."""

_LEFT = "\x1b[?1049l"
"""Back to the screen from before the program, which is taken to have been empty."""

_ADDRESS_ASKED = "Type an address such as"
_FILE_OFFERED = r"┃ File +┃[^\n]*\n[^\n]*\.param +┃"
_FILE_ASKED = r"┃ File +┃[^\n]*\n[^\n]{0,6}┃ +┃"
"""A field that is there takes what is typed; before that, keys go astray."""

_KEYBOARD = re.compile("\x1b\\[[<>=?][0-9;]*u")


class Terminal:
    """A program on a terminal, and what the terminal shows.

    Parameters
    ----------
    command
        What runs.
    environment
        With what is set beside the present environment.
    columns, rows
        Its size.
    """

    def __init__(
        self,
        command: list[str],
        environment: dict[str, str],
        columns: int = COLUMNS,
        rows: int = ROWS,
    ) -> None:
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.Stream(self.screen)
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        known = {"TERM": "xterm-256color", "LANG": "C.UTF-8", "LC_ALL": "C.UTF-8"}
        self._program = subprocess.Popen(  # noqa: S603 - our own program
            command,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env={**os.environ, **known, **environment},
            start_new_session=True,
        )
        os.close(theirs)

    def press(self, *keys: str) -> None:
        """Type characters; a carriage return is Enter."""
        for key in keys:
            os.write(self._ours, key.encode())
            self.look(0.3)

    def type(self, text: str) -> None:
        """Type a text into a field, and go on when all of it stands there; then press Enter."""
        self.press(text)
        self.until(re.escape(text), f"{text} in its field")
        self.press("\r")

    def look(self, seconds: float) -> str:
        """What the screen shows after at most so long without anything new."""
        while select.select([self._ours], [], [], seconds)[0]:
            try:
                some = os.read(self._ours, 1 << 16)
            except OSError:  # the program has ended
                break
            if not some:
                break
            self._feed(self._decoder.decode(some))
            if self._looked_enough(seconds):
                break
        return self.text

    def _feed(self, some: str) -> None:
        """Show what came; what the emulator does not know is left out, or done for it."""
        some = _KEYBOARD.sub("", some)
        before, left, after = some.rpartition(_LEFT)
        self._stream.feed(before)
        if left:
            self.screen.reset()
        self._stream.feed(after)

    def _looked_enough(self, seconds: float) -> bool:
        """A screen that changes all the time is looked at all the same."""
        return not select.select([self._ours], [], [], min(seconds, 0.05))[0]

    @property
    def text(self) -> str:
        """The screen's lines."""
        return "\n".join(line.rstrip() for line in self.screen.display)

    def until(self, pattern: str, what: str) -> str:
        """Wait for a screen that a pattern is found in.

        Raises
        ------
        TimeoutError
            It never came.
        """
        end = time.monotonic() + PATIENCE_S
        while not re.search(pattern, self.text, re.DOTALL):
            if time.monotonic() > end or self._program.poll() is not None:
                raise TimeoutError(f"The screen must say {what}; instead it shows:\n{self.text}")
            self.look(0.2)
        return self.look(0.2)

    def wait(self) -> int:
        """Wait for the program's end, and give its exit code."""
        while self._program.poll() is None:
            self.look(0.1)
        self.look(0.1)
        return self._program.returncode

    def close(self) -> None:
        """End the program where it still runs."""
        self._program.terminate()
        self._program.wait()
        os.close(self._ours)


@contextmanager
def vehicle(port: int, *options: str) -> Iterator[None]:
    """A simulated vehicle that talks to a port of this computer."""
    command = [sys.executable, "-m", "magcomp", "simulate", f"udpout:127.0.0.1:{port}", *options]
    with subprocess.Popen(  # noqa: S603 - our own program
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as simulated:
        try:
            yield
        finally:
            simulated.terminate()


def free_port() -> int:
    """A port that nobody listens at."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


Show = Callable[[str, Terminal], None]
"""Told what a screen is, when it has come."""


def printed(title: str, terminal: Terminal) -> None:
    """Print a screen in a frame."""
    edge = "─" * COLUMNS
    print(f"\n{title}\n┌{edge}┐", flush=True)
    print("\n".join(f"│{line:<{COLUMNS}}│" for line in terminal.text.split("\n")))
    print(f"└{edge}┘", flush=True)


def first_flight(terminal: Terminal, port: int, saved: Path, show: Show) -> None:
    """Connect, record, fit, save and write."""

    def come(title: str, pattern: str, what: str) -> None:
        terminal.until(pattern, what)
        show(title, terminal)

    come("Start", r"Choose with the arrows", "what to choose")
    terminal.press("a")
    terminal.until(_ADDRESS_ASKED, "the cursor in the field for an address")
    terminal.type(f"udp:127.0.0.1:{port}")
    come("Connected", r"Press N to record", "that the vehicle is found")
    terminal.press("n")
    come("Recording", r"at hover at most.*time 0[1-9]", "a bound at the hover")
    come("Flown", r"disarmed.*Then press N", "that it is enough")
    terminal.press("n")
    come("Fitted", r"press N to see what would", "the fit")
    terminal.press("n")
    come("To be written", r"Press W to write", "what would change")
    terminal.press("s")
    terminal.until(_FILE_OFFERED, "the question for a file")
    terminal.press("\x01", "\x0b")
    terminal.until(_FILE_ASKED, "an empty field")
    terminal.type(str(saved))
    terminal.until(r"Saved to", "that the file is saved")
    terminal.press("w")
    come("Asked", r"Write \d+ parameters", "the question before it writes")
    terminal.press("y")
    come("Written", r"read back as written", "that it is written")
    terminal.press("n")
    come("Verify", r"Fly as before and land", "what to do to verify")


def next_flight(terminal: Terminal, show: Show) -> None:
    """Wait for the verdict on what was written."""
    terminal.until(r"ARMED", "that it flies")
    show("In the air again", terminal)
    terminal.until(r"promised at most.*measured", "the verdict")
    show("Measured", terminal)
    terminal.press("q")
    code = terminal.wait()
    show(f"Left, exit code {code}", terminal)


def drive(options: Sequence[str], show: Show) -> None:
    """Drive the whole road.

    Parameters
    ----------
    options
        Of the simulated vehicle.
    show
        Told of each screen.
    """
    with tempfile.TemporaryDirectory(prefix="magcomp-road-") as folder:
        place, port = Path(folder), free_port()
        saved = place / "written.param"
        # Everything the program keeps goes where it is gone afterwards.
        home = {"XDG_CONFIG_HOME": folder, "XDG_DATA_HOME": folder, "HOME": folder}
        terminal = Terminal([sys.executable, "-m", "magcomp", "tui"], home)
        try:
            with vehicle(port, *options):
                first_flight(terminal, port, saved, show)
            terminal.until(r"link is lost", "that the vehicle is gone")
            show("Switched off", terminal)
            time.sleep(SILENCE_S)
            with vehicle(port, *options, "--parameters", str(saved)):
                next_flight(terminal, show)
        finally:
            terminal.close()


def main() -> None:
    """Parse the command line and drive."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--speed", type=float, default=6.0, help="times faster than real time")
    parser.add_argument("--autopilot", default="ardupilot", help="the vehicle's firmware")
    parser.add_argument("--seed", type=int, default=1, help="which vehicle")
    given = parser.parse_args()
    # So that what was started is ended, however this is ended.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))
    options = ["--speed", str(given.speed), "--autopilot", given.autopilot]
    options += ["--seed", str(given.seed)]
    drive(options, printed)


if __name__ == "__main__":
    main()
