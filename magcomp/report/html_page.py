"""A page with pictures as one HTML file that needs nothing else: no network, no other file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files

from magcomp.report.figure import Figure
from magcomp.report.html_parts import text

ASSETS = files("magcomp.report") / "assets"


def canvas(name: str, figure: Figure) -> str:
    """Where a picture is drawn, with its title and caption.

    Parameters
    ----------
    name
        Unique on the page, and the figure's name in :func:`page`.
    figure
        The picture.
    """
    wide = " wide" if figure.wide else ""
    return (
        f'<figure class="plot{wide}"><h4>{text(figure.title)}</h4>'
        f'<div class="canvas" id="{name}" style="height:{figure.height}px" role="img" '
        f'aria-label="{text(figure.title)}: {text(figure.caption)}"></div>'
        f"<figcaption>{text(figure.caption)}</figcaption></figure>"
    )


def page(title: str, body: str, source: str, pictures: Mapping[str, Figure]) -> str:
    """The whole file.

    Parameters
    ----------
    title
        Of the window.
    body
        HTML, with a :func:`canvas` for each picture.
    source
        The JSON document whose numbers the page shows.
    pictures
        By the name of their canvas.
    """
    # plotly is only a carrier of its script here, and slow to import.
    from plotly.offline import get_plotlyjs  # noqa: PLC0415

    style, script = (
        (ASSETS / name).read_text(encoding="utf-8") for name in ("report.css", "report.js")
    )
    drawn = {
        name: {"data": figure.data, "layout": figure.layout} for name, figure in pictures.items()
    }
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        # The page must work offline, so the browser is told to refuse everything from elsewhere.
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "style-src 'unsafe-inline'; script-src 'unsafe-inline' 'unsafe-eval'; "
        'img-src data: blob:">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{text(title)}</title><style>{style}</style></head>"
        f'<body>{body}<noscript><p class="note">The pictures need JavaScript; every number is in '
        "the tables.</p></noscript>"
        f'<script type="application/json" id="result">{_inert(source)}</script>'
        f'<script type="application/json" id="figures">{_inert(_compact(drawn))}</script>'
        f"<script>{get_plotlyjs()}</script><script>{script}</script></body></html>\n"
    )


def _compact(pictures: Mapping[str, object]) -> str:
    return json.dumps(pictures, separators=(",", ":"), allow_nan=False)


def _inert(content: str) -> str:
    """JSON that cannot end the script element it stands in."""
    return content.replace("<", "\\u003c")
