"""The pilot's line: how wrong the compass is, how wrong it will be, what to do; no statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from magcomp.model import Grade, Verdict, quantity_of
from magcomp.report import words

Document = Mapping[str, Any]

WRITE, KEEP, REFUSE = "write", "keep", "refuse"

_HOVERING = ("copter", "unknown")


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
    return KEEP if compass["kept"] or is_no_better(compass["quoted"]) else WRITE


def is_no_better(row: Mapping[str, float]) -> bool:
    """Whether what is in force cannot be told from the fit: an estimate within the fit's bound."""
    return row["before"] <= row["p95"]


def table_rows(compass: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The heading errors of one compass of the document, with the row that is quoted among them."""
    quoted = compass["quoted"]
    rows = [row for row in compass["heading_error_deg"] if row["u"] != quoted["u"]]
    return sorted([*rows, quoted], key=lambda row: float(row["u"]))


def check_line(verdicts: Mapping[int, Verdict], regressor: str) -> str:
    """The same for the calibration that a log was flown with."""
    judged = [verdict for verdict in verdicts.values() if verdict.heading_error]
    if not judged:
        return "This log is too short to say how wrong your compass is."
    worst = max((row for verdict in judged for row in verdict.heading_error), key=_before)
    where = words.quantity(worst.u, regressor)
    who, verb = ("compasses", "are") if len(verdicts) > 1 else ("compass", "is")
    if all(verdict.grade is Grade.GOOD for verdict in verdicts.values()):
        leave = "Leave them as they are." if len(verdicts) > 1 else "Leave it as it is."
        now, most = words.degrees(worst.before), words.degrees(worst.p95)
        return f"Your {who} {verb} right: wrong by {now} at {where}, at most by {most}. {leave}"
    return (
        f"At {where} your {who} {verb} up to {words.degrees(worst.before)} wrong. "
        "Fit this log: magcomp fit."
    )


def _before(row: Any) -> float:
    return float(row.before)


def _where(document: Document, compass: Mapping[str, Any]) -> str:
    row = compass["quoted"]
    u = quantity_of(compass["regressor"]).in_sentence(row["u"])
    flies = compass["method"] == "flight" and document["vehicle"]["kind"] in _HOVERING
    return f"at hover ({u})" if row["hover"] and flies else f"at {u}"


def _write(document: Document, group: Sequence[Mapping[str, Any]], *, alone: bool) -> str:
    worst = max(group, key=lambda compass: float(compass["quoted"]["before"]))
    now = words.degrees(worst["quoted"]["before"])
    bound = words.degrees(max(compass["quoted"]["p95"] for compass in group))
    where = _where(document, worst)
    many = len(group) > 1
    who = ("your compasses" if many else "your compass") if alone else _named(group)
    verb = "are up to" if many else "is"
    doubt = any(compass["verdict"] == Grade.MARGINAL for compass in group)
    end = "Write them, with the doubt below in mind." if doubt else "Write them."
    found = f"{where[:1].upper()}{where[1:]} {who} {verb} {now} wrong."
    return f"{found} With these numbers: at most {bound}. {end}"


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
