"""What a recording must have shown before anything in it can be called good."""

from __future__ import annotations

from collections.abc import Iterator

from magcomp.judge.finding import Finding
from magcomp.judge.thresholds import Thresholds
from magcomp.model import CURRENT, Coverage, Grade

_HOVERS = 0.4
"""A vehicle that stays in the air never lets its motors idle: this share of its highest control."""

_IDLE_A = 1.0
"""The electronics alone of a vehicle this work is for draw about as much."""


def on_control(
    kind: str, covered: Coverage, limits: Thresholds, *, known: bool
) -> Iterator[Finding]:
    """Whether the motors ran, and harder at times than at others.

    Parameters
    ----------
    kind
        Of the control quantity.
    covered
        What the readings cover.
    limits
        The least range.
    known
        Whether the bound is small all the same.

    Notes
    -----
    A hover's narrow range may still do where the motors add little: the bound knows. Where the
    motors hardly ran, nothing is known of how they run in the air.
    """
    span = covered.u_high - covered.u_low
    running = kind != CURRENT or covered.u_high > _IDLE_A
    hovering = running and covered.u_low > _HOVERS * covered.u_high
    grade = Grade.MARGINAL if hovering and known else Grade.REJECTED
    if kind == CURRENT and span < limits.least_current_a:
        yield Finding(
            grade,
            f"the current only ranged from {covered.u_low:.0f} to {covered.u_high:.0f} A: "
            "fly climbs and descents so that the motors work harder and less hard",
        )
    elif kind != CURRENT and span < limits.least_throttle:
        yield Finding(
            Grade.REJECTED if covered.u_high < 0.3 else grade,
            f"the throttle never rose above {covered.u_high * 100:.0f} %: fly a climb"
            if covered.u_high < 0.3
            else f"the throttle only ranged from {covered.u_low * 100:.0f} to "
            f"{covered.u_high * 100:.0f} %: fly climbs and descents",
        )


def on_turn(covered: Coverage, limits: Thresholds, *, known: bool) -> Iterator[Finding]:
    """Whether the vehicle turned round; ``known`` as for :func:`on_control`."""
    if covered.heading < limits.heading:
        enough = covered.heading >= limits.least_heading or known
        yield Finding(
            Grade.MARGINAL if enough else Grade.REJECTED,
            f"the vehicle faced only {covered.heading * 100:.0f} % of a full turn: "
            "turn slowly all the way round",
        )


def on_duration(covered: Coverage, limits: Thresholds) -> Iterator[Finding]:
    """Whether there is enough of it."""
    if covered.seconds < limits.least_seconds:
        yield Finding(
            Grade.REJECTED,
            f"only {covered.seconds:.0f} s can be used, which is too short to judge anything by: "
            f"record {limits.least_seconds:.0f} s at least, and better some minutes",
        )


def on_unseen_parameters(unseen: tuple[str, ...]) -> Iterator[Finding]:
    """Whether the log tells what the autopilot did to its readings."""
    if unseen:
        some = ", ".join(unseen[:3]) + (f" and {len(unseen) - 3} more" if len(unseen) > 3 else "")
        yield Finding(
            Grade.REJECTED,
            f"what was in force is unknown, because {some} {'is' if len(unseen) == 1 else 'are'} "
            "not in the log: let the ground station fetch the whole parameter list while it "
            "records, or take the log of the autopilot's card",
        )
