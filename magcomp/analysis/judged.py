"""Every compass by every control quantity: which of them to take, and what to say of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from magcomp import autopilots
from magcomp.align import has_position
from magcomp.analysis.multiplied import multiplied_notes
from magcomp.errors import MissingDataError
from magcomp.fit import Problem
from magcomp.judge.forms import forms
from magcomp.model import (
    CURRENT,
    MOTORS,
    THROTTLE,
    Control,
    Form,
    Grade,
    MotorFit,
    Recording,
    Verdict,
    quantity_of,
)

BETTER = 0.97
"""Throttle is written instead of current only where it leaves less than this share unexplained:
current needs no battery at the same voltage."""


@dataclass(frozen=True, eq=False)
class Judged:
    """One compass by one control quantity."""

    problem: Problem
    fit: MotorFit
    verdict: Verdict


def chosen_of(judged: Mapping[str, list[Judged]]) -> str:
    """The control quantity that predicts held-out data better; current where it is close."""

    def unexplained(kind: str) -> float:
        # A sweep's residual rows have three components, the others' two.
        logs = [
            np.log(max(j.verdict.residual.held_out, 1e-6) / np.sqrt(2 + (j.fit.method == "sweep")))
            for j in judged[kind]
        ]
        return float(np.exp(np.mean(logs)))

    if len(judged) == 1:
        return next(iter(judged))
    rejected = {
        kind: all(j.verdict.grade is Grade.REJECTED for j in results)
        for kind, results in judged.items()
    }
    if rejected[THROTTLE] or rejected[CURRENT]:
        return CURRENT if rejected[THROTTLE] else THROTTLE
    return THROTTLE if unexplained(THROTTLE) < BETTER * unexplained(CURRENT) else CURRENT


def lacking_notes(
    lacking: Mapping[int, MissingDataError], judged: Mapping[str, list[Judged]]
) -> Iterable[str]:
    """Which compasses could not be fitted by any quantity, and why."""
    done = {j.fit.compass for results in judged.values() for j in results}
    for compass, why in sorted(lacking.items()):
        if compass not in done:
            yield f"compass {compass} is left out: {why}"


def notes_of(
    recording: Recording, wanted: int | None, judged: Mapping[str, list[Judged]], chosen: str
) -> Iterable[str]:
    """What a user should know of a recording and of the choice; ``wanted`` is the compass."""
    if len(judged) > 1:
        scores = ", ".join(
            f"{kind} leaves "
            + "/".join(f"{j.verdict.residual.held_out:.1f}" for j in results)
            + " mGauss"
            for kind, results in judged.items()
        )
        reason = "was asked for" if chosen == MOTORS else "is the better choice on held-out data"
        yield f"{chosen} is used because it {reason}: {scores}"
    elif quantity_of(chosen).is_throttle and recording.current is None:
        yield "the log holds no battery current, so throttle is used"
    if not has_position(recording):
        yield "the log holds no position: the earth's field is taken from the readings themselves"
    yield from multiplied_notes(recording, chosen)
    autopilot = autopilots.of(recording)
    yield from autopilot.reading_notes(recording)
    yield from autopilot.warnings(recording.parameters.latest)
    for compass, why in sorted(autopilot.left_out(recording.parameters).items()):
        if compass in recording.field and wanted is None:
            yield f"compass {compass} is left out: {why}"
    if not recording.parameters.names:
        yield (
            "the log holds no parameters: the calibration in force is unknown, so only the motor "
            "vector is given, and it is right only if no motor compensation was in force"
        )
    yield from recording.report.notes
    others = recording.report.others
    if others:
        named = ", ".join(f"{system}:{component}" for system, component in others)
        yield f"messages of other systems were left out ({named})"
    if recording.report.bad_checksum:
        yield f"{recording.report.bad_checksum} damaged messages were left out"


def compare(
    judged: Mapping[str, list[Judged]], motors: tuple[Control, ...]
) -> Mapping[int, tuple[Form, ...]]:
    """By compass, what the field of a flight may follow; see :func:`magcomp.judge.forms`."""
    by_compass: dict[int, dict[str, Judged]] = {}
    for kind, each in judged.items():
        for one in each:
            if one.fit.method == "flight":
                by_compass.setdefault(one.fit.compass, {})[kind] = one
    found = {}
    for compass, kinds in by_compass.items():
        base = kinds.get(CURRENT)
        if base is None:
            continue
        others = [
            (one.problem, one.fit) for kind, one in kinds.items() if kind not in (CURRENT, MOTORS)
        ]
        of_motors = kinds[MOTORS].problem.control if MOTORS in kinds else None
        control = of_motors or (motors[0] if motors else None)
        found[compass] = forms(base.problem, base.fit, control, others)
    return found


def forms_notes(
    compared: Mapping[int, tuple[Form, ...]], judged: Mapping[str, list[Judged]], chosen: str
) -> Iterable[str]:
    """What the comparison says that the chosen form does not have."""
    better: dict[str, list[tuple[int, Form, Form]]] = {}
    for compass, tried in compared.items():
        best = next(form for form in tried if form.is_best)
        now = next((form for form in tried if form.name == chosen), tried[0])
        if best.count > now.count:
            better.setdefault(best.name, []).append((compass, best, now))
    for name, found in better.items():
        whose = "compass " + ", ".join(str(compass) for compass, _, _ in found)
        leaves = (
            f"leaves {_listed(best.held_out for _, best, _ in found)} instead of "
            f"{_listed(now.held_out for _, _, now in found)} mGauss on unseen data"
        )
        costs = f"up to {_listed(now.left_deg for _, _, now in found)}° of heading in this flight"
        if name == MOTORS:
            yield (
                f"the motors disturb {whose} unequally: motor by motor {leaves}, and one {chosen} "
                f"costs {costs}; fit with --regressor motors"
            )
        else:
            fit = next(j.fit for j in judged[chosen] if j.fit.compass == found[0][0])
            quantity = quantity_of(fit.regressor)
            yield (
                f"what disturbs {whose} bends with the {chosen}: a curve {leaves}; the straight "
                f"value fitted here is the best one from {quantity.scale * fit.u_low:.0f} to "
                f"{quantity.text(fit.u_high)} and costs {costs}: fly in that range, or move the "
                "compass away from the wires"
            )


def _listed(values: Iterable[float]) -> str:
    return "/".join(f"{value:.1f}" for value in values)
