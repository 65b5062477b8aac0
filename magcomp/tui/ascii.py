"""What a terminal without Unicode is shown: for each sign one of ASCII, as wide as it was."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from functools import lru_cache

from rich.cells import cell_len
from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

_PAIRS = (
    ("▁▂▃", "_"),
    ("▅▆", "="),
    ("▇", "#"),
    ("─━═╌╍┄┈╴╶╸╺╼╾▔▄", "-"),
    ("│┃║╎╏┆┊╷╵╹╻╽╿▏▕▎▍", "|"),
    ("█▓▉▊▋▌▐▀", "#"),
    ("▒", "+"),
    ("░·•◦∙⋅", "."),
    ("●", "*"),
    ("◇", "?"),
    ("◐◑", "o"),
    ("○", "O"),
    ("✓✔", "v"),
    ("×✗", "x"),
    ("▸›→▶⏵", ">"),
    ("‹←◀", "<"),
    ("▲↑▴", "^"),
    ("▼↓▾", "v"),
    ("–—−‐‑", "-"),
    ("“”„", '"'),
    ("‘’", "'"),
    ("°", "'"),
    ("±", "~"),
    ("…", "."),
)
_COERCED = ("C.UTF-8", "C.utf8", "UTF-8")
_SIGNS = {sign: plain for signs, plain in _PAIRS for sign in signs}


def is_ascii_only(encoding: str | None, environment: Mapping[str, str]) -> bool:
    """Whether a terminal takes nothing but ASCII.

    Parameters
    ----------
    encoding
        Of the stream that is written to.
    environment
        As ``os.environ``. Python writes UTF-8 under the C locale all the same (PEP 538), so what
        the locale says of the terminal is read here; no locale at all says nothing.
    """
    if (encoding or "").lower() in ("ascii", "us-ascii", "ansi_x3.4-1968"):
        return True
    everything, letters, usual = (
        environment.get(name, "") for name in ("LC_ALL", "LC_CTYPE", "LANG")
    )
    if letters in _COERCED:  # set by Python itself, it says nothing of the terminal
        letters = ""
    return (everything or letters or usual) in ("C", "POSIX")


@lru_cache(4096)
def plain(text: str) -> str:
    """A text in ASCII, cell for cell."""
    return text if text.isascii() else "".join(map(_plain_sign, text))


def _plain_sign(sign: str) -> str:
    if sign.isascii():
        return sign
    width = cell_len(sign)
    if sign in _SIGNS:
        return _SIGNS[sign] * width
    if "╀" > sign >= "┌" or "╰" >= sign >= "╒":  # corners and crossings of boxes
        return "+"
    if "⠀" <= sign <= "⣿":  # dots of a plot
        return "." if sign != "⠀" else " "
    first = unicodedata.normalize("NFKD", sign)[:1]
    return first if first.isascii() and width == 1 else "?" * width


class AsciiFilter(LineFilter):
    """Draws every line in ASCII."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:  # noqa: ARG002
        """The same segments in ASCII, as wide as they were."""
        return [Segment(plain(text), style, control) for text, style, control in segments]
