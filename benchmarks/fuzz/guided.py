"""Fuzz one of magcomp's readers, its link or the whole analysis, guided by coverage.

    pip install atheris
    python benchmarks/fuzz/guided.py TARGET FOLDER [LIBFUZZER OPTIONS]

What reaches new code is kept in FOLDER and tried again; see run.py for what an input must not do.
What does it is left as libFuzzer leaves it, in a file ``crash-…``.
"""

from __future__ import annotations

import random
import sys
import warnings
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["magcomp"]):
    from mutate import of_bytes, of_frames
    from run import fault_of
    from seeds import seeds
    from targets import FRAMED, TARGETS


class FoundError(Exception):
    """An input did what it must not."""


def main() -> None:
    """Parse the command line and fuzz; never returns."""
    name, folder = sys.argv[1], Path(sys.argv[2])
    begin, target = seeds(name), TARGETS[name]
    folder.mkdir(parents=True, exist_ok=True)
    for number, each in enumerate(begin):
        (folder / f"seed-{number}").write_bytes(each)

    def one(data: bytes) -> None:
        fault = fault_of(target, data)
        if fault:
            raise FoundError(fault)

    def mutated(data: bytes, most: int, seed: int) -> bytes:
        chance = random.Random(seed)
        if chance.random() < 1 / 3:
            made: bytes = atheris.Mutate(data, most)
        elif name in FRAMED and chance.random() < 0.7:
            made = of_frames(chance, [data]) or data
        else:
            made = of_bytes(chance, [data, *begin] if chance.random() < 0.1 else [data])
        return made[:most]

    warnings.simplefilter("error")
    atheris.Setup([sys.argv[0], str(folder), *sys.argv[3:]], one, custom_mutator=mutated)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
