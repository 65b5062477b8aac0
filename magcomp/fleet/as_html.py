"""A fleet as one HTML file: the aircraft that need attention first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from magcomp import __version__
from magcomp.fleet.aircraft import Aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.as_text import counted, largest_motor, summary
from magcomp.fleet.findings import Attention, date, quantity, texts
from magcomp.fleet.flights import Flight
from magcomp.fleet.history import CompassHistory
from magcomp.fleet.task import report_name
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Grade
from magcomp.report import words
from magcomp.report.html_page import asset
from magcomp.report.html_parts import DASH, badge, minus, templates

_GRADE = {Attention.NONE: "good", Attention.LOOK: "marginal", Attention.ACT: "rejected"}
_CALLED = {Attention.NONE: "in order", Attention.LOOK: "look at", Attention.ACT: "act now"}

MOST_CARDS = 100
MOST_ROWS = 5000
MOST_FLIGHTS = 20
"""What a page can hold and a person read; the rest is in the table that --table writes."""

_KNOWN_BY = {
    "board": "known by its board",
    "compasses": "known by its compasses only, which aircraft of one build share",
    "log": "one log that names neither board nor compasses",
}

_FLIGHT_HEAD = ("flight", "log", "verdict", "error in force", "fitted, 95 %", "up to", "remarks")
_AIRCRAFT_HEAD = ("aircraft", "state", "logs", "newest", "error in force", "motors add, mGauss")


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
    worst = max((each.attention for each in needing), default=Attention.NONE)
    return (
        templates("magcomp.fleet")
        .get_template("fleet.html.j2")
        .render(
            title="magcomp fleet",
            style=asset("report.css"),
            grade=_GRADE[worst],
            summary=summary(fleet),
            said=_said(fleet),
            needing=[_aircraft(each, links) for each in needing[:MOST_CARDS]],
            more_needing=_more(len(needing) - MOST_CARDS, "aircraft"),
            aircraft=_all(fleet.aircraft, min(len(needing), MOST_CARDS)),
            unusable=_unusable(fleet.unusable),
            version=__version__,
        )
    )


def _said(fleet: Fleet) -> str:
    act, look = (len(fleet.needing(each)) for each in (Attention.ACT, Attention.LOOK))
    if not act and not look:
        return "No aircraft needs attention"
    return f"{counted(act, 'aircraft')} to act on now, {look} to look at"


def _aircraft(each: Aircraft, links: Mapping[str, str]) -> dict[str, Any]:
    return {
        "attention": each.attention.name.lower(),
        "grade": _GRADE[each.attention],
        "name": words.printable(each.name),
        "what": words.printable(f"{each.kind} {each.firmware}".strip()),
        "known": _KNOWN_BY[each.known_by],
        "logs": counted(each.logs, "log"),
        "newest": date(each.newest),
        "findings": [words.printable(text) for text in texts(each.findings)],
        "compasses": [_compass(one, links) for one in each.compasses],
    }


def _compass(one: CompassHistory, links: Mapping[str, str]) -> dict[str, Any]:
    shown = list(enumerate(one.flights))[-MOST_FLIGHTS:]
    apart = dict(one.apart)
    hidden = len(one.flights) - len(shown)
    note = f"the {len(shown)} newest of {len(one.flights)} flights" if hidden > 0 else "all flights"
    return {
        "number": one.compass,
        "count": counted(len(one.flights), "flight"),
        "pooled": _pooled(one),
        "dots": _dots(one.flights),
        "head": _FLIGHT_HEAD,
        "rows": [_flight(flight, apart.get(k, ""), links) for k, flight in reversed(shown)],
        "caption": f"Compass {one.compass}, {note}",
    }


def _pooled(one: CompassHistory) -> str:
    if one.pooled is None or not one.agree:
        return ""
    std = [math.sqrt(one.pooled.covariance[i, i]) for i in range(3)]
    vector = ", ".join(
        words.with_std(-float(m), s) for m, s in zip(one.pooled.motor, std, strict=True)
    )
    unit = words.interference_title(one.regressor)
    return (
        f"{one.pooled.count} flights together: {unit}: {minus(vector)} (forward, right, down), "
        f"scattering by {words.number(one.pooled.scatter)} from flight to flight"
    )


def _flight(flight: Flight, apart: str, links: Mapping[str, str]) -> Sequence[str]:
    name = words.printable(flight.path)
    link = links.get(report_name(flight.digest).removesuffix(".html"))
    return (
        date(flight.when),
        _link(link, name) if link else name,
        badge(flight.verdict),
        _degrees(flight.before_deg),
        _degrees(flight.bound_deg),
        quantity(flight.u_high, flight.regressor),
        words.printable(apart or flight.reasons.partition("\n")[0]),
    )


def _link(address: str, name: str) -> Markup:
    return Markup('<a href="{}">{}</a>').format(address, name)


def _dots(flights: Sequence[Flight]) -> dict[str, Any] | None:
    """Heading error in force against time, a dot a flight, in the units of the template's svg."""
    drawn = [f for f in flights if math.isfinite(f.before_deg) and math.isfinite(f.when)]
    if len(drawn) < 2:
        return None
    first, last = drawn[0].when, drawn[-1].when
    limits = Thresholds()
    trusted = [flight.before_deg for flight in drawn if flight.verdict != Grade.REJECTED]
    top = max(limits.marginal_deg, *trusted, 0.0)
    return {
        "dots": [
            {
                "kind": _dot_kind(flight, limits),
                "x": f"{40 + 590 * ((flight.when - first) / max(last - first, 1e-9)):.1f}",
                "y": _height(flight.before_deg, top),
                "title": f"{date(flight.when)}: {flight.before_deg:.1f}°",
            }
            for flight in drawn
        ],
        "limit": {"y": _height(limits.good_deg, top), "text": f"{limits.good_deg:g}°"},
        "top": f"{top:.0f}°",
        "first": date(first),
        "last": date(last),
    }


