"""What a terminal without Unicode is shown, a screen cell for cell and a text as it reads best."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from functools import lru_cache

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
    ("≤", "<"),
    ("≥", ">"),
)
_IN_WORDS = {"°": " deg", "±": "+-", "→": "->", "…": ".."}
_GAP = re.compile(r"( {2,})")
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
    # Rich takes a twentieth of a second to import, which only a sign that is no ASCII is worth.
    from rich.cells import cell_len  # noqa: PLC0415

    width = cell_len(sign)
    if sign in _SIGNS:
        return _SIGNS[sign] * width
    if "╀" > sign >= "┌" or "╰" >= sign >= "╒":  # corners and crossings of boxes
        return "+"
    if "⠀" <= sign <= "⣿":  # dots of a plot
        return "." if sign != "⠀" else " "
    first = unicodedata.normalize("NFKD", sign)[:1]
    return first if first.isascii() and width == 1 else "?" * width


def in_words(text: str) -> str:
    """A text for people in ASCII: what one sign cannot say is said in several.

    The gap before what has grown makes room for it, so that columns stay under each other; what a
    line begins with is no gap.

    Examples
    --------
    >>> in_words("at most 0.9°")
    'at most 0.9 deg'
    >>> in_words("   0 A       17.0°  ██")
    '   0 A    17.0 deg  ##'
    >>> in_words("   wrong by 12.8°")
    '   wrong by 12.8 deg'
    """
    return text if text.isascii() else "\n".join(map(_line_in_words, text.split("\n")))


def _line_in_words(line: str) -> str:
    made: list[str] = []
    for part in _GAP.split(line):
        said = "".join(_IN_WORDS.get(sign) or plain(sign) for sign in part)
        if any(made[:-1]) and made[-1].isspace() and len(said) > len(part):
            gap = made.pop()
            made.append(" " * max(len(gap) - len(said) + len(part), 1))
        made.append(said)
    return "".join(made)


def encodable(text: str, encoding: str) -> str:
    """The text with ASCII in the place of what an encoding lacks."""
    try:
        text.encode(encoding)
    except UnicodeError:
        return "".join(sign if _has(encoding, sign) else _plain_sign(sign) for sign in text)
    return text


def _has(encoding: str, sign: str) -> bool:
    try:
        sign.encode(encoding)
    except UnicodeError:
        return False
    return True
