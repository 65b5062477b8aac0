"""An analysis as one HTML file that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
import json
import platform
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from magcomp import __version__
from magcomp.analysis import Options, parameter_set
from magcomp.model import Analysis, Grade, Recording
from magcomp.report import advice, as_json, html_tables, plain, words
from magcomp.report.evidence import CompassPlots, compass_plots
from magcomp.report.figure import Figure, quantity_of
from magcomp.report.figures import figures
from magcomp.report.html_page import ASSETS, canvas, page
from magcomp.report.html_parts import Numbers, badge, sign, text, with_code
from magcomp.writing.files import format_parameters

_EVIDENCE = ("cloud", "centres", "shift", "strength", "residuals")

_METHODS = {
    "sweep": "sweep (the vehicle stood still while the motors worked)",
    "levels": "levels (turns at steady control quantities, the paper’s method)",
    "flight": "flight (an ordinary flight, or turning by hand)",
}


def html(
    recording: Recording,
    analysis: Analysis,
    *,
    options: Options | None = None,
    written: str | None = None,
) -> str:
    """The page.

    Parameters
    ----------
    recording, analysis
        What was analysed, and the answer.
    options
        What was asked for; the part of the recording that is drawn follows from it.
    written
        The parameter file the answer went to, if any.

    Raises
    ------
    MissingDataError
        Where the recording is not the one that was analysed.
    """
    wanted = Options() if options is None else options
    source = as_json.dumps(as_json.analysis_object(analysis, written))
    numbers = Numbers(json.loads(source))
    plots = [
        compass_plots(recording, result, start=wanted.start, end=wanted.end)
        for result in analysis.compasses
    ]
    drawn = [figures(result, of) for result, of in zip(analysis.compasses, plots, strict=True)]
    present = {name: recording.parameters.last(name, np.nan) for name in recording.parameters.names}
    panels = [
        _panel(numbers, index, of, pictures, present)
        for index, (of, pictures) in enumerate(zip(plots, drawn, strict=True))
    ]
    body = "".join(
        [
            _head(numbers, analysis, options),
            _compasses(numbers, panels),
            f"<section><h2>The vehicle</h2>{html_tables.vehicle(numbers, recording)}</section>",
            f"<section><h2>The recording</h2>{html_tables.quality(recording)}"
            f"{_notes(numbers.at('notes'))}</section>",
            _computed(),
        ]
    )
    return _page(f"magcomp report: {analysis.source}", body, source, drawn)


def _head(numbers: Numbers, analysis: Analysis, options: Options | None) -> str:
    """Verdict first, then what to do, then the compasses at a glance."""
    document = numbers.document
    grade = document["verdict"]
    first, *others = plain.pilots_lines(document)
    more = "".join(f'<p class="more">{text(line)}</p>' for line in others)
    steps = "".join(f"<li>{with_code(step)}</li>" for step in advice.steps(document, options))
    return (
        f'<header class="verdict {grade}">'
        f'<p class="overline">Compass and motors · {text(analysis.source)} · '
        f"{text(words.duration(analysis.duration_s))}</p>"
        f"<h1>{sign(grade)}<span>{text(first)}</span></h1>{more}</header>"
        f"<main>{html_tables.overview(numbers)}"
        f'<section class="steps"><h2>What to do</h2><ol>{steps}</ol>{_download(analysis)}</section>'
    )


def _download(analysis: Analysis) -> str:
    """The parameter file itself, inside the page, unless nothing should be written."""
    chosen = parameter_set(analysis)
    if analysis.grade is Grade.REJECTED or not chosen.values:
        return ""
    content = base64.b64encode(format_parameters(chosen, ".param").encode()).decode()
    return (
        f'<p class="screen"><a class="button" download="compass.param" '
        f'href="data:text/plain;base64,{content}">Save the parameter file</a> '
        f"<small>{len(chosen.values)} parameters, for Mission Planner and others</small></p>"
    )


def _compasses(numbers: Numbers, panels: Sequence[str]) -> str:
    """A tab a compass; one after the other where there are no scripts, and in print."""
    compasses = numbers.at("compasses")
    tabs = "".join(
        f'<button type="button" role="tab" id="tab-{c["compass"]}" '
        f'aria-controls="compass-{c["compass"]}">{sign(c["verdict"])}Compass {c["compass"]}'
        f"</button>"
        for c in compasses
    )
    strip = f'<div class="tabs" role="tablist" aria-label="Compass">{tabs}</div>'
    return (strip if len(compasses) > 1 else "") + "".join(panels)


def _panel(
    numbers: Numbers,
    index: int,
    plots: CompassPlots,
    pictures: Sequence[Figure],
    present: Mapping[str, float],
) -> str:
    compass = numbers.at("compasses", index)
    number = compass["compass"]
    quantity = quantity_of(compass["regressor"])
    shown = {figure.name: _figure(figure, number) for figure in pictures}
    reasons = "".join(f"<li>{text(words.sentence(r))}</li>" for r in compass["reasons"])
    method = _METHODS.get(compass["method"], compass["method"])
    return (
        f'<section class="panel" role="tabpanel" id="compass-{number}" '
        f'aria-labelledby="tab-{number}"><h2>Compass {number}{badge(compass["verdict"])}</h2>'
        f'<ul class="reasons">{reasons}</ul>'
        f'<h3>Heading error</h3><div class="beside wider">{shown["heading"]}'
        f"{html_tables.heading_errors(numbers, index, quantity)}</div>"
        f'<div class="beside"><div><h3>Parameters, old and new</h3>'
        f"{html_tables.parameters(numbers, index, present)}</div><div><h3>What was found</h3>"
        f"{html_tables.findings(numbers, index, quantity)}</div></div>"
        f'<h3>The evidence</h3><div class="figures">'
        f"{''.join(shown[name] for name in _EVIDENCE)}</div>"
        f"<h3>What the log covers</h3>{html_tables.coverage(numbers, index, plots, quantity)}"
        f'<div class="figures">{shown["sphere"]}{shown["turn"]}</div>'
        f'<p class="note">Method: {text(method)}, because {text(compass["why"])}; '
        f"{text(quantity.name)} from {text(compass['origin'])}; "
        f"{compass['count']} readings.</p></section>"
    )


def _figure(figure: Figure, compass: int) -> str:
    return canvas(f"{figure.name}-{compass}", figure)


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    items = "".join(f"<li>{text(words.sentence(note))}</li>" for note in notes)
    return f'<ul class="reasons">{items}</ul>'


def _computed() -> str:
    versions = f"magcomp {__version__}, numpy {np.__version__}, Python {platform.python_version()}"
    content = (ASSETS / "computed.html").read_text(encoding="utf-8")
    return (
        f"<details><summary>How this was computed</summary>{content}"
        f"<p>Made by {text(versions)}.</p></details></main>"
    )


def _page(title: str, body: str, source: str, drawn: Sequence[Sequence[Figure]]) -> str:
    pictures = {
        f"{figure.name}-{index}": figure
        for index, of in _numbered(json.loads(source), drawn)
        for figure in of
    }
    return page(title, body, source, pictures)


def _numbered(
    document: Mapping[str, Any], drawn: Sequence[Sequence[Figure]]
) -> list[tuple[int, Sequence[Figure]]]:
    numbers = [compass["compass"] for compass in document["compasses"]]
    return list(zip(numbers, drawn, strict=True))
