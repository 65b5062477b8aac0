"""Connect: choose a vehicle or a log, and see what it is and what will stand in the way."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.widget import Widget
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from magcomp.report import words
from magcomp.tui import status
from magcomp.tui.choices import SIMULATED, Choice
from magcomp.tui.messages import PortsWanted, TargetChosen
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.vehicle_card import VehicleCard
from magcomp.tui.widgets.top_bar import STEPS

_DONE_THERE = {
    "connect": "A vehicle, a log, or a simulated vehicle to try it.",
    "record": "Fly two minutes: turns, climbs, descents. It is said what is still missing.",
    "fit": "How wrong the heading is now, and how wrong at most with the new numbers.",
    "review": "To a file, or to the vehicle after a question. The old numbers are kept; U brings "
    "them back.",
    "verify": "Fly as before: what was promised stands beside what was measured.",
}
_TYPE = "Type an address such as udp:14550, or the path of a log, and press Enter."
_TARGET_CELLS = 36
_ONE_LINE_CELLS = 76


class TargetList(OptionList):
    """What can be connected to or opened."""

    HELP = """\
**Where is the vehicle?** Choose with the arrow keys and press Enter.

- A *serial port* is a USB cable or a telemetry radio (add the baud rate of a radio by typing
  `/dev/ttyUSB0,57600` below).
- *udp:0.0.0.0:14550* listens for a vehicle, simulator or ground station that sends to this
  computer; *tcp:HOST:PORT* connects to one.
- A *log* is a .tlog, .BIN or .ulg file: everything but writing works without a vehicle.
- A *simulated vehicle* needs nothing and can break nothing.
"""


class AddressInput(Input):
    """An address or a path, typed."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "screen.choose", "Back to the list", id="connect.list"),
    ]

    HELP = """\
**Address or log.** Type where the vehicle is, or the path of a log, and press Enter:

    udp:0.0.0.0:14550        tcp:127.0.0.1:5760
    /dev/ttyACM0             /dev/ttyUSB0,57600
    COM7,57600               flights/flight.tlog
"""


class CardView(VerticalScroll):
    """The vehicle in words, with warnings."""

    HELP = """\
**The vehicle**: what it is, what calibration it has now, and what will stand in the way of a good
result. Nothing has been written or changed yet.
"""

    def compose(self) -> Iterator[Widget]:
        """One text in a scroll."""
        yield Static(id="card-text")

    def show(self, card: VehicleCard | None, steps: Sequence[str] = ()) -> None:
        """Draw a card, and below it what is done in some steps."""
        text = Content("\n").join([card_text(card), Content(""), *map(step_text, steps)])
        self.query_one("#card-text", Static).update(text)


def step_text(step: str) -> Content:
    """What is done in a step of the road."""
    return Content.assemble((STEPS[step], "bold"), f"\n{_DONE_THERE[step]}")


def card_text(card: VehicleCard | None) -> Content:
    """A card as text."""
    if card is None:
        return Content.styled("Nothing is connected or open yet.", "$quiet")
    lines = [Content.styled(card.title, "bold"), Content("")]
    width = max((len(name) for name, _ in card.facts), default=0) + 2
    for name, fact in card.facts:
        lines.append(Content.assemble((f"{name:<{width}}", "$quiet"), fact))
    lines.append(Content(""))
    for warning in card.warnings:
        lines.append(Content.assemble(("Mind: ", "bold $warning"), warning))
    if not card.warnings:
        lines.append(Content.assemble(("● ", "$success"), "Nothing stands in the way of a fit."))
    return Content("\n").join(lines)


def choice_text(choice: Choice, *, roomy: bool) -> Content:
    """A line of the list, or two where there is room; of a long path the end counts."""
    target = choice.target
    if len(target) > _TARGET_CELLS:
        target = f"…{target[1 - _TARGET_CELLS :]}"
    if roomy:
        return Content.assemble((target, "bold"), "\n", f"  {choice.note}")
    return Content.assemble((f"{target:<{_TARGET_CELLS}}  ", "bold"), choice.note)


