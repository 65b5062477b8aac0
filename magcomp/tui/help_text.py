"""Help for what has the focus, and the keys of a screen with their names."""

from __future__ import annotations

from typing import Any

from textual.screen import Screen

_LEFT_OUT = {"app.interrupt", "compass.2", "compass.3"}


def help_text(screen: Screen[Any]) -> str:
    """Markdown for a screen: the focused widget's help, else that of what holds it."""
    node: Any = screen.focused if screen.focused is not None else screen
    text = next((n.HELP for n in node.ancestors_with_self if getattr(n, "HELP", None)), "")
    own = getattr(screen, "HELP", None)
    return f"{text}\n\n{own}" if own and own != text else text


def key_lines(screen: Screen[Any]) -> str:
    """Keys of a screen, what they do, and their names for the settings file; a line each."""
    rows = {
        binding.id: (screen.app.get_key_display(binding), binding.description)
        for _, binding, enabled, _ in screen.active_bindings.values()
        if binding.id and binding.id not in _LEFT_OUT and enabled
    }
    return "\n".join(f"  {key:<5} {what:<28} {name}" for name, (key, what) in rows.items())
