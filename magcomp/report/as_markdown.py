"""An analysis as Markdown: for an issue tracker, a forum, a notebook."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from magcomp.analysis import Options
from magcomp.report import advice, plain, words
from magcomp.report.figure import Quantity, quantity_of

_SPECIAL = str.maketrans({sign: f"\\{sign}" for sign in "\\`*_{}[]<>#|"})


def markdown(
    document: Mapping[str, Any], present: Mapping[str, float], options: Options | None = None
) -> str:
    """The report as Markdown.

    Parameters
    ----------
    document
        From :func:`magcomp.report.as_json.analysis_object`, read back from its text.
    present
        Parameters as the recording left them, for the difference.
    options
        What was asked for.
    """
    first, *others = plain.pilots_lines(document)
    lines = [
        f"# {_plain(first)}",
        *(f"\n{_plain(line)}" for line in others),
        "",
        f"{_plain(document['source'])}, {words.duration(document['duration_s'])}, "
        f"{_vehicle(document['vehicle'])}; magcomp {document['magcomp']}.",
        "",
        "## What to do",
        "",
        *(
            f"{number}. {_with_code(step)}"
            for number, step in enumerate(advice.steps(document, options), 1)
        ),
    ]
    for compass in document["compasses"]:
        lines += ["", *_compass(compass, present)]
    if document["notes"]:
        lines += ["", "## The recording", ""]
        lines += [f"- {_plain(words.sentence(note))}" for note in document["notes"]]
    return "\n".join(lines) + "\n"


def _compass(compass: Mapping[str, Any], present: Mapping[str, float]) -> Iterator[str]:
    quantity = quantity_of(compass["regressor"])
    yield f"## Compass {compass['compass']}: {compass['verdict']}"
    yield ""
    told = plain.doubts(compass["reasons"], compass["verdict"])
    for reason in told:
        yield f"- {_plain(words.sentence(reason))}"
    if told:
        yield ""
    yield from _table(
        [quantity.title, "in force (°)", "fit, expected (°)", "fit, 95 % bound (°)"],
        [
            [
                _load(row, compass["coverage"], quantity),
                f"≤ {row['p95']:.1f}" if plain.is_no_better(row) else f"{row['before']:.1f}",
                f"{row['after']:.2f}",
                f"{row['p95']:.2f}",
            ]
            for row in plain.table_rows(compass)
        ],
    )
    yield ""
    yield "In brackets: reckoned, not flown. ≤: no better known than that."
    yield ""
    if compass["parameters"]:
        yield from _table(
            ["parameter", "in the log", "new"],
            [
                [f"`{name}`", _old(present, name), words.parameter(value)]
                for name, value in compass["parameters"].items()
            ],
        )
        yield ""
    yield from _found(compass, quantity)


def _load(row: Mapping[str, float], covered: Mapping[str, float], quantity: Quantity) -> str:
    """A control quantity; in brackets where it was not flown."""
    u = f"{row['u'] * quantity.scale:.0f}"
    return u if words.is_flown(row["u"], covered["u_low"], covered["u_high"]) else f"({u})"


def _old(present: Mapping[str, float], name: str) -> str:
    return words.parameter(present[name]) if name in present else "not in the log"


def _found(compass: Mapping[str, Any], quantity: Quantity) -> Iterator[str]:
    residual, coverage = compass["field_residual_mgauss"], compass["coverage"]
    parts = ", ".join(
        f"{axis} {words.with_std(value, std)}"
        for axis, value, std in zip(
            words.AXES, compass["interference_mgauss"], compass["std_mgauss"], strict=True
        )
    )
    per = "per A" if quantity.scale == 1.0 else "at full throttle"
    yield f"- Interference: {parts} mGauss {per}"
    for which, name in (
        ("field", "Field behind attitude"),
        ("regressor", f"{quantity.name.capitalize()} against field"),
    ):
        value, std = compass["lag_s"][which], compass["lag_std_s"][which]
        if value is not None:
            doubt = "" if std is None else f" ± {1000 * std:.0f}"
            yield f"- {name}: {1000 * value:.0f}{doubt} ms"
    yield (
        f"- Unexplained field: {residual['before']:.1f} mGauss in force, {residual['after']:.1f} "
        f"with the fit; on data the fit did not see {residual['held_out_before']:.1f} and "
        f"{residual['held_out']:.1f}"
    )
    yield (
        f"- Covered: {coverage['u_low'] * quantity.scale:.0f} to "
        f"{coverage['u_high'] * quantity.scale:.0f} {quantity.unit}, "
        f"{coverage['heading'] * 100:.0f} % of a turn, {coverage['sphere'] * 100:.0f} % of the "
        f"sphere, tilt up to {coverage['tilt_deg']:.0f}°, {coverage['seconds']:.0f} s"
    )
    yield (
        f"- Method: {compass['method']}, because {_plain(compass['why'])}; {quantity.name} from "
        f"{_plain(compass['origin'])}; {compass['count']} readings"
    )


def _vehicle(vehicle: Mapping[str, Any]) -> str:
    ids = ", ".join(map(str, vehicle["device_ids"])) or "not in the log"
    kind = " ".join(filter(None, (vehicle["autopilot"], vehicle["kind"], vehicle["firmware"])))
    return f"{_plain(kind)}, system {vehicle['system']}, compass device ids {ids}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|---|" + "---:|" * (len(head) - 1)
    for row in rows:
        yield f"| {' | '.join(row)} |"


def _with_code(text: str) -> str:
    """Text of which only what stands between backticks is Markdown."""
    parts = text.split("`")
    return "`".join(
        words.printable(part) if k % 2 else _plain(part) for k, part in enumerate(parts)
    )


def _plain(text: str) -> str:
    """Text without meaning to Markdown, on one line whatever a log said in it."""
    return words.printable(text).translate(_SPECIAL)
