"""A process that fits keeps the memory of its arrays, and one thread for its matrices."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

ROUNDS, TOGETHER = 10, 3
SIZE = 8 << 20
PROGRAM = f"""
import resource, sys
if sys.argv[1] == "prepared":
    from magcomp.process import prepare
    prepare()
held = [bytearray(b"x") * {SIZE} for _ in range({TOGETHER})]
del held
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range({ROUNDS}):
    held = [bytearray(b"x") * {SIZE} for _ in range({TOGETHER})]
    del held
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how: str) -> int:
    """Pages that the system had to clear for arrays made and dropped one after the other."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, how], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_arrays_that_follow_each_other_share_their_memory() -> None:
    once = TOGETHER * SIZE // 4096
    assert faults("as it is") > ROUNDS * once // 2
    assert faults("prepared") < once


def test_linear_algebra_has_one_thread_unless_the_user_says_otherwise() -> None:
    program = "import os, magcomp.cli; print(os.environ['OPENBLAS_NUM_THREADS'])"
    bare = {name: value for name, value in os.environ.items() if not name.endswith("_THREADS")}
    for set_by_user, wanted in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=bare | set_by_user,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == wanted
