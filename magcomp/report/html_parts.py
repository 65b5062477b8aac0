"""Small pieces of HTML: escaped text, numbers that name their place in the JSON, tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from magcomp.report import words

Key = tuple[str | int, ...]

DASH = "–"


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

    def show(self, *key: str | int, decimals: int | None = None, scale: float = 1.0) -> str:
        """A number to some decimals; as precise as a parameter needs where none are given."""
        value = self.at(*key)
        if value is None:
            return DASH
        shown = value * scale
        text = parameter(shown) if decimals is None else f"{shown:.{decimals}f}"
        place = ".".join(map(str, key))
        scaled = "" if scale == 1.0 else f' data-scale="{scale:g}"'
        return f'<data value="{value!r}" data-key="{escape(place)}"{scaled}>{minus(text)}</data>'


def parameter(value: float) -> str:
    """A parameter's value: short, and finer than a heading can tell."""
    return words.number(value, 4)


def minus(text: str) -> str:
    """A number's text with a true minus sign."""
    return text.replace("-", "\N{MINUS SIGN}")


def text(words_: str) -> str:
    """Text, escaped."""
    return escape(words_, quote=True)


def with_code(words_: str) -> str:
    """Text, escaped; what stands between backticks is code."""
    parts = [text(part) for part in words_.split("`")]
    return "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], caption: str, kind: str = "") -> str:
    """A table; cells are HTML, the first of a row is its head."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "".join(
        f'<tr><th scope="row">{row[0]}</th>'
        + "".join(f"<td>{cell}</td>" for cell in row[1:])
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="scroll"><table class="{kind}"><caption>{caption}</caption>'
        f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def facts(pairs: Iterable[tuple[str, str]], whole: str = "") -> str:
    """Names and values; values are HTML, and the one named ``whole`` has a row of its own."""
    rows = []
    for name, value in pairs:
        kind = ' class="whole"' if name == whole else ""
        rows.append(f"<div{kind}><dt>{text(name)}</dt><dd>{value}</dd></div>")
    return f'<dl class="facts">{"".join(rows)}</dl>'


_SIGNS = {
    "good": '<circle cx="12" cy="12" r="11"/><path d="M6.5 12.5l3.7 3.7 7.3-8"/>',
    "marginal": '<path class="body" d="M12 1.5L23 21.5H1z"/><path d="M12 8.5v6.5M12 17.6v.9"/>',
    "rejected": '<path class="body" d="M7.5 1h9L23 7.5v9L16.5 23h-9L1 16.5v-9z"/>'
    '<path d="M8 8l8 8M16 8l-8 8"/>',
}


def badge(grade: str) -> str:
    """A grade as sign and word."""
    return f'<span class="badge {grade}">{sign(grade)}{text(grade)}</span>'


def sign(grade: str) -> str:
    """A grade as a sign whose shape alone tells it."""
    return f'<svg class="sign {grade}" viewBox="0 0 24 24" aria-hidden="true">{_SIGNS[grade]}</svg>'
