"""The table of messages is pymavlink's, and reading a log needs no more of pymavlink."""

from __future__ import annotations

import subprocess
import sys

from write_dialect import TABLE, lines

from magcomp.mavlink.messages import WANTED


def by_number(table: list[str]) -> dict[int, str]:
    return {int(line.split(" ")[0]): line for line in table}


def test_the_table_has_every_message_as_pymavlink_has_it() -> None:
    """A newer pymavlink may know more; what both know is alike, or a frame is misread."""
    ours = by_number(TABLE.read_text(encoding="ascii").splitlines())
    theirs = by_number(list(lines()))
    assert {number: theirs[number] for number in ours} == ours
    assert set(ours) >= WANTED


def test_a_log_is_fitted_without_importing_pymavlink() -> None:
    """Its import takes longer than reading a log does, and 100 MB."""
    program = "import sys, magcomp.cli.fit; sys.exit('pymavlink' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
