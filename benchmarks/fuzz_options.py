"""Any options of any command that takes a log, over any log: the end is an answer or a sentence.

    python benchmarks/fuzz_options.py [--seed N] [--count N] [FOLDER …]

Options are drawn from what the commands themselves declare, so that a new one is tried without a
word here. A warning of NumPy counts as a failure, and so does a line that says "this should not
have happened". Prints each failure with what makes it again, then a count a command.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import json
import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from magcomp.cli.app import COMMANDS, run
from magcomp.errors import ExitCode

FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
LOGS = (".tlog", ".bin", ".ulg", ".gz", ".log", ".zip", ".rlog")
PARAMETERS = (".param", ".params", ".parm")
OF_A_LOG = ("fit", "check", "info", "report", "heading")
OF_A_LINK = ("record", "calibrate", "sweep", "upload", "restore")
ENDS = frozenset({ExitCode.GOOD, ExitCode.REJECTED, ExitCode.USAGE})
ENDS_OF_A_LINK = ENDS | {ExitCode.LINK, ExitCode.TIMEOUT, ExitCode.WRITE, ExitCode.INTERRUPTED}

_SHORT = {"--timeout": "0.1", "--seconds": "0.3", "--wait": "0"}
"""What keeps a command that waits for a vehicle from waiting long."""


@dataclass
class CommandLines:
    """Draws command lines.

    Attributes
    ----------
    rng
        Where chance comes from.
    logs
        To look at.
    folder
        Where outputs go.
    commands
        To choose from.
    """

    rng: random.Random
    logs: Sequence[Path]
    folder: Path
    commands: Sequence[str] = OF_A_LOG
    share: float = 0.25
    _known: dict[str, click.Command] = field(default_factory=dict)

    def draw(self) -> list[str]:
        """One command line."""
        name = self.rng.choice(self.commands)
        said = [name]
        for parameter in self._command(name).params:
            if isinstance(parameter, click.Argument):
                said.append(self._argument(parameter))
        for option in self.options(name):
            said += self._option(option)
        return said

    def options(self, name: str) -> list[click.Option]:
        """The options that a command declares."""
        return [each for each in self._command(name).params if isinstance(each, click.Option)]

    def _command(self, name: str) -> click.Command:
        if name not in self._known:
            self._known[name] = getattr(importlib.import_module(COMMANDS[name].module), name)
        return self._known[name]

    def _option(self, option: click.Option) -> list[str]:
        name = option.opts[-1]
        if name in _SHORT:
            return [f"{name}={_SHORT[name]}"]
        if not option.required and self.rng.random() > self.share:
            return []
        return [name] if option.is_flag else [f"{name}={self._value(name, option.type)}"]

    def _value(self, name: str, kind: click.ParamType[Any]) -> str:
        rng = self.rng
        match kind:
            case click.Choice():
                return rng.choice([*map(str, kind.choices)] * 4 + ["other"])
            case click.IntRange(min=least, max=most):
                low = 0 if least is None else int(least)
                high = 1 << 20 if most is None else int(most)
                usual = [low] * 10 + [low + 1, low + 2]
                return str(rng.choice([*usual, high, high + 1, low - 1]))
            case click.Path():
                return str(self._path(name))
            case _ if name in ("--start", "--end"):
                near = f"{rng.uniform(-20.0, 450.0):.2f}"
                return rng.choice([near] * 6 + ["0", "nan", "inf", "-inf", "1e-9", "1e300"])
            case _ if name == "--attitude":
                usual_names = ["ATTITUDE", "att", "ATTITUDE", "vehicle_attitude"]
                return rng.choice([*usual_names, "AHRS2", "XKF1", ""])
        return rng.choice(["1", "0", "-1", "57600", "x", ""])

    def _path(self, name: str) -> Path:
        suffixes = (*PARAMETERS, ".html", ".md", ".json", ".tlog", "", ".txt")
        if name == "--parameters":
            return self.rng.choice([*self._parameters(), *self.logs[:2], self.folder / "none"])
        where = [self.folder] * 8 + [self.folder / "missing"]
        return self.rng.choice(where) / f"{self.rng.randrange(6)}{self.rng.choice(suffixes)}"

    def _parameters(self) -> list[Path]:
        return [path for path in self.folder.iterdir() if path.suffix in PARAMETERS]

    def _argument(self, argument: click.Parameter) -> str:
        rng = self.rng
        if argument.name in ("file", "backup"):
            return str(rng.choice([*self._parameters(), *self.logs[:2], self.folder / "none"]))
        log = str(rng.choice(self.logs))
        if argument.name == "address":
            addresses = ["tcp:127.0.0.1:1", ":1", "udp:127.0.0.1:47113", "upd:1", "COM1", ""]
            return rng.choice([f"{log},{rng.choice([100, 1000])}x"] * 6 + addresses)
        return log


def fault(said: Sequence[str]) -> str:
    """Run a command line; what is wrong with how it ended, nothing where it is well."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")
        code = run(list(said))
    return _fault(said, code, out.getvalue(), err.getvalue())


