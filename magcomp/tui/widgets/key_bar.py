"""The keys of the screen, at its foot; each can be clicked as well."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from textual.content import Content
from textual.events import Click
from textual.screen import Screen

from magcomp.tui.widgets.drawn import Drawn


@dataclass(frozen=True)
class Key:
    """A key that does something here.

    Attributes
    ----------
    shown, does
        As displayed, and what it does.
    pressed
        The key itself.
    """

    shown: str
    does: str
    pressed: str

    @property
    def text(self) -> Content:
        """As it stands in the bar."""
        return Content.assemble(
            (f" {self.shown}", "bold $footer-key-foreground"),
            (f" {self.does} ", "$footer-description-foreground"),
        )


class KeyBar(Drawn[tuple[Key, ...]]):
    """The keys, in as many lines as they need: none is ever cut off.

    Textual's own footer mounts a widget a key, anew at each change.
    """

    SETS_HEIGHT = True

    def on_mount(self) -> None:
        """Follow the screen's keys."""
        self.screen.bindings_updated_signal.subscribe(self, self._show)

    def on_unmount(self) -> None:
        """Follow them no more."""
        self.screen.bindings_updated_signal.unsubscribe(self)

    def on_click(self, event: Click) -> None:
        """Press the key under the pointer; the bar's whole height counts."""
        lines = _lines(self._data or (), self.size.width)
        if not lines:
            return
        line = lines[min(max(event.y - self.styles.padding.top, 0), len(lines) - 1)]
        end = 0
        for key in line:
            end += key.text.cell_length
            if event.x < end:
                self.app.simulate_key(key.pressed)
                return

    def picture(self, data: tuple[Key, ...], width: int, height: int) -> Content:  # noqa: ARG002
        """Lines of keys."""
        lines = _lines(data, width)
        return Content("\n").join(Content("").join(key.text for key in line) for line in lines)

    def _show(self, screen: Screen[Any]) -> None:
        bound = ((binding, enabled) for _, binding, enabled, _ in screen.active_bindings.values())
        self.draw_data(
            tuple(
                Key(self.app.get_key_display(binding), binding.description, binding.key)
                for binding, enabled in bound
                if binding.show and enabled
            )
        )


def _lines(keys: Iterable[Key], width: int) -> list[list[Key]]:
    """Break a row of keys where the width ends."""
    lines: list[list[Key]] = []
    end = width + 1
    for key in keys:
        length = key.text.cell_length
        if end + length > width:
            lines.append([])
            end = 0
        lines[-1].append(key)
        end += length
    return lines