class ConnectScreen(StepScreen):
    """The first step."""

    STEP = "connect"
    HELP = TargetList.HELP
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("o", "app.open_log", "Open log", id="connect.open"),
        Binding("s", "app.simulate", "Simulate", id="connect.simulate"),
        Binding("a", "address", "Address", id="connect.address"),
        Binding("r", "ports", "Rescan", id="connect.rescan"),
        Binding("x", "app.disconnect", "Disconnect", id="connect.close"),
        Binding("n", "app.forward", "Next step", id="go.next"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._choices: tuple[Choice, ...] = ()
        self._source = ""

    def body(self) -> Iterable[Widget]:
        """List and address on the left, the vehicle on the right."""
        with Horizontal(classes="body"):
            with Vertical(id="targets"):
                yield TargetList(id="choices")
                yield AddressInput(
                    placeholder="or type an address or the path of a log", id="address"
                )
            yield CardView(id="card")

    def on_mount(self) -> None:
        """Look for serial ports."""
        self.query_one("#choices").border_title = "Where is the vehicle?"
        self.query_one("#card").border_title = "Vehicle"
        self.query_one(TargetList).focus()
        self.post_message(PortsWanted())

    def _fill(self, choices: tuple[Choice, ...]) -> None:
        if choices == self._choices:
            return
        self._choices = choices
        listing = self.query_one(TargetList)
        kept = listing.highlighted or 0
        listing.clear_options()
        roomy = self.has_class("-tall") or self.size.width < _ONE_LINE_CELLS
        for choice in choices:
            listing.add_option(Option(choice_text(choice, roomy=roomy), id=choice.target))
        if choices:
            listing.highlighted = min(kept, len(choices) - 1)

    def draw(self) -> None:
        """Draw the vehicle and what to do next."""
        work, busy, live = self.state.work, self.state.busy, self.state.live
        self._fill(self.state.choices)
        roomy = self.has_class("-wide") and self.has_class("-tall")
        self.query_one(CardView).show(work.card, self._to_come() if roomy else ())
        if work.source != self._source:
            self._source = work.source
            self.query_one("#choices").focus()
        if self.has_class("-known") != (work.card is not None):
            self.set_class(work.card is not None, "-known")
            self.query_one("#choices" if work.card is None else "#card").focus()
        if busy is not None:
            self.say(busy.sentence)
        elif live is not None and work.card is None:
            self.say(f"Wait: {live.guidance.text}. X gives up. {words.sentence(live.link_text)}")
        elif work.card is None:
            typing = self.query_one(AddressInput).has_focus
            self.say(_TYPE if typing else "Choose with the arrows and press Enter, or A to type.")
        elif work.live:
            self.say("Press N to record. X disconnects.")
        else:
            self.say("Press N to see the fit of this log. X closes it.")

    def _to_come(self) -> tuple[str, ...]:
        """The steps of this road that lie ahead."""
        steps = status.road(self.state.work)
        return steps[1:] if self.state.work.card is not None else steps

    def on_resize(self) -> None:
        """Fill the list anew: how many lines a choice has depends on the room."""
        self._choices = ()

    async def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Connect to a line of the list."""
        target = event.option_id or ""
        if target in SIMULATED:
            await self.run_action(f"app.simulate('{SIMULATED[target]}')")
        elif target:
            self.post_message(TargetChosen(target))

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Connect to what was typed."""
        if event.value.strip():
            self.post_message(TargetChosen(event.value.strip()))

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:  # noqa: ARG002
        """Hide what is done with."""
        return action not in ("address", "ports") or not self.state.work.source

    def on_descendant_focus(self) -> None:
        """Say what to do where the focus is now."""
        self.redraw()

    def action_address(self) -> None:
        """Type an address."""
        self.query_one(AddressInput).focus()

    def action_choose(self) -> None:
        """Choose from the list."""
        self.query_one(TargetList).focus()

    def action_ports(self) -> None:
        """Look for serial ports again."""
        self.post_message(PortsWanted())
