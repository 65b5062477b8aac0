"""A fleet as one HTML file: the aircraft that need attention first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from markupsafe import Markup

from magcomp import __version__
from magcomp.fleet.aircraft import Aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.as_text import counted, largest_motor, summary
from magcomp.fleet.flights import Flight
from magcomp.fleet.history import Attention, CompassHistory, date, quantity
from magcomp.fleet.task import report_name
from magcomp.judge.thresholds import Thresholds
from magcomp.report import words
from magcomp.report.html_page import ASSETS
from magcomp.report.html_parts import DASH, badge, minus, sign, table, text

_GRADE = {Attention.NONE: "good", Attention.LOOK: "marginal", Attention.ACT: "rejected"}
_CALLED = {Attention.NONE: "in order", Attention.LOOK: "look at", Attention.ACT: "act now"}

MOST_CARDS = 100
MOST_ROWS = 5000
MOST_FLIGHTS = 20
"""What a page can hold and a person read; the rest is in the table that --table writes."""

_STYLE = """
body { max-width: 76rem; } .aircraft { border-left: 4px solid var(--rule); padding-left: 1rem; }
.aircraft.act { border-color: var(--rejected); } .aircraft.look { border-color: var(--marginal); }
.aircraft h3 .sign { margin-right: .4em; } .dots { width: 100%; max-width: 40rem; height: 7rem; }
.dots circle { fill: var(--accent); } .dots .bad { fill: var(--rejected); }
.dots .unsure { fill: none; stroke: var(--muted); }
.dots line { stroke: var(--rule); } .dots .limit { stroke: var(--good); stroke-dasharray: 4 3; }
.dots text { fill: var(--muted); font-size: 11px; } td { overflow-wrap: anywhere; }
"""


def html(fleet: Fleet, links: Mapping[str, str]) -> str:
    """The page.

    Parameters
    ----------
    fleet
        The answer.
    links
        Name of a log's report, without its suffix, to its address, for those that have one.
    """
    needing = [each for each in fleet.aircraft if each.attention is not Attention.NONE]
    body = "".join(
        [
            _head(fleet, needing),
            *(_card(each, number, links) for number, each in enumerate(needing[:MOST_CARDS])),
            _more(len(needing) - MOST_CARDS, "aircraft"),
            _all(fleet.aircraft, min(len(needing), MOST_CARDS)),
            _unusable(fleet.unusable),
            f'<p class="note">magcomp {text(__version__)}</p>',
        ]
    )
    style = (ASSETS / "report.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "style-src 'unsafe-inline'\">"
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>magcomp fleet</title><style>{style}{_STYLE}</style></head>"
        f"<body>{body}</body></html>\n"
    )


def _head(fleet: Fleet, needing: Sequence[Aircraft]) -> str:
    worst = max((each.attention for each in needing), default=Attention.NONE)
    act, look = (len(fleet.needing(each)) for each in (Attention.ACT, Attention.LOOK))
    said = (
        f"{counted(act, 'aircraft')} to act on now, {look} to look at"
        if needing
        else "No aircraft needs attention"
    )
    return (
        f'<header class="verdict {_GRADE[worst]}"><p class="overline">{text(summary(fleet))}</p>'
        f"<h1>{sign(_GRADE[worst])}<span>{said}</span></h1></header>"
    )


def _card(each: Aircraft, number: int, links: Mapping[str, str]) -> str:
    grade = _GRADE[each.attention]
    what = words.printable(f"{each.kind} {each.firmware}".strip())
    reasons = "".join(
        f"<li>{text(words.sentence(words.printable(one.text)))}</li>" for one in each.findings
    )
    known = {
        "board": "known by its board",
        "compasses": "known by its compasses only, which aircraft of one build share",
        "log": "one log that names neither board nor compasses",
    }[each.known_by]
    return (
        f'<section class="aircraft {each.attention.name.lower()}" id="a{number}">'
        f'<h3><span class="{grade}">{sign(grade)}</span>{text(words.printable(each.name))}</h3>'
        f'<p class="note">{text(what)}, {known}; '
        f"{counted(each.logs, 'log')}, newest {date(each.newest)}</p>"
        f'<ul class="reasons">{reasons}</ul>'
        f"{''.join(_compass(one, links) for one in each.compasses)}</section>"
    )


def _compass(one: CompassHistory, links: Mapping[str, str]) -> str:
    shown = list(enumerate(one.flights))[-MOST_FLIGHTS:]
    apart = dict(one.apart)
    rows = [_flight(flight, apart.get(index, ""), links) for index, flight in reversed(shown)]
    hidden = len(one.flights) - len(shown)
    note = f"the {len(shown)} newest of {len(one.flights)} flights" if hidden > 0 else "all flights"
    pooled = ""
    if one.pooled is not None and one.agree:
        std = [math.sqrt(one.pooled.covariance[i, i]) for i in range(3)]
        vector = ", ".join(
            words.with_std(-float(m), s) for m, s in zip(one.pooled.motor, std, strict=True)
        )
        unit = words.interference_title(one.regressor)
        pooled = (
            f"<p>{one.pooled.count} flights together: {unit}: {minus(vector)} (forward, right, "
            f"down), scattering by {words.number(one.pooled.scatter)} from flight to flight</p>"
        )
    head = ("flight", "log", "verdict", "error in force", "fitted, 95 %", "up to", "remarks")
    return (
        f"<details><summary>Compass {one.compass}: "
        f"{counted(len(one.flights), 'flight')}</summary>{pooled}"
        f"{_dots(one.flights)}{table(head, rows, f'Compass {one.compass}, {note}', 'numbers')}"
        "</details>"
    )


def _flight(flight: Flight, apart: str, links: Mapping[str, str]) -> Sequence[str]:
    name = text(words.printable(flight.path))
    link = links.get(report_name(flight.digest).removesuffix(".html"))
    return (
        date(flight.when),
        Markup('<a href="{}">{}</a>').format(link, name) if link else name,
        badge(flight.verdict),
        _degrees(flight.before_deg),
        _degrees(flight.bound_deg),
        text(quantity(flight.u_high, flight.regressor)),
        text(words.printable(apart or flight.reasons.partition("\n")[0])),
    )


def _dots(flights: Sequence[Flight]) -> str:
    """Heading error in force against time, a dot a flight."""
    drawn = [f for f in flights if math.isfinite(f.before_deg) and math.isfinite(f.when)]
    if len(drawn) < 2:
        return ""
    first, last = drawn[0].when, drawn[-1].when
    limits = Thresholds()
    top = max(limits.marginal_deg, max(f.before_deg for f in drawn if f.verdict != "rejected")
              if any(f.verdict != "rejected" for f in drawn) else 0.0)  # fmt: skip
    parts = []
    for flight in drawn:
        x = 40 + 590 * ((flight.when - first) / (last - first) if last > first else 0.5)
        y = 90 - 80 * min(flight.before_deg / top, 1.0)
        kind = "bad" if flight.before_deg > limits.marginal_deg else ""
        kind = "unsure" if flight.verdict == "rejected" else kind
        title = f"{date(flight.when)}: {flight.before_deg:.1f}°"
        parts.append(
            f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="3.5"><title>{title}</title>'
            "</circle>"
        )
    limit = 90 - 80 * limits.good_deg / top
    return (
        '<svg class="dots" viewBox="0 0 640 110" role="img" aria-label="heading error in force by '
        'flight"><line x1="40" y1="90" x2="630" y2="90"/>'
        f'<line class="limit" x1="40" y1="{limit:.1f}" x2="630" y2="{limit:.1f}"/>'
        f'<text x="0" y="14">{top:.0f}°</text><text x="0" y="{limit + 4:.1f}">'
        f'{limits.good_deg:g}°</text><text x="40" y="106">{date(first)}</text>'
        f'<text x="630" y="106" text-anchor="end">{date(last)}</text>{"".join(parts)}</svg>'
        '<p class="note">Heading error of the calibration in force, a dot a flight; hollow where '
        "the flight's fit is not to be trusted.</p>"
    )


def _all(aircraft: Sequence[Aircraft], cards: int) -> str:
    if not aircraft:
        return ""
    head = ("aircraft", "", "logs", "newest", "error in force", "motors add at most")
    rows = [
        (
            _anchored(each, number if number < cards else None),
            Markup('<span class="{}">{}</span>').format(
                _GRADE[each.attention], _CALLED[each.attention]
            ),
            str(each.logs),
            date(each.newest),
            _degrees(each.before_deg),
            minus(text(largest_motor(each))),
        )
        for number, each in enumerate(aircraft[:MOST_ROWS])
    ]
    title = "Of every aircraft the newest flight, the worst of its compasses"
    return (
        f"<h2>All aircraft</h2>{table(head, rows, title, 'numbers')}"
        f"{_more(len(aircraft) - MOST_ROWS, 'aircraft')}"
    )


def _anchored(each: Aircraft, number: int | None) -> str:
    name = text(words.printable(each.name))
    return name if number is None else Markup('<a href="#a{}">{}</a>').format(number, name)


def _unusable(flights: Sequence[Flight]) -> str:
    if not flights:
        return ""
    rows: Iterator[Sequence[str]] = (
        (text(words.printable(f.path)), text(words.sentence(words.printable(f.why))))
        for f in flights[:MOST_ROWS]
    )
    return (
        f"<h2>Logs without a fit</h2>{_table(rows, len(flights))}"
        f"{_more(len(flights) - MOST_ROWS, 'log')}"
    )


def _table(rows: Iterable[Sequence[str]], count: int) -> str:
    return table(("log", "why"), rows, f"{counted(count, 'log')} that gave no answer")


def _more(count: int, what: str) -> str:
    return f'<p class="note">and {counted(count, f"more {what}")}.</p>' if count > 0 else ""


def _degrees(value: float) -> str:
    return f"{value:.1f}°" if math.isfinite(value) else DASH
