"""What AUTOPILOT_VERSION says of a vehicle: its firmware, its board, and its own number."""

from __future__ import annotations

import re


def firmware_version(packed: int) -> str:
    """AUTOPILOT_VERSION.flight_sw_version, a byte each of major, minor, patch and type.

    Returns
    -------
    str
        Such as ``"4.6.3"``; empty where it was not set.

    Examples
    --------
    >>> firmware_version(0x040603FF)
    '4.6.3'
    """
    if not packed:
        return ""
    return f"{packed >> 24 & 255}.{packed >> 16 & 255}.{packed >> 8 & 255}"


_BOARD = "board "
# "CubeOrange 0037003A 30325116 38393532"
_BOARD_LINE = re.compile(r"[A-Za-z][\w+-]*((?: [0-9A-F]{8}){3})")


def board_name(packed: int) -> str:
    """AUTOPILOT_VERSION.board_version, whose upper half is the number of the kind of board.

    Examples
    --------
    >>> board_name(140 << 16)
    'board 140'
    """
    return f"{_BOARD}{packed >> 16}" if packed else ""


def is_numbered_board(name: str) -> bool:
    """Whether a board's name is a number, as on a link, and not a word, as in some logs."""
    return name.startswith(_BOARD)


def number_in_words(words: str) -> str:
    """The flight controller's own number from what it says of itself at start.

    Parameters
    ----------
    words
        Three groups of eight hexadecimal digits, each with its bytes reversed.

    Returns
    -------
    str
        As :func:`unique_id`; empty where nothing but zeros was left of it.

    Examples
    --------
    >>> number_in_words("00510027 33355115 31373937")
    '270051001551353337393731'
    """
    number = b"".join(bytes.fromhex(word)[::-1] for word in words.split())
    return unique_id(number, 0)


def number_in_line(line: str) -> str:
    """The flight controller's own number in what it says of itself at start, or empty."""
    words = _BOARD_LINE.fullmatch(line)
    return number_in_words(words[1]) if words else ""


def unique_id(uid2: bytes, uid: int) -> str:
    """The flight controller's own number, which tells it from its twins.

    Parameters
    ----------
    uid2
        AUTOPILOT_VERSION.uid2, 18 bytes; zeros where unknown.
    uid
        AUTOPILOT_VERSION.uid, which older firmware sends alone; 0 where unknown.

    Returns
    -------
    str
        Hexadecimal, without the zeros at the end of ``uid2``; empty where neither is known.

    Examples
    --------
    >>> unique_id(bytes([0x27, 0, 0x51]) + bytes(15), 0)
    '270051'
    >>> unique_id(bytes(18), 0x1234)
    '1234'
    """
    used = uid2.rstrip(b"\0")
    if used:
        return used.hex()
    return f"{uid:x}" if uid else ""
