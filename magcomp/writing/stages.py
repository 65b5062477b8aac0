"""The stages of a write: their order, their kinds, and what each of them expects to hear.

Stages and what leaves them
---------------------------
======== ======================================= ======= ========== ==================
stage    sends, a window at a time               then    on silence another value
======== ======================================= ======= ========== ==================
COMPARE  a read of identity and all old values   OFF     over       over
OFF      a write of 0 to the switches            WRITE   again      again
WRITE    a write of each value still to confirm  VERIFY  again/OFF  again
VERIFY   a read of all values, switches still 0  ON      roll back  SETTLE
ON       one write of the target's switches      CONFIRM a read     VERIFY
CONFIRM  a read of the switches                  OVER    roll back  SETTLE
SETTLE   nothing until all sent before has come  IDENTIFY
IDENTIFY a read of the identity                  OFF     roll back  over
OVER     nothing
======== ======================================= ======= ========== ==================

Patience is bounded everywhere; where it ends, a vehicle not yet touched is left
alone and any other is rolled back. The target is the new set; rolling back is
the same road with the old set as target, entered at SETTLE. Refusal, silence, a lost link and a
request to stop roll back, once. A roll-back that fails leaves the switches 0 where they had been
confirmed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from magcomp.mavlink.parameters import fits
from magcomp.writing.events import Stage
from magcomp.writing.files import format_value
from magcomp.writing.plan import WritePlan

NEXT = {
    Stage.COMPARE: Stage.OFF,
    Stage.OFF: Stage.WRITE,
    Stage.WRITE: Stage.VERIFY,
    Stage.VERIFY: Stage.ON,
    Stage.ON: Stage.CONFIRM,
    Stage.CONFIRM: Stage.OVER,
    Stage.SETTLE: Stage.IDENTIFY,
    Stage.IDENTIFY: Stage.OFF,
}
WRITING = frozenset({Stage.OFF, Stage.WRITE, Stage.ON})

REPEATED = frozenset({Stage.OFF, Stage.WRITE})
"""Whose writes are simply sent again."""

FENCED = frozenset({Stage.SETTLE, Stage.VERIFY, Stage.CONFIRM})

PINGING = FENCED | {Stage.COMPARE}
"""In COMPARE, to learn whether and how fast the vehicle answers."""

CLOSED = frozenset({Stage.VERIFY, Stage.CONFIRM})
"""With a second fence behind their answers."""


@dataclass(frozen=True)
class Target:
    """What the vehicle is being driven to: the new set, or the old one when rolling back.

    Attributes
    ----------
    values, switches
        By name.
    unconfirmed
        Values that have not been confirmed so far.
    """

    values: Mapping[str, float]
    switches: Mapping[str, float]
    unconfirmed: Mapping[str, float]


def expected(stage: Stage, plan: WritePlan, target: Target) -> Mapping[str, float]:
    """Names that a stage asks for or writes, and what is to come back."""
    on = {name: value for name, value in target.switches.items() if value != 0.0}
    off = dict.fromkeys(target.switches, 0.0)
    used = (n for n, v in plan.switches.items() if v != 0.0 or plan.old[n] != 0.0)
    by_stage: Mapping[Stage, Mapping[str, float]] = {
        Stage.COMPARE: {**plan.identity, **plan.old},
        Stage.IDENTIFY: plan.identity,
        Stage.OFF: dict.fromkeys(used, 0.0),
        Stage.WRITE: dict(target.unconfirmed),
        Stage.VERIFY: {**off, **target.values},
        Stage.ON: on,
        Stage.CONFIRM: {**target.switches, **({} if on else target.values)},
    }
    return by_stage.get(stage, {})


def misfit(values: Mapping[str, float], types: Mapping[str, int]) -> str:
    """Which of the values its parameter's type cannot hold, as a sentence; empty where all fit."""
    return next(
        (
            f"{name} cannot hold {format_value(value)}"
            for name, value in values.items()
            if not fits(value, types[name])
        ),
        "",
    )