def _dot_kind(flight: Flight, limits: Thresholds) -> str:
    if flight.verdict == Grade.REJECTED:
        return "unsure"
    return "bad" if flight.before_deg > limits.marginal_deg else ""


def _height(degrees: float, top: float) -> str:
    return f"{90 - 80 * min(degrees / top, 1.0):.1f}"


def _all(aircraft: Sequence[Aircraft], cards: int) -> dict[str, Any]:
    rows = [
        (
            _anchored(words.printable(each.name), number, cards),
            _state(each.attention),
            str(each.logs),
            date(each.newest),
            _degrees(each.before_deg),
            minus(largest_motor(each)),
        )
        for number, each in enumerate(aircraft[:MOST_ROWS])
    ]
    return {
        "head": _AIRCRAFT_HEAD,
        "rows": rows,
        "more": _more(len(aircraft) - MOST_ROWS, "aircraft"),
    }


def _anchored(name: str, number: int, cards: int) -> str:
    return _link(f"#a{number}", name) if number < cards else name


def _state(attention: Attention) -> Markup:
    return Markup('<span class="{}">{}</span>').format(_GRADE[attention], _CALLED[attention])


def _unusable(flights: Sequence[Flight]) -> dict[str, Any]:
    return {
        "rows": [
            (words.printable(flight.path), words.sentence(words.printable(flight.why)))
            for flight in flights[:MOST_ROWS]
        ],
        "caption": f"{counted(len(flights), 'log')} that gave no answer",
        "more": _more(len(flights) - MOST_ROWS, "log"),
    }


def _more(count: int, what: str) -> str:
    return counted(count, f"more {what}") if count > 0 else ""


def _degrees(value: float) -> str:
    return f"{value:.1f}°" if math.isfinite(value) else DASH
