"""Current or throttle: which of the two predicts readings that a fit did not see."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from magcomp.errors import MagcompError
from magcomp.fit import Problem, best_form, fit_alike, solvable
from magcomp.judge import Thresholds, apart_at_rest, field_residual
from magcomp.model import (
    CURRENT,
    MOTORS,
    THROTTLE,
    Control,
    Grade,
    HeadingError,
    MotorFit,
    Verdict,
    quantity_of,
)

BETTER, CLEARLY_BETTER = 0.97, 0.8
"""Throttle is written instead of current only where it leaves less than the first share of what
current leaves unexplained: current needs no battery at the same voltage. Down to the second share
it must bound the heading as well: what is told late or seldom leaves more, and may still be what
the field follows in a line."""


@dataclass(frozen=True, eq=False)
class Judged:
    """One compass fitted against one control quantity, and the verdict."""

    problem: Problem
    fit: MotorFit
    verdict: Verdict

    @property
    def held_out(self) -> float:
        """The residual on unseen readings, mGauss."""
        return self.verdict.residual.held_out

    @property
    def is_rejected(self) -> bool:
        """Whether it must not be written."""
        return self.verdict.grade is Grade.REJECTED


@dataclass(frozen=True, eq=False)
class Rival:
    """One compass fitted against the quantity that is not chosen.

    Attributes
    ----------
    fit
        What came out.
    held_out
        The residual on unseen readings, mGauss.
    """

    fit: MotorFit
    held_out: float


def beaten(by_current: Sequence[Judged], forms: Sequence[Control]) -> tuple[Rival, ...]:
    """Fits by throttle where that is plainly no better; else none.

    A fit of its own costs as much as that by current, and is thrown away on most logs. Throttle
    with the same parameters open shows as well that it is not needed.

    Parameters
    ----------
    by_current
        Every compass, fitted by current.
    forms
        Of the throttle.

    Returns
    -------
    tuple of Rival
        A compass each; empty where only whole fits can tell.
    """
    if all(each.is_rejected for each in by_current):
        return ()
    if any(each.fit.method != "flight" for each in by_current):
        return ()
    try:
        rivals = _rivals(by_current, forms)
    except MagcompError:
        return ()
    left = [each.held_out for each in rivals]
    is_better = _typical(left) < BETTER * _typical([each.held_out for each in by_current])
    return () if is_better else rivals


def _rivals(by_current: Sequence[Judged], forms: Sequence[Control]) -> tuple[Rival, ...]:
    rivals = []
    for each in by_current:
        with solvable(each.fit.compass):
            problem = best_form([replace(each.problem, control=form) for form in forms])
            forms = [problem.control]
            alike = fit_alike(problem, each.fit)
            residual, _ = field_residual(problem, alike)
        rivals.append(Rival(alike, residual.held_out))
    return tuple(rivals)


def doubted(
    judged: Mapping[str, Sequence[Judged]],
    chosen: str,
    rivals: Sequence[Rival] = (),
    limits: Thresholds | None = None,
) -> tuple[Judged, ...]:
    """The chosen fits, none by current good where throttle says another and explains no less.

    Two quantities that go together in flight need not go together below it: what was never flown
    is known only as far as both say the same. Which of them the field follows is a matter of the
    vehicle, so all its compasses together tell which explains less.

    Parameters
    ----------
    judged
        Every compass fitted and judged, by kind.
    chosen
        The kind that is to be written.
    rivals
        By throttle, where it was fitted in short only.
    limits
        The limits; the defaults are the product's.
    """
    if quantity_of(chosen).is_throttle:
        return tuple(judged[chosen])
    by_throttle: Sequence[Rival | Judged] = rivals or judged.get(THROTTLE, ())
    by_compass = {rival.fit.compass: rival for rival in by_throttle}
    both = [each for each in judged[chosen] if each.fit.compass in by_compass]
    left = [by_compass[each.fit.compass].held_out for each in both]
    if not both or _typical(left) > _typical([each.held_out for each in both]):
        return tuple(judged[chosen])
    limits = limits or Thresholds()
    return tuple(
        _doubted(each, by_compass.get(each.fit.compass), limits) for each in judged[chosen]
    )


def _doubted(each: Judged, rival: Rival | Judged | None, limits: Thresholds) -> Judged:
    if each.verdict.grade is not Grade.GOOD or rival is None:
        return each
    apart = apart_at_rest(each.fit, rival.fit.correction)
    if apart <= limits.beside(_bound(each)):
        return each
    reason = (
        f"throttle explains the field as well as current, and the two differ by {apart:.0f}° at "
        "rest: fly descents with the motors working little, and make sure that the battery monitor "
        "measures all that the motors draw"
    )
    verdict = replace(each.verdict, grade=Grade.MARGINAL, reasons=(reason, *each.verdict.reasons))
    return replace(each, verdict=verdict)


def better(judged: Mapping[str, Sequence[Judged]]) -> str:
    """The control quantity that predicts held-out readings better; current where it is close.

    Parameters
    ----------
    judged
        Every compass fitted and judged, by kind; at least one kind.
    """
    if len(judged) == 1:
        return next(iter(judged))
    rejected = {kind: all(j.is_rejected for j in results) for kind, results in judged.items()}
    if rejected[THROTTLE] or rejected[CURRENT]:
        return CURRENT if rejected[THROTTLE] else THROTTLE
    # A sweep's residual rows have three components, the others' two.
    left = {
        kind: [j.held_out / np.sqrt(2 + (j.fit.method == "sweep")) for j in results]
        for kind, results in judged.items()
    }
    share = _typical(left[THROTTLE]) / _typical(left[CURRENT])
    if not CLEARLY_BETTER <= share < BETTER:
        return CURRENT if share >= BETTER else THROTTLE
    bound = {kind: _typical([_bound(j) for j in results]) for kind, results in judged.items()}
    return THROTTLE if bound[THROTTLE] <= bound[CURRENT] else CURRENT


def _bound(each: Judged) -> float:
    """The largest bound of the heading that was flown, degrees."""
    return max(flown(each.verdict.heading_error, each.fit.u_high), default=np.inf)


def flown(table: Iterable[HeadingError], top: float) -> list[float]:
    """The bounds of the rows up to the largest control quantity flown, degrees."""
    return [row.p95 for row in table if row.u <= top]


def _typical(left: Sequence[float]) -> float:
    return float(np.exp(np.mean(np.log(np.maximum(left, 1e-6)))))


def comparison(held_out: Mapping[str, Sequence[float]], chosen: str) -> str:
    """In words, why this control quantity was chosen.

    Parameters
    ----------
    held_out
        By kind, what each compass' fit leaves of unseen readings, mGauss.
    chosen
        The kind that was.
    """
    scores = ", ".join(
        f"{kind} leaves {'/'.join(f'{left:.1f}' for left in each)} mGauss"
        for kind, each in held_out.items()
    )
    if chosen == MOTORS:
        why = "was asked for"
    elif _typical(held_out[chosen]) > min(map(_typical, held_out.values())) / BETTER:
        why = "bounds the heading better, though on held-out data it leaves a little more"
    else:
        why = "is the better choice on held-out data"
    return f"{chosen} is used because it {why}: {scores}"
