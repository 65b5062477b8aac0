"""Bars of block characters. Their length is beside a number, never instead of one."""

from __future__ import annotations

from textual.content import Content

_EIGHTHS = ("", "▏", "▎", "▍", "▌", "▋", "▊", "▉")


def bar(share: float, width: int, *, style: str = "") -> Content:
    """A bar ``width`` cells wide, filled to ``share`` (0 … 1); the empty part is dotted."""
    eighths = round(min(max(share, 0.0), 1.0) * width * 8)
    full, rest = divmod(eighths, 8)
    filled = "█" * full + _EIGHTHS[rest]
    empty = "·" * (width - len(filled))
    return Content.assemble((filled, style), (empty, "$quiet"))


def tail(share: float, width: int, *, style: str = "") -> Content:
    """A bar without its empty part; never empty, so that small is not none."""
    eighths = max(round(min(max(share, 0.0), 1.0) * width * 8), 1)
    full, rest = divmod(eighths, 8)
    filled = "█" * full + _EIGHTHS[rest]
    return Content.assemble((filled, style), " " * (width - len(filled)))
