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
from magcomp.report.figure import Figure, Quantity, quantity_of
from magcomp.report.figures import figures
from magcomp.report.html_page import page
from magcomp.report.html_parts import Numbers, templates
from magcomp.writing.files import format_parameters

_EVIDENCE = ("shift", "strength", "residuals")

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
    grade = numbers.document["verdict"]
    body = (
        templates()
        .get_template("report.html.j2")
        .render(
            grade=grade,
            source=analysis.source,
            duration=words.duration(analysis.duration_s),
            lines=plain.pilots_lines(numbers.document),
            cards=html_tables.cards(numbers),
            steps=advice.steps(numbers.document, options),
            download=_download(analysis),
            panels=[
                _panel(numbers, index, of, pictures, present)
                for index, (of, pictures) in enumerate(zip(plots, drawn, strict=True))
            ],
            evidence=_EVIDENCE,
            vehicle=html_tables.vehicle(numbers, recording),
            quality=html_tables.quality(recording),
            notes=numbers.at("notes"),
            versions=f"magcomp {__version__}, numpy {np.__version__}, "
            f"Python {platform.python_version()}",
        )
    )
    return _page(f"magcomp report: {analysis.source}", body, source, drawn)


def _download(analysis: Analysis) -> dict[str, Any] | None:
    """The parameter file itself, inside the page, unless nothing should be written."""
    chosen = parameter_set(analysis)
    if analysis.grade is Grade.REJECTED or not chosen.values:
        return None
    content = base64.b64encode(format_parameters(chosen, ".param").encode()).decode()
    return {"content": content, "count": len(chosen.values)}


def _panel(
    numbers: Numbers,
    index: int,
    plots: CompassPlots,
    pictures: Sequence[Figure],
    present: Mapping[str, float],
) -> dict[str, Any]:
    """What the template shows of one compass."""
    compass = numbers.at("compasses", index)
    quantity = quantity_of(compass["regressor"])
    return {
        "number": compass["compass"],
        "grade": compass["verdict"],
        "reasons": plain.doubts(compass["reasons"], compass["verdict"]),
        "figures": {figure.name: figure for figure in pictures},
        "heading_errors": html_tables.heading_errors(numbers, index, quantity),
        "parameters": html_tables.parameters(numbers, index, present),
        "findings": html_tables.findings(numbers, index, quantity),
        "coverage": html_tables.coverage(numbers, index, plots, quantity),
        "method": _METHODS.get(compass["method"], compass["method"]),
        "why": compass["why"],
        "quantity": quantity.name,
        **_slider(compass, quantity),
        "origin": compass["origin"],
        "count": compass["count"],
    }


def _slider(compass: Mapping[str, Any], quantity: Quantity) -> dict[str, Any]:
    """From rest to the end of the table of heading errors, in the unit that is shown."""
    most = quantity.scale * max(row["u"] for row in plain.table_rows(compass))
    return {
        "most": f"{most:.0f}",
        "step": f"{max(most / 100, 0.5):g}",
        "quoted": f"{quantity.scale * compass['quoted']['u']:.1f}",
        "unit": quantity.unit,
        "scale": f"{quantity.scale:g}",
    }


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
