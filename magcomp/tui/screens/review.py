"""Write: what would change, which compasses, where the backup goes; then writing, and undoing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, VerticalScroll
from textual.content import Content
from textual.widget import Widget
from textual.widgets import DataTable, ProgressBar, Static

from magcomp.live.snapshot import LiveSnapshot
from magcomp.model import Analysis, Grade
from magcomp.report import words
from magcomp.report.as_json import analysis_object
from magcomp.report.plain import doubts, pilots_lines
from magcomp.tui.changes import ChangeRow
from magcomp.tui.messages import CompassToggled
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.widgets.heading_table import HeadingTable
from magcomp.tui.widgets.verdict_text import grade_word


class ChangeTable(DataTable[Text]):
    """Parameters: old, new, and how far each is."""

    HELP = """\
**What would be written.** *Old* is what the vehicle held before, *new* what it then holds.
Parameters that stay as they are are not listed.

The order of writing is safe at every moment: compensation off, values, read back, compensation on.
"""


class ReviewScreen(StepScreen):
    """The fourth step."""

    STEP = "review"
    HELP = ChangeTable.HELP
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "choose(1)", "Choose", id="compass.1", key_display="1-3"),
        Binding("2", "choose(2)", "Compass 2", id="compass.2", show=False),
        Binding("3", "choose(3)", "Compass 3", id="compass.3", show=False),
        Binding("w", "app.write", "Write", id="review.write"),
        Binding("s", "app.save", "Save", id="review.save"),
        Binding("e", "app.report", "Report", id="fit.report"),
        Binding("u", "app.undo", "Undo", id="review.undo"),
        Binding("b", "app.backward", "Back", id="go.back"),
        Binding("n", "app.forward", "Verify", id="go.next"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._rows: tuple[ChangeRow, ...] | None = None
        self._benefit: Analysis | None = None

    def body(self) -> Iterable[Widget]:
        """Which compasses, the table, where the backup goes, progress and result."""
        yield Static(id="reason")
        yield Static(id="grades")
        with Horizontal(id="difference"):
            yield ChangeTable(id="changes", cursor_type="row", cell_padding=0)
            with VerticalScroll(id="brings", classes="panel", can_focus=False):
                yield Static(id="brings-text")
                yield HeadingTable(id="brings-headings")
        yield Static(id="place")
        yield ProgressBar(total=1.0, show_eta=False, id="progress")

    def on_mount(self) -> None:
        """Columns, and the focus on the table so that arrows scroll it."""
        table = self.query_one(ChangeTable)
        table.border_title = "Parameters that change"
        for name, width in (("Parameter", 16), ("Old", 11), ("New", 14), ("", 14)):
            label = Text(name, justify="right" if name in ("Old", "New") else "left")
            table.add_column(label, key=name or "state", width=width)
        table.focus()
        self.query_one("#brings").border_title = "What it brings"

    def draw(self) -> None:
        """Draw the difference as it stands, or as it is being written."""
        work, busy = self.state.work, self.state.busy
        bar = self.query_one(ProgressBar)
        bar.display = busy is not None
        if busy is not None:
            bar.update(progress=busy.share)
        if work.analysis is not None:
            self.query_one("#grades", Static).update(chosen_line(work.analysis, work.chosen))
            self._show_benefit(work.analysis)
        writing = self.state.writing
        # Once it is written, the line that says so below counts.
        self.query_one("#reason").display = work.analysis is not None and not writing.in_force
        self._fill(writing.rows)
        table = self.query_one(ChangeTable)
        table.border_subtitle = words.counted(len(writing.rows), "parameter")
        place = self._place()
        self.query_one("#place", Static).update(place)
        self.query_one("#place").display = bool(place.plain)
        self.say(busy.sentence if busy is not None else self._next())

    def _show_benefit(self, analysis: Analysis) -> None:
        if analysis is not self._benefit:
            self._benefit = analysis
            line = pilots_lines(analysis_object(analysis))[0]
            self.query_one("#reason", Static).update(Content(line))
            shown = self.state.work.pictures[min(self.state.work.pictures)]
            title = Content.styled(
                f"\n\nHeading error of compass {shown.result.fit.compass}", "bold"
            )
            self.query_one("#brings-text", Static).update(benefit(analysis) + title)
            self.query_one(HeadingTable).show(shown.errors)

    def _fill(self, rows: tuple[ChangeRow, ...]) -> None:
        if rows == self._rows:
            return
        table = self.query_one(ChangeTable)
        before = self._rows or ()
        self._rows = rows
        if [row.name for row in rows] != [row.name for row in before]:
            table.clear()
            for row in rows:
                table.add_row(*_cells(row), key=row.name)
            return
        for index, (new, old) in enumerate(zip(rows, before, strict=True)):
            if new != old:
                for column, cell in zip(
                    ("Parameter", "Old", "New", "state"), _cells(new), strict=True
                ):
                    table.update_cell(new.name, column, cell)
                table.move_cursor(row=index)

    def _place(self) -> Content:
        writing = self.state.writing
        lines = [Content.assemble(("Mind: ", "bold $warning"), text) for text in writing.warnings]
        if writing.backup is not None:
            lines.append(Content.assemble(("Backup: ", "$quiet"), str(writing.backup)))
        if writing.result:
            lines.append(Content.assemble(("Result: ", "bold"), words.sentence(writing.result)))
        if writing.acts:
            lines.append(Content.assemble(("Seen: ", "bold"), words.sentence(writing.acts)))
        return Content("\n").join(lines)

    def _next(self) -> str:
        work = self.state.work
        if work.analysis is None or work.analysis.grade is Grade.REJECTED:
            return "There is nothing to write: press B and look at the fit."
        if not self.state.writing.rows:
            return "Nothing would change. Press 1, 2 or 3 to choose compasses, or B to go back."
        if not work.live and work.kept:
            return "Saved. Load it with your ground station, fly once more, and open that log."
        if not work.live:
            return "Press S to save these parameters to a file for your ground station."
        if self.state.writing.in_force:
            return "Press N to see the heading with the motors running. U undoes the writing."
        return how_to_write(self.state.live)

    def action_choose(self, compass: int) -> None:
        """Write one compass or leave it."""
        self.post_message(CompassToggled(compass))


def how_to_write(live: LiveSnapshot | None) -> str:
    """What stands between the pilot and writing, and the key for it."""
    if live is not None and not live.connected:
        return "The link is lost: wait until it is back, or press S to save a file."
    if live is not None and live.armed:
        return "Land and disarm, then press W to write to the vehicle. S saves a file."
    return "Press W to write to the vehicle, or S to save a file."


def chosen_line(analysis: Analysis, chosen: frozenset[int]) -> Content:
    """Which compasses are written: a box for each."""
    parts = [Content.styled(" Write", "$quiet")]
    for result in analysis.compasses:
        number = result.fit.compass
        rejected = result.verdict.grade is Grade.REJECTED
        box = "[–]" if rejected else "[×]" if number in chosen else "[ ]"
        parts += [Content(f"  {box} {number} "), grade_word(result.verdict.grade)]
    return Content.assemble(*parts)


def benefit(analysis: Analysis) -> Content:
    """Grade and doubts of each compass; what writing brings, the line above says."""
    blocks = []
    for result in analysis.compasses:
        title = Content.assemble((f"Compass {result.fit.compass}  ", "bold"))
        lines = [Content.assemble(title, grade_word(result.verdict.grade))]
        told = doubts(result.verdict.reasons, result.verdict.grade)
        lines += [Content(words.sentence(reason)) for reason in told]
        blocks.append(Content("\n").join(lines))
    return Content("\n\n").join(blocks)


def _cells(row: ChangeRow) -> tuple[Text, ...]:
    return (
        Text(row.name),
        Text(row.old, justify="right"),
        Text(row.new, justify="right", style="bold"),
        Text(f"  {row.state}"),
    )
