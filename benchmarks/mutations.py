"""Break one rule at a time and see whether its test notices.

Each entry of mutations.toml names a rule, the line that keeps it, the line in its place, and the
tests that are to fail then. Every mutation is made in a copy of the repository; nothing here is
touched. What survives is a rule that no test holds.

    python benchmarks/mutations.py [WORD ...]

With words, only entries whose rule or file holds one of them. Exits with 1 where a mutation
survives, or where its line is not found: change the entry together with the code.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = Path(__file__).with_name("mutations.toml")
COPIED = ("magcomp", "tests")
LINKED = ("benchmarks", "docs", "examples", "sitl_fixtures", "pyproject.toml", "README.md")
LONGEST_S = 600.0


@dataclass(frozen=True)
class Mutation:
    """One rule broken.

    Attributes
    ----------
    rule
        What no longer holds.
    file
        Below the repository's root.
    before, after
        The text that is replaced, which stands in the file once, and what replaces it.
    tests
        Node ids of the tests that must fail.
    """

    rule: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]


def mutations(path: Path = LIST) -> Iterator[Mutation]:
    """Give the entries of a list."""
    for entry in tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]:
        yield Mutation(**{**entry, "tests": tuple(entry["tests"])})


def copy_to(folder: Path) -> None:
    """Make a copy of the repository that tests can run in."""
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)


def outcome(mutation: Mutation, folder: Path) -> str:
    """Run the tests of a mutation in a copy; ``killed``, ``SURVIVED``, ``STALE`` or ``BROKEN``."""
    path = folder / mutation.file
    sound = path.read_text(encoding="utf-8")
    if sound.count(mutation.before) != 1:
        return "STALE"
    path.write_text(sound.replace(mutation.before, mutation.after), encoding="utf-8")
    try:
        return {0: "SURVIVED", 1: "killed"}.get(run(mutation.tests, folder), "BROKEN")
    finally:
        path.write_text(sound, encoding="utf-8")


def run(tests: tuple[str, ...], folder: Path) -> int:
    """Run tests in a copy; pytest's exit code, 1 where it does not end."""
    flags = ("-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=0")
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        return subprocess.run(
            [sys.executable, "-m", "pytest", *flags, *tests],
            cwd=folder,
            env=environment,
            capture_output=True,
            check=False,
            timeout=LONGEST_S,
        ).returncode
    except subprocess.TimeoutExpired:
        return 1


def main(words: list[str]) -> int:
    """Print a line for each mutation; how many were not killed."""
    wanted = [m for m in mutations() if not words or any(w in m.rule + m.file for w in words)]
    alive = 0
    with tempfile.TemporaryDirectory() as folder:
        copy_to(Path(folder))
        for mutation in wanted:
            begin = time.monotonic()
            found = outcome(mutation, Path(folder))
            alive += found != "killed"
            took = time.monotonic() - begin
            print(f"{found:<9}{took:5.1f} s  {mutation.rule}", flush=True)
            if found != "killed":
                print(f"{'':18}{mutation.file}: {', '.join(mutation.tests)}", flush=True)
    print(f"{len(wanted) - alive} of {len(wanted)} mutations killed")
    return min(alive, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
