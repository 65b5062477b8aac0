"""The pilot's line: how wrong the compass is, how wrong it will be, what to do; no statistics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from magcomp.model import Grade, HeadingError, quantity_of
from magcomp.report import words

Document = Mapping[str, Any]

WRITE, KEEP, REFUSE = "write", "keep", "refuse"

_HOVERING = ("copter", "unknown")

_SURELY = 2.0
"""Standard errors beyond which a part is no accident (95 %)."""


def pilots_lines(document: Document) -> tuple[str, ...]:
    """What to do, most useful first: a line for compasses that share an answer.

    Parameters
    ----------
    document
        From :func:`magcomp.report.as_json.analysis_object`.
    """
    if document["only_to_look_at"]:
        return (f"Write nothing: {document['only_to_look_at']}.",)
    compasses = document["compasses"]
    groups = {
        answer: [compass for compass in compasses if answer_of(compass) == answer]
        for answer in (WRITE, KEEP, REFUSE)
    }
    say = {WRITE: _write, KEEP: _keep, REFUSE: _refuse}
    return tuple(
        say[answer](document, group, alone=len(group) == len(compasses))
        for answer, group in groups.items()
        if group
    )


def doubts(reasons: Sequence[str], grade: str) -> Sequence[str]:
    """The reasons without the judge's closing summary, which the pilot's line says in plain words.

    Parameters
    ----------
    reasons, grade
        Of one compass of a fit.
    """
    return reasons[:-1] if len(reasons) > 1 or grade == Grade.GOOD else reasons


def answer_of(compass: Mapping[str, Any]) -> str:
    """:data:`WRITE`, :data:`KEEP` or :data:`REFUSE`, for one compass of the document."""
    if compass["verdict"] == Grade.REJECTED:
        return REFUSE
    if compass["kept"]:
        return KEEP
    return KEEP if is_no_better(compass["quoted"]) and not _takes_out(compass) else WRITE


def is_no_better(row: Mapping[str, float]) -> bool:
    """Whether what is in force cannot be told from the fit: an estimate within the fit's bound."""
    return row["before"] <= row["p95"]


def _takes_out(compass: Mapping[str, Any]) -> bool:
    """Whether the motors' part is known of a vehicle that stood still.

    There the bound is mostly of the calibration, which is as doubtful before as after.
    """
    part, doubt = compass["interference_mgauss"], compass["std_mgauss"]
    return compass["method"] == "sweep" and math.hypot(*part) > _SURELY * math.hypot(*doubt)


def reads_as_quoted(row: Mapping[str, Any], compass: Mapping[str, Any]) -> bool:
    """Whether a row's control quantity is written as that of the row that is quoted."""
    by, quoted = compass["regressor"], compass["quoted"]
    return words.quantity(row["u"], by) == words.quantity(quoted["u"], by)


def with_quoted(
    table: Sequence[HeadingError], quoted: HeadingError, regressor: str
) -> list[HeadingError]:
    """A table with the quoted row in its place, instead of one that is written alike."""
    own = words.quantity(quoted.u, regressor)
    others = [row for row in table if words.quantity(row.u, regressor) != own]
    return sorted([*others, quoted], key=lambda row: row.u)


def table_rows(compass: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The heading errors of one compass of the document, with the row that is quoted among them."""
    rows = [row for row in compass["heading_error_deg"] if not reads_as_quoted(row, compass)]
    return sorted([*rows, compass["quoted"]], key=lambda row: float(row["u"]))


def check_line(document: Document) -> str:
    """The same for the calibration that a log was flown with.

    Parameters
    ----------
    document
        From :func:`magcomp.report.as_json.check_object`.
    """
    compasses = document["compasses"]
    judged = [compass for compass in compasses if compass["quoted"] is not None]
    if not judged:
        return "This log is too short to say how wrong your compass is."
    flown = _flown_by(document, judged)
    worst = max(flown, key=lambda compass: float(compass["quoted"]["in_force"]))
    row = worst["quoted"]
    u = quantity_of(worst["regressor"]).in_sentence(row["u"])
    where = f"{u}, the usual load," if row["hover"] else u
    many = len(flown) > 1
    who, verb = ("compasses", "are") if many else ("compass", "is")
    now = words.degrees(row["in_force"])
    if all(compass["verdict"] == Grade.GOOD for compass in compasses):
        leave = "Leave them as they are." if many else "Leave it as it is."
        most = words.degrees(row["p95"])
        return f"Your {who} {verb} right: at {where} wrong by {now}, at most by {most}. {leave}"
    return f"At {where} your {who} {verb} up to {now} wrong. Fit this log: magcomp fit."


def _flown_by(
    document: Document, group: Sequence[Mapping[str, Any]]
) -> Sequence[Mapping[str, Any]]:
    """Those of a group that the autopilot uses; all where it uses none of them.

    What a compass that is switched off would be wrong by is no error of the vehicle's.
    """
    used = {each["slot"] for each in document["vehicle"]["compasses"] if each["used"]}
    return [compass for compass in group if compass["compass"] in used] or group


def _where(document: Document, compass: Mapping[str, Any]) -> str:
    row = compass["quoted"]
    u = quantity_of(compass["regressor"]).in_sentence(row["u"])
    flies = compass["method"] == "flight" and document["vehicle"]["kind"] in _HOVERING
    return f"at hover ({u})" if row["hover"] and flies else f"at {u}"


def _write(document: Document, group: Sequence[Mapping[str, Any]], *, alone: bool) -> str:
    doubt = any(compass["verdict"] == Grade.MARGINAL for compass in group)
    group = _flown_by(document, group)
    worst = max(group, key=lambda compass: float(compass["quoted"]["before"]))
    now = words.degrees(worst["quoted"]["before"])
    bound = words.degrees(max(compass["quoted"]["p95"] for compass in group))
    where = _where(document, worst)
    many = len(group) > 1
    who = ("your compasses" if many else "your compass") if alone else _named(group)
    verb = "are up to" if many else "is"
    end = "Write them, with the doubt below in mind." if doubt else "Write them."
    at = f"{where[:1].upper()}{where[1:]}"
    if is_no_better(worst["quoted"]):
        most = f"up to {now}" if many else now
        return f"{at} your motors turn {who} by {most}. These numbers take that out. {end}"
    return f"{at} {who} {verb} {now} wrong. With these numbers: at most {bound}. {end}"


def _keep(document: Document, group: Sequence[Mapping[str, Any]], *, alone: bool) -> str:
    worst = max(group, key=lambda compass: float(compass["quoted"]["p95"]))
    many = len(group) > 1
    who = ("your compasses" if many else "your compass") if alone else _named(group)
    verb, leave = ("are", "Leave them as they are.") if many else ("is", "Leave it as it is.")
    bound = words.degrees(worst["quoted"]["p95"])
    what = f"{_where(document, worst)} wrong by at most {bound}"
    return f"{who[:1].upper()}{who[1:]} {verb} as good as this log can tell: {what}. {leave}"


def _refuse(document: Document, group: Sequence[Mapping[str, Any]], *, alone: bool) -> str:  # noqa: ARG001
    reasons = group[0]["reasons"]
    why = words.sentence(reasons[0]) if reasons else ""
    if alone:
        return f"Do not write these numbers. {why}".strip()
    verb = "get" if len(group) > 1 else "gets"
    who = _named(group)
    return f"{who[:1].upper()}{who[1:]} {verb} no numbers. {why}".strip()


def _named(group: Sequence[Mapping[str, Any]]) -> str:
    return words.compasses([compass["compass"] for compass in group])
