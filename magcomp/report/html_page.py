"""A page with pictures as one HTML file that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from magcomp.report.figure import Figure
from magcomp.report.html_parts import templates


@cache
def asset(name: str) -> str:
    """The style or the script of every page."""
    return (files("magcomp.report") / "assets" / name).read_text(encoding="utf-8")


def page(title: str, body: str, source: str, pictures: Mapping[str, Figure]) -> str:
    """The whole file.

    Parameters
    ----------
    title
        Of the window.
    body
        HTML, with the template's ``figure`` for each picture.
    source
        The JSON document whose numbers the page shows.
    pictures
        By the name of their canvas.
    """
    drawn = {
        name: {"data": each.data, "layout": each.layout, "play": each.play}
        for name, each in pictures.items()
    }
    return (
        templates()
        .get_template("page.html.j2")
        .render(
            title=title,
            style=asset("report.css"),
            script=asset("report.js"),
            body=body,
            source=_inert(source),
            figures=_inert(json.dumps(drawn, separators=(",", ":"), allow_nan=False)),
            plotly=_plotly(),
        )
    )


@cache
def _plotly() -> str:
    """The script of plotly, packed: four megabytes and a half become less than two."""
    # plotly is only a carrier of its script here, and slow to import.
    from plotly.offline import get_plotlyjs  # noqa: PLC0415

    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), mtime=0)).decode()


def _inert(content: str) -> str:
    """JSON that cannot end the script element it stands in."""
    return content.replace("<", "\\u003c")
