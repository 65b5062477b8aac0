"""What a recording must have shown before anything in it can be called good."""

from __future__ import annotations

from collections.abc import Iterator

from magcomp.judge.finding import Finding
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Coverage, Grade, quantity_of

_HOVERS = 0.4
"""A vehicle that stays in the air never lets its motors idle: this share of its highest control."""


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
    quantity = quantity_of(kind)
    least = quantity.of(current=limits.least_current_a, throttle=limits.least_throttle)
    running = covered.u_high > quantity.idle
    hovering = running and covered.u_low > _HOVERS * covered.u_high
    grade = Grade.MARGINAL if hovering and known else Grade.REJECTED
    if covered.u_high - covered.u_low >= least:
        return
    top = quantity.text(covered.u_high)
    if covered.u_high < quantity.flies:
        yield Finding(Grade.REJECTED, f"the {kind} never rose above {top}: fly a climb")
    else:
        yield Finding(
            grade,
            f"the {kind} only ranged from {quantity.scale * covered.u_low:.0f} to {top}: "
            f"{quantity.how_to_vary}",
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
