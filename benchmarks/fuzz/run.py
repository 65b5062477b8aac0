"""Fuzz one of magcomp's readers, its link or the whole analysis.

    python benchmarks/fuzz/run.py TARGET [--seconds S] [--seed N] [--keep FOLDER]

An input must end in nothing or in one of magcomp's own errors, within 5 s and 1 GB, and without a
warning of numpy. What does not is kept under its digest; put into corpus/TARGET it becomes a seed
and a test (tests/test_fuzz_corpus.py). The mutations are made blindly; guided.py has them guided by
coverage.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import resource
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

from mutate import of_bytes, of_frames
from seeds import seeds
from targets import FRAMED, TARGETS, Target

from magcomp.errors import MagcompError

LONGEST_S = 5.0
MOST_BYTES = 1 << 30


class TooLongError(Exception):
    """An input took longer than it may."""


def _too_long(_signal: int, _frame: FrameType | None) -> None:
    raise TooLongError


def fault_of(target: Target, data: bytes) -> str:
    """What an input does that it must not; empty where it behaves."""
    before = signal.signal(signal.SIGVTALRM, _too_long)
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)
    try:
        target(data)
    except MagcompError:
        return ""
    except TooLongError:
        return f"over {LONGEST_S:g} s\n{traceback.format_exc()}"
    except Exception:  # any at all is what is looked for
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    return ""


def _most_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10


def blindly(name: str, seconds: float, seed: int, keep: Path) -> int:
    """Mutate and try for so much CPU time; how many different faults there were."""
    chance, target, begin = random.Random(seed), TARGETS[name], seeds(name)
    start, spent = _most_bytes(), time.process_time()
    end, count, faults = spent + seconds, 0, set()
    while time.process_time() < end:
        framed = name in FRAMED and chance.random() < 0.7
        data = (of_frames if framed else of_bytes)(chance, begin)
        fault = fault_of(target, data)
        count += 1
        where = "\n".join(fault.strip().splitlines()[-3:])
        if fault and where not in faults:
            faults.add(where)
            keep.mkdir(parents=True, exist_ok=True)
            path = keep / f"{name}-{hashlib.sha256(data).hexdigest()[:12]}"
            path.write_bytes(data)
            print(f"{path}: {fault}", flush=True)
    used = _most_bytes()
    print(
        f"{name}: {count} executions in {time.process_time() - spent:.0f} s of CPU, "
        f"{len(faults)} faults, {used >> 20} MiB at most, {start >> 20} MiB at the start",
        flush=True,
    )
    return len(faults) + (used > MOST_BYTES)


def main() -> int:
    """Parse the command line and fuzz."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-found"))
    arguments = parser.parse_args()
    warnings.simplefilter("error")
    return 1 if blindly(arguments.target, arguments.seconds, arguments.seed, arguments.keep) else 0


if __name__ == "__main__":
    sys.exit(main())
