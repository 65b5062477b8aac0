"""What stands on a vehicle after a write in a storm: many runs of each kind of trouble, at random.

The simulated vehicle, the counts and the client are those of fault_matrix.py.

    python benchmarks/fault_storm.py [RUNS [ardupilot|px4]]
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from unittest import mock

import numpy as np
from fault_matrix import FIRMWARE, Case, Firmware

from magcomp.simulate import Faults, Habits

MESSAGES = 270


@dataclass(frozen=True)
class Storm:
    """One run's trouble."""

    faults: Faults
    habits: Habits = field(default_factory=lambda: Habits(storage_s=0.9))
    at: int = 0
    how: str = ""
    answers_errors: bool = False


Maker = Callable[[np.random.Generator, Firmware], Storm]


def some(luck: np.random.Generator, firmware: Firmware) -> frozenset[str]:
    return frozenset(luck.choice(firmware.names, 2, replace=False).tolist())


def anywhere(luck: np.random.Generator, most: int = MESSAGES) -> int:
    return int(luck.integers(1, most))


BAD = Faults(loss=0.3, latency_s=1.0, reordering=0.1, duplication=0.1)

KINDS: dict[str, Maker] = {
    "clean": lambda _, _firmware: Storm(Faults()),
    "30 % loss, 1 s latency": lambda _, _firmware: Storm(BAD),
    "replies 5 s late": lambda _, _firmware: Storm(Faults(latency_s=2.5, loss=0.05)),
    "replies 5 s late, reboot": lambda luck, _firmware: Storm(
        Faults(latency_s=2.5, reboot_at=anywhere(luck, 4000))
    ),
    "clamping": lambda luck, firmware: Storm(
        Faults(), Habits(storage_s=0.9, clamped=dict.fromkeys(some(luck, firmware), (-1.0, 1.0)))
    ),
    "ignored names": lambda luck, firmware: Storm(
        Faults(), Habits(storage_s=0.9, ignored=some(luck, firmware))
    ),
    "denied names": lambda luck, firmware: Storm(
        Faults(), Habits(storage_s=0.9, denied=some(luck, firmware))
    ),
    "denied with PARAM_ERROR": lambda luck, firmware: Storm(
        Faults(), Habits(storage_s=0.9, denied=some(luck, firmware)), answers_errors=True
    ),
    "arming in the middle": lambda luck, _firmware: Storm(Faults(arm_at=anywhere(luck))),
    "reboot, writes kept": lambda luck, _firmware: Storm(
        Faults(reboot_at=anywhere(luck)), Habits()
    ),
    "reboot, writes lost": lambda luck, _firmware: Storm(Faults(reboot_at=anywhere(luck))),
    "reboot with loss": lambda luck, _firmware: Storm(
        Faults(reboot_at=anywhere(luck, 600), loss=0.3, latency_s=0.1)
    ),
    "killed, then reboot": lambda luck, _firmware: Storm(Faults(), at=anywhere(luck), how="killed"),
    "killed with loss, then reboot": lambda luck, _firmware: Storm(
        Faults(loss=0.3, latency_s=0.2), at=anywhere(luck, 600), how="killed"
    ),
    "callback fails with loss": lambda luck, _firmware: Storm(
        Faults(loss=0.3, latency_s=0.1), at=anywhere(luck, 160), how="callback"
    ),
    "link dies under loss": lambda luck, _firmware: Storm(
        Faults(loss=0.3, latency_s=0.1, dead_at=anywhere(luck, 800))
    ),
}


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for key in sys.argv[2:] or [*FIRMWARE]:
        storm(FIRMWARE[key], runs)


def storm(firmware: Firmware, runs: int) -> None:
    print(f"{firmware.key}")
    print(
        f"{'kind':<32}{'runs':>6}{'half-written':>14}{'false claims':>14}{'not restored':>14}"
        f"{'old/new/off':>16}{'longest':>9}"
    )
    with mock.patch("os.fsync"):
        for kind, made in KINDS.items():
            measure(firmware, kind, made, runs)


def measure(firmware: Firmware, kind: str, made: Maker, runs: int) -> None:
    counts, longest = [0, 0, 0], 0.0
    stood: Counter[str] = Counter()
    for seed in range(runs):
        storm = made(np.random.default_rng([seed, len(kind)]), firmware)
        with tempfile.TemporaryDirectory() as name:
            case = Case(
                firmware,
                storm.faults,
                Path(name),
                storm.at,
                storm.how,
                habits=storm.habits,
                answers_errors=storm.answers_errors,
                seed=seed,
            )
            *bad, word = case.verdict()
        if storm.habits.clamped or storm.habits.ignored:
            bad[2] = False  # what a vehicle does not take, nothing can bring back
        counts = [count + one for count, one in zip(counts, bad, strict=True)]
        stood[word] += 1
        longest = max(longest, case.seconds)
    shares = "/".join(str(stood[word]) for word in ("old", "new", "off"))
    print(
        f"{kind:<32}{runs:>6}{counts[0]:>14}{counts[1]:>14}{counts[2]:>14}"
        f"{shares:>16}{longest:>7.0f} s",
        flush=True,
    )


if __name__ == "__main__":
    main()
