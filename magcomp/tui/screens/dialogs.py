"""The questions and messages that lie over a screen. Every button has a key of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import ClassVar, TypeVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widget import Widget
from textual.widgets import Button, Input, Label, Static

Answer = TypeVar("Answer")


class Dialog(ModalScreen[Answer]):
    """What the questions have in common: on a low terminal they leave out air, never a line."""

    VERTICAL_BREAKPOINTS = [(0, "-short"), (32, "-tall")]  # noqa: RUF012 - as in Screen


class Message(Dialog[None]):
    """A sentence and the next step; Enter goes on.

    Parameters
    ----------
    title, sentence, step
        What kind of thing happened, what, and what to do now.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape,enter", "dismiss", "Go on")]

    def __init__(self, title: str, sentence: str, step: str) -> None:
        super().__init__()
        self._title, self._sentence, self._step = title, sentence, step

    def compose(self) -> ComposeResult:
        """Title, sentence, step, button."""
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = self._title
            yield Static(self._sentence, markup=False, classes="sentence")
            yield Static(f"Next: {self._step}", markup=False, classes="step")
            with Horizontal(classes="buttons"):
                yield Button("Enter  Go on", variant="primary", id="go-on")

    def on_button_pressed(self) -> None:
        """Go on."""
        self.dismiss()


class Confirm(Dialog[bool]):
    """A question whose safe answer is the default.

    Parameters
    ----------
    title, lines
        The question and what it is about.
    yes, no
        What the two answers are called.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "answer(True)", "Yes"),
        Binding("n,escape", "answer(False)", "No"),
        Binding("left,right", "other", show=False),
    ]

    def __init__(self, title: str, lines: str, yes: str, no: str) -> None:
        super().__init__()
        self._title, self._lines, self._yes, self._no = title, lines, yes, no

    def compose(self) -> ComposeResult:
        """Question and two buttons."""
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = self._title
            with VerticalScroll(classes="sentence", can_focus=False):
                yield Static(self._lines, markup=False)
            with Horizontal(classes="buttons"):
                yield Button(f"Y  {self._yes}", id="yes")
                yield Button(f"N  {self._no}", variant="primary", id="no")

    def on_mount(self) -> None:
        """The safe answer has the focus."""
        self.query_one("#no", Button).focus()

    def action_answer(self, answer: bool) -> None:
        """Answer with a key."""
        self.dismiss(answer)

    def action_other(self) -> None:
        """Move to the other button."""
        self.focus_next()

    def on_button_pressed(self, event: Button.Pressed) -> None:
        """Answer with a button."""
        self.dismiss(event.button.id == "yes")


class Quit(Confirm):
    """Whether to leave.

    Parameters
    ----------
    question
        What would be lost.
    """

    def __init__(self, question: str) -> None:
        super().__init__("Quit?", question, yes="Quit", no="Stay")


@dataclass(frozen=True)
class Fault:
    """What is wrong with an answer.

    Attributes
    ----------
    line
        Which line it is about, from 0.
    sentence
        What is wrong with it.
    """

    line: int
    sentence: str


class AskText(Dialog["tuple[str, ...] | None"]):
    """One or two lines of text; Escape gives None.

    Parameters
    ----------
    title, explanation
        What is asked for.
    fields
        A label and what stands there at first, for each line.
    check
        What is wrong with the lines as they are, None where nothing: a fault is shown here, with
        the focus on its line.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "cancel", "Cancel")]

    def __init__(
        self,
        title: str,
        explanation: str,
        fields: tuple[tuple[str, str], ...],
        check: Callable[[tuple[str, ...]], Fault | None] = lambda _: None,
    ) -> None:
        super().__init__()
        self._title, self._explanation, self._fields = title, explanation, fields
        self._check = check

    def compose(self) -> ComposeResult:
        """Labels, inputs, buttons."""
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = self._title
            yield Static(self._explanation, markup=False, classes="sentence")
            yield from self.body()
            for label, value in self._fields:
                yield Label(label)
                yield Input(value, select_on_focus=True)
            yield Static(id="fault", markup=False)
            with Horizontal(classes="buttons"):
                yield Button("Enter  OK", variant="primary", id="ok")
                yield Button("Esc  Cancel", id="cancel")

    def on_mount(self) -> None:
        """Begin in the first line."""
        self.query(Input).first().focus()

    def body(self) -> Iterable[Widget]:
        """What stands between the explanation and the lines."""
        return ()

    def action_cancel(self) -> None:
        """Leave everything as it is."""
        self.dismiss(None)

    def on_button_pressed(self, event: Button.Pressed) -> None:
        """Take or leave."""
        if event.button.id == "ok":
            self._take()
        else:
            self.dismiss(None)

    def on_input_submitted(self) -> None:
        """Enter takes all lines."""
        self._take()

    def _take(self) -> None:
        lines = tuple(field.value.strip() for field in self.query(Input))
        fault = self._check(lines)
        if fault is None:
            self.dismiss(lines)
            return
        self.query_one("#fault", Static).update(fault.sentence)
        self.query(Input)[fault.line].focus()


class Help(Dialog[None]):
    """Help for what has the focus, and the keys of the screen with their names.

    Parameters
    ----------
    text
        Markdown.
    keys
        A line a key.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape,enter,f1,q", "dismiss", "Close")]

    def __init__(self, text: str, keys: str) -> None:
        super().__init__()
        self._text, self._keys = text, keys

    def compose(self) -> ComposeResult:
        """The text in a scroll."""
        from textual.widgets import Markdown  # noqa: PLC0415 - its parser is slow to import

        with Vertical(classes="dialog tall") as dialog:
            dialog.border_title = "Help"
            dialog.border_subtitle = "Esc closes"
            with VerticalScroll():
                yield Markdown(self._text)
                yield Static("Keys, and their names in the settings file", classes="step")
                yield Static(self._keys, markup=False)

    def on_mount(self) -> None:
        """Arrow keys scroll."""
        self.query_one(VerticalScroll).focus()
