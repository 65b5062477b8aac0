"""The keys of the screen, at its foot; each can be clicked as well."""

from __future__ import annotations

from typing import Any

from textual.content import Content
from textual.events import Click
from textual.screen import Screen
from textual.widgets import Static


class KeyBar(Static):
    """One line of keys. Textual's own footer mounts a widget a key, anew at each change."""

    def __init__(self) -> None:
        super().__init__()
        self._shown = ""
        self._ends: list[tuple[int, str]] = []

    def on_mount(self) -> None:
        """Follow the screen's keys."""
        self.screen.bindings_updated_signal.subscribe(self, self._show)

    def on_unmount(self) -> None:
        """Follow them no more."""
        self.screen.bindings_updated_signal.unsubscribe(self)

    def on_click(self, event: Click) -> None:
        """Press the key under the pointer; the bar's whole height counts."""
        key = next((key for end, key in self._ends if event.x < end), None)
        if key is not None:
            self.app.simulate_key(key)

    def _show(self, screen: Screen[Any]) -> None:
        content, ends = Content(""), []
        for _, binding, enabled, _ in screen.active_bindings.values():
            if binding.show and enabled:
                key = (f" {self.app.get_key_display(binding)}", "bold $footer-key-foreground")
                what = (f" {binding.description} ", "$footer-description-foreground")
                content = Content.assemble(content, key, what)
                ends.append((content.cell_length, binding.key))
        self._ends = ends
        if content.plain != self._shown:
            self._shown = content.plain
            self.update(content, layout=False)
