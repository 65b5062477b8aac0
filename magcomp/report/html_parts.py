"""Small pieces of HTML: escaped text, numbers that name their place in the JSON, tables.

Everything here comes from templates that escape what they are given; what is HTML already is
:class:`~markupsafe.Markup` and stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from magcomp.report import words

Key = tuple[str | int, ...]

DASH = "–"


_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""What steers a screen or turns the direction of writing; not the tab and the line feed."""


def _without_control(value: Any) -> Any:
    """What a template prints, without what a log may have said to steer the screen."""
    if not isinstance(value, str) or not _CONTROL.search(value):
        return value
    return type(value)(_CONTROL.sub("?", value))


@cache
def templates(package: str = "magcomp.report") -> Environment:
    """The templates of a package, and with them those that all pages are made of."""
    packages = dict.fromkeys((package, "magcomp.report"))
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(each) for each in packages]),
        autoescape=True,
        finalize=_without_control,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"code": with_code, "sentence": words.sentence}
    return environment


@cache
def _macros() -> Any:
    return templates().get_template("parts.html.j2").module


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers of a JSON document as the page shows them.

    Every number becomes a ``data`` element whose value is the number itself and whose
    ``data-key`` is its place in the document, so that what is shown cannot differ from it.
    """

    document: Mapping[str, Any]

    def at(self, *key: str | int) -> Any:
        """The value at a place in the document."""
        value: Any = self.document
        for step in key:
            value = value[step]
        return value

    def show(self, *key: str | int, decimals: int | None = None, scale: float = 1.0) -> Markup:
        """A number to some decimals; as precise as a parameter needs where none are given."""
        value = self.at(*key)
        if value is None:
            return escape(DASH)
        shown = value * scale
        words_ = words.parameter(shown) if decimals is None else f"{shown:.{decimals}f}"
        scaled = "" if scale == 1.0 else f"{scale:g}"
        return part("number", repr(value), ".".join(map(str, key)), scaled, minus(words_))


def minus(text: str) -> str:
    """A number's text with a true minus sign."""
    return text.replace("-", "\N{MINUS SIGN}")


def with_code(words_: str) -> Markup:
    """Text, escaped; what stands between backticks is code."""
    parts = [
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part)
        for k, part in enumerate(words_.split("`"))
    ]
    return Markup("").join(parts)


def part(name: str, *given: Any) -> Markup:
    """What a macro of ``parts.html.j2`` makes of what it is given."""
    made: Markup = getattr(_macros(), name)(*given)
    return made


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], caption: str, kind: str = ""
) -> Markup:
    """A table; the first cell of a row is its head."""
    return part("table", head, [tuple(row) for row in rows], caption, kind)


def facts(pairs: Iterable[tuple[str, str]], whole: str = "") -> Markup:
    """Names and values; the one named ``whole`` has a row of its own."""
    return part("facts", list(pairs), whole)


def badge(grade: str) -> Markup:
    """A grade as sign and word."""
    return part("badge", grade)


def sign(grade: str) -> Markup:
    """A grade as a sign whose shape alone tells it."""
    return part("sign", grade)
