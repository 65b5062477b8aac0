"""The difference between a vehicle and what would be written, as rows to show."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from magcomp.model import Analysis, ParameterSet
from magcomp.report import words
from magcomp.writing.events import (
    Event,
    Intends,
    Mismatch,
    Outcome,
    Progress,
    RollingBack,
    Stage,
    Standing,
    Written,
)
from magcomp.writing.files import format_value
from magcomp.writing.plan import in_order


@dataclass(frozen=True)
class ChangeRow:
    """One parameter.

    Attributes
    ----------
    name, old, new
        As text; ``old`` is a question mark where the vehicle's value is not known.
    state
        How far it is, in a word; empty before writing.
    """

    name: str
    old: str
    new: str
    state: str = ""

    @property
    def done(self) -> bool:
        """Read back as it should be."""
        return self.state == READ_BACK


READ_BACK = "✓ read back"
_READING = (Stage.VERIFY, Stage.ON, Stage.CONFIRM)


def after_event(rows: tuple[ChangeRow, ...], event: Event) -> tuple[ChangeRow, ...]:
    """The rows after something happened to the write."""
    every = {row.name for row in rows}
    match event:
        case Intends(Stage.WRITE, values):
            names, state = set(values), "waits"
        case Written(name):
            names, state = {name}, "written"
        case Progress(stage, name) if stage in _READING:
            names, state = {name}, READ_BACK
        case Mismatch(name, _, received):
            names, state = {name}, f"holds {format_value(received)}"
        case RollingBack():
            names, state = every, "putting back"
        case Outcome(good=True):
            names, state = every, READ_BACK
        case Outcome(standing=standing):
            names, state = every, "as before" if standing is Standing.OLD else "not sure"
        case _:
            return rows
    return tuple(replace(row, state=state) if row.name in names else row for row in rows)


def change_rows(present: Mapping[str, float], wanted: ParameterSet | None) -> tuple[ChangeRow, ...]:
    """The parameters that would change, in the order in which they would be written."""
    if wanted is None:
        return ()
    return tuple(
        ChangeRow(name, _text(present.get(name, math.nan)), _text(wanted.values[name]))
        for name in in_order(wanted.values)
        if name not in present or np.float32(present[name]) != np.float32(wanted.values[name])
    )


def left_out_warnings(
    analysis: Analysis, chosen: frozenset[int], present: Mapping[str, float]
) -> Iterator[str]:
    """What happens to compasses that are not chosen: one switch serves all of them."""
    for result in analysis.compasses:
        compass = result.fit.compass
        if compass in chosen or not chosen:
            continue
        stored = [present.get(name, 0.0) for name in result.left_out]
        if any(stored):
            vector = ", ".join(words.number(value) for value in stored)
            yield (
                f"Compass {compass} is left out, but the switch serves all compasses: its stored "
                f"vector ({vector}) would act, so it is set to 0."
            )


def _text(value: float) -> str:
    return format_value(value) if math.isfinite(value) else "?"
