"""What every live picture of text is made of: data and room in, text out."""

from __future__ import annotations

from typing import ClassVar, Generic, TypeVar

from textual.content import Content
from textual.widgets import Static

Data = TypeVar("Data")


class Drawn(Static, Generic[Data]):
    """Text that depends on nothing but the data last shown and the room there is.

    A subclass gives ``picture``. Room is known only once the layout has settled, which may be
    after the first data came: so the data are kept, and drawn again whenever the room changes.
    """

    SETS_HEIGHT: ClassVar[bool] = False
    """The text decides how high the widget is, so that new text may need a new layout."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._data: Data | None = None
        self._drawn = Content("")

    def picture(self, data: Data, width: int, height: int) -> Content:
        """The text for some data in so many cells."""
        raise NotImplementedError

    def draw_data(self, data: Data) -> None:
        """Keep data and draw them; nothing happens where they are the same as before."""
        if data != self._data:
            self._data = data
            self._draw()

    def on_resize(self) -> None:
        """Draw for the new room."""
        self._draw()

    def _draw(self) -> None:
        if self._data is None:
            return
        drawn = self.picture(self._data, self.size.width, self.size.height)
        if not drawn.is_same(self._drawn):
            self._drawn = drawn
            self.update(drawn, layout=self.SETS_HEIGHT)
            if self.SETS_HEIGHT:
                # A layout that is under way already would keep the height of the text before.
                self.call_after_refresh(self.refresh, layout=True)
