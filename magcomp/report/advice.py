"""What to do next, step by step, from the JSON form."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from magcomp import autopilots
from magcomp.analysis import Options
from magcomp.report import plain, words
from magcomp.report.roles import WRITE_IT, roles

GRADES = ("good", "marginal", "rejected")

Document = Mapping[str, Any]


def by_grade(document: Document) -> dict[str, list[int]]:
    """Compass numbers of each grade that occurs, best grade first."""
    found = {
        grade: [c["compass"] for c in document["compasses"] if c["verdict"] == grade]
        for grade in GRADES
    }
    return {grade: numbers for grade, numbers in found.items() if numbers}


def steps(document: Document, options: Options | None = None) -> tuple[str, ...]:
    """What to do, in order; what stands between backticks is typed as it is.

    Parameters
    ----------
    document
        From :func:`magcomp.report.as_json.analysis_object`.
    options
        What was asked for, so that the command named here gives the same answer.
    """
    grades = by_grade(document)
    if document["only_to_look_at"]:
        return (f"Write nothing: {document['only_to_look_at']}.",)
    kept = [number for grade in GRADES[:2] for number in grades.get(grade, ())]
    if not kept:
        return (
            *(_doubt(c, "") for c in document["compasses"]),
            "Mend what the verdict names, record again, and make a new report of the new log.",
        )
    if plain.WRITE not in map(plain.answer_of, document["compasses"]):
        return (
            "Leave the calibration as it is: this log shows nothing better.",
            *_each(document),
            *(_doubt(c, "") for c in document["compasses"] if c["verdict"] == "rejected"),
        )
    switch = autopilots.named(document["vehicle"]["autopilot"]).switch
    every = list(_each(document, apart_from=WRITE_IT))
    leads = 1 if every and any(role.leads for role in roles(document)) else 0
    found = [*every[:leads], _write(document, sorted(kept), options), *every[leads:]]
    for compass in document["compasses"]:
        if compass["verdict"] == "marginal":
            found.append(_doubt(compass, "Until a better log says otherwise, fly with care"))
        elif compass["verdict"] == "rejected":
            found.append(_doubt(compass, _left(compass, switch)))
    found.append(
        "Fly once more, gently, and run `magcomp check` on the new log: the heading error it "
        "finds should be what this report promises."
    )
    return tuple(found)


def _each(document: Document, apart_from: str = "") -> Iterator[str]:
    """What to do with each compass where there are several, first with the one flown on.

    Of the others it is not said where it is just what another step says for all.
    """
    every = roles(document)
    if len(every) > 1:
        for role in every:
            if role.action == apart_from and not role.leads:
                continue
            use = f", {role.use}" if role.use else ""
            who = f"Your vehicle flies on compass {role.compass}"
            yield f"{who if role.leads else f'Compass {role.compass}{use}'}: {role.action}."


def _write(document: Document, kept: list[int], options: Options | None) -> str:
    where = document.get("written")
    how = (
        f"they are in `{where}`"
        if where
        else f"`{_command(document, options)}` writes them to a file"
    )
    return (
        f"Disarm, then write the parameters of {words.compasses(kept)} with your ground station; "
        f"{how}. They belong to this vehicle only."
    )


def _command(document: Document, options: Options | None) -> str:
    asked = {} if options is None else asdict(options)
    usual = asdict(Options())
    given = [f"--{name} {value}" for name, value in asked.items() if value != usual[name]]
    file = f"compass{autopilots.named(document['vehicle']['autopilot']).parameter_file}"
    return " ".join(["magcomp fit", shlex.quote(document["source"]), *given, f"-o {file}"])


def _left(compass: Mapping[str, Any], switch: str) -> str:
    if compass["parameters"]:
        return (
            "It gets no correction: its motor vector must be zero, because one switch, "
            f"{switch}, serves all compasses"
        )
    return "It is left as it is"


def _doubt(compass: Mapping[str, Any], then: str) -> str:
    why = words.sentence(compass["reasons"][0]) if compass["reasons"] else ""
    return f"Compass {compass['compass']}: {why} {words.sentence(then) if then else ''}".strip()
