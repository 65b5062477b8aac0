"""Which compass the autopilot uses, and what to do with each: write, keep, move, switch off."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from magcomp import autopilots
from magcomp.report import plain, words

Document = Mapping[str, Any]

WRITE_IT = "write its numbers"

_LESS_DISTURBED = 0.5
"""A compass whose motors add less than this share of another's deserves its place."""

_LARGE = 0.5
"""A shift beyond this share of the horizontal field turns the heading by 30° and more."""


@dataclass(frozen=True)
class Role:
    """One compass.

    Attributes
    ----------
    compass
        Its number.
    use
        What the autopilot does with it; empty where the recording does not say.
    action
        What to do with it, without a full stop.
    leads
        Whether the vehicle flies on it: its heading comes from this compass.
    """

    compass: int
    use: str
    action: str
    leads: bool = False


def roles(document: Document) -> tuple[Role, ...]:
    """Every compass of an answer, the one that the vehicle flies on first.

    Parameters
    ----------
    document
        From :func:`magcomp.report.as_json.analysis_object`.
    """
    told = {compass["slot"]: compass for compass in document["vehicle"]["compasses"]}
    judged = {compass["compass"]: compass for compass in document["compasses"]}
    first = _first(document, told)
    return tuple(
        Role(
            number,
            _use(told.get(number, {}), number == first),
            _action(number, judged, told, first),
            number == first,
        )
        for number in sorted(judged, key=lambda number: (number != first, number))
    )


def _first(document: Document, told: Mapping[int, Mapping[str, Any]]) -> int | None:
    """The compass the heading comes from; None where that does not follow from the slots."""
    used = [slot for slot, compass in sorted(told.items()) if compass["used"]]
    if len(used) > 1 and not autopilots.named(document["vehicle"]["autopilot"]).first_slot_leads:
        return None
    return used[0] if used else None


def _use(compass: Mapping[str, Any], first: bool) -> str:
    if compass.get("used") is None:
        return ""
    if not compass["used"]:
        return "not used by the autopilot"
    return "used first by the autopilot" if first else "used by the autopilot"


def _action(
    number: int,
    judged: Mapping[int, Mapping[str, Any]],
    told: Mapping[int, Mapping[str, Any]],
    first: int | None,
) -> str:
    compass = judged[number]
    answer = plain.answer_of(compass)
    used = told.get(number, {}).get("used") is not False
    others = [
        other
        for other, found in judged.items()
        if other != number
        and plain.answer_of(found) != plain.REFUSE
        and told.get(other, {}).get("used") is not False
    ]
    if answer == plain.REFUSE:
        return "; ".join(_mend(others, used=used, is_first=number == first))
    do = WRITE_IT if answer == plain.WRITE else "keep it as it is"
    return "; ".join([do, *_place(number, judged, others, first)])


def _mend(others: list[int], *, used: bool, is_first: bool) -> Iterator[str]:
    if not used:
        yield "leave it switched off"
        return
    if others:
        yield f"switch it off and fly on {words.compasses(others)}"
        if is_first:
            yield f"put compass {others[0]} first"
    yield "or move it away from the power wires" if others else "mend what the verdict names"


def _place(
    number: int,
    judged: Mapping[int, Mapping[str, Any]],
    others: list[int],
    first: int | None,
) -> Iterator[str]:
    shift = _motors(judged[number])
    better = min(others, key=lambda other: _motors(judged[other]), default=None)
    if number == first and better is not None:
        if _motors(judged[better]) < _LESS_DISTURBED * shift:
            yield f"put compass {better} first, the motors disturb it less"
    elif shift * judged[number]["quoted"]["u"] > _LARGE * _horizontal(judged[number]):
        yield "moved away from the power wires it would do better"


def _motors(compass: Mapping[str, Any]) -> float:
    return math.hypot(*compass["interference_mgauss"])


def _horizontal(compass: Mapping[str, Any]) -> float:
    earth = compass["earth_mgauss"]
    return math.sqrt(max(earth["strength"] ** 2 - earth["vertical"] ** 2, 0.0))
