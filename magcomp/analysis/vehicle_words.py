"""Advice in the words of the vehicle: who drives or dives does not fly."""

from __future__ import annotations

import re
from collections.abc import Mapping

_DRIVEN = {
    "fly climbs and descents": "drive slowly and fast, uphill and downhill",
    "fly a climb": "drive fast, and uphill",
    "fly": "drive",
    "in flight": "while driving",
}
_WORDS: Mapping[str, Mapping[str, str]] = {
    "rover": _DRIVEN,
    "boat": {
        **_DRIVEN,
        "fly climbs and descents": "drive slowly and fast",
        "fly a climb": "drive fast",
    },
    "sub": {
        "fly climbs and descents": "dive up and down, slowly and fast",
        "fly a climb": "dive up and down",
        "fly": "dive",
        "in flight": "while diving",
    },
}


def in_words_of(kind: str, text: str) -> str:
    """A sentence made for a copter, for another kind of vehicle.

    Parameters
    ----------
    kind
        As in :class:`magcomp.model.Vehicle`.
    text
        The sentence.
    """
    words = _WORDS.get(kind)
    if words is None:
        return text
    pattern = "|".join(rf"\b{phrase}\b" for phrase in words)
    return re.sub(pattern, lambda found: words[found[0]], text)