def _fault(said: Sequence[str], code: int, out: str, err: str) -> str:
    ends = ENDS_OF_A_LINK if said[0] in OF_A_LINK else ENDS
    bad = ("should not have happened", "Traceback", "Warning")
    leaked = [line for line in err.splitlines() if any(word in line for word in bad)]
    rules = {
        f"exit code {code}": code not in ends,
        "nothing is said": not out and not err and said[0] != "report",
        "an answer although it ended in an error": bool(out)
        and ends is ENDS
        and code == ExitCode.USAGE,
        "no JSON": "--json" in said and bool(out) and not _is_json(out),
    }
    return leaked[0] if leaked else next((why for why, holds in rules.items() if holds), "")


def _is_json(text: str) -> bool:
    try:
        json.loads(text, parse_constant=_refuse)
    except ValueError:
        return False
    return True


def _refuse(word: str) -> float:
    raise ValueError(word)


def logs_in(folders: Sequence[Path]) -> list[Path]:
    """All logs of some folders, and files that are given in their place."""
    found = (path for folder in folders for path in sorted(folder.iterdir()))
    return [path for path in found if path.suffix.lower() in (*LOGS, ".csv")]


def seeded(folder: Path) -> None:
    """Parameter files to start with."""
    (folder / "a.param").write_text("COMPASS_MOTCT,2\nCOMPASS_MOT_X,1.5\nCOMPASS_MOT_X=0x2\n")
    (folder / "b.params").write_text("1\t1\tCAL_MAG0_XCOMP\t0.1\t9\n")
    (folder / "c.parm").write_text("SYSID_THISMAV 1\n")


def cases(seed: int, count: int, logs: Sequence[Path], folder: Path) -> Iterator[list[str]]:
    """Command lines: nine of ten of those that only look at a log."""
    rng = random.Random(seed)
    looks = CommandLines(rng, logs, folder)
    links = CommandLines(rng, logs, folder, OF_A_LINK)
    for _ in range(count):
        yield (links if rng.random() < 0.1 else looks).draw()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, default=[FIXTURES])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=300)
    wanted = parser.parse_args()
    ran: Counter[str] = Counter()
    failed = 0
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        seeded(Path(scratch))
        for said in cases(wanted.seed, wanted.count, logs_in(wanted.folders), Path(scratch)):
            why = fault(said)
            ran[said[0]] += 1
            if why:
                failed += 1
                print(f"FAILED magcomp {' '.join(said)}\n  {why}", flush=True)
    print(", ".join(f"{name} {number}" for name, number in sorted(ran.items())))
    seconds = time.monotonic() - begun
    print(f"{failed} of {ran.total()} failed, seed {wanted.seed}, {seconds:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
