"""The words of `magcomp` at MAVProxy's prompt: status, fit, write, undo."""

from __future__ import annotations

import shlex
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from magcomp.analysis import parameter_set
from magcomp.cli.linking import StatusLine
from magcomp.cli.options import check_output
from magcomp.cli.output import answer_words, complain, look
from magcomp.cli.writing import carry_out, show_difference
from magcomp.errors import ExitCode, MagcompError, UsageError, unforeseen
from magcomp.live.guide import STEADY
from magcomp.live.session import LiveSession
from magcomp.live.snapshot import LiveSnapshot
from magcomp.live.upload import new_file
from magcomp.model import Analysis, Grade
from magcomp.report import as_text, words
from magcomp.writing.events import Event, Outcome
from magcomp.writing.files import SUFFIXES, write_parameter_file
from magcomp.writing.plan import WritePlan

USAGE = (
    "magcomp status                what is heard and recorded, and what to do next",
    "magcomp fit [FILE.parm]       fit what was recorded; write the parameters to FILE",
    "magcomp write [yes]           show what would change on the vehicle; yes writes it",
    "magcomp undo [BACKUP] [yes]   show what the backup would bring back; yes writes it",
)
_YES = "yes"

Write = Callable[[WritePlan, Path, Callable[[Event], None], Callable[[], bool]], Outcome]


class Commands:
    """Carries out what is typed, one thing at a time, without holding up who called.

    Parameters
    ----------
    session
        The vehicle; `close` closes it.
    """

    def __init__(self, session: LiveSession) -> None:
        self._session = session
        self._analysis: Analysis | None = None
        self._fitted_s = 0.0
        self._backup: Path | None = None
        self._stop = threading.Event()
        self._at_work: threading.Thread | None = None

    def run(self, said: Sequence[str]) -> None:
        """Carry out a command; what takes time goes on in a thread of its own."""
        word, *rest = said or [""]
        works: dict[str, Callable[[Sequence[str]], None]] = {
            "fit": self._fit,
            "write": self._write,
            "undo": self._undo,
            # As the sentences after a failed write put it.
            "restore": self._undo,
        }
        if word == "status":
            self._guarded(self._status, rest)
        elif word not in works:
            answer_words("".join(f"{line}\n" for line in USAGE))
        elif self._at_work is not None and self._at_work.is_alive():
            complain("The last command must end first; it is still at work")
        else:
            self._at_work = threading.Thread(
                target=self._guarded, args=(works[word], rest), name="magcomp-command", daemon=True
            )
            self._at_work.start()

    def wait(self, seconds: float) -> bool:
        """Wait for the command at work; whether it has ended."""
        if self._at_work is not None:
            self._at_work.join(seconds)
        return self._at_work is None or not self._at_work.is_alive()

    def stop(self) -> bool:
        """Have what is at work end, a write by putting everything back; whether all has ended."""
        self._stop.set()
        return self.wait(0.0)

    def close(self) -> None:
        """Close the session, once all has ended."""
        self._session.close()

    def _guarded(self, work: Callable[[Sequence[str]], None], rest: Sequence[str]) -> None:
        try:
            work(rest)
        except MagcompError as error:
            complain(str(error))
        except Exception as error:  # MAVProxy must go on whatever happens here
            complain(unforeseen(error))

    def _status(self, _rest: Sequence[str]) -> None:
        shown = self._session.snapshot()
        who = "no vehicle yet" if shown.vehicle is None else words.vehicle(shown.vehicle)
        ready = "; its calibration is read" if shown.ready else ""
        path = shown.recording_path
        into = "" if path is None else f" into {words.printable(str(path))}"
        lines = [
            f"{who}; {shown.link_text}{ready}",
            f"{words.duration(shown.recorded_s)} are recorded{into}",
            *shown.warnings,
            self._next(shown),
        ]
        answer_words("".join(f"{words.sentence(line)}\n" for line in lines if line))

    def _next(self, shown: LiveSnapshot) -> str:
        """What to do next. Nothing is fitted here unasked, so that the guide misses an answer."""
        guidance = shown.guidance
        if shown.armed and guidance.missing == (STEADY,):
            return "all that a fit needs is flown: land, then magcomp fit"
        if shown.armed is not False or not shown.armed_until_s:
            return guidance.text
        if self._analysis is None or self._fitted_s < shown.armed_until_s:
            return "magcomp fit says whether what was recorded is enough"
        grade = self._analysis.grade
        rejected = grade is Grade.REJECTED
        then = "fly once more" if rejected else "magcomp write shows what would change"
        return f"the last fit is {grade.value}: {then}"

    def _fit(self, rest: Sequence[str]) -> None:
        output = Path(rest[0]).expanduser() if rest else None
        if output is not None:
            check_output(output, SUFFIXES, output, force=False)
        complain("Fitting what was recorded")
        recorded_s = self._session.snapshot().recorded_s
        recording = self._session.recording()
        self._analysis = analysis = self._session.analyse()
        self._fitted_s = recorded_s
        chosen = parameter_set(analysis)
        present = recording.parameters.latest
        answer_words(as_text.analysis_text(analysis, chosen.values, present, look(), advise=False))
        if analysis.grade is Grade.REJECTED:
            complain("Nothing can be written because no compass has a fit to be trusted")
            return
        if output is not None:
            write_parameter_file(output, chosen)
            complain(f"Written to {output}")
        complain("magcomp write shows what would change on the vehicle")

    def _write(self, rest: Sequence[str]) -> None:
        if self._analysis is None:
            raise UsageError("A fit must come before a write: magcomp fit")
        if self._analysis.grade is Grade.REJECTED:
            raise UsageError("A fit to be written must be good or marginal; instead it is rejected")
        plan = self._session.upload_plan(parameter_set(self._analysis))
        self._carry_out(plan, "write", _YES in rest, self._session.upload)

    def _undo(self, rest: Sequence[str]) -> None:
        named = [word for word in rest if word != _YES]
        backup = Path(named[0]).expanduser() if named else self._backup
        if backup is None:
            raise UsageError(
                "A backup must be given, or something written first; instead there is neither"
            )
        plan = self._session.restore_plan(backup)

        def restore(
            plan: WritePlan, path: Path, tell: Callable[[Event], None], stop: Callable[[], bool]
        ) -> Outcome:
            return self._session.restore(backup, plan, path, tell, stop)

        word = shlex.join(["undo", *named[:1]])
        self._carry_out(plan, word, _YES in rest, restore)

    def _carry_out(self, plan: WritePlan, word: str, agreed: bool, write: Write) -> None:
        """Show the difference, and where that was agreed to, write it and prove it."""
        show_difference(plan)
        if not plan.changes:
            complain("The vehicle holds all of this already; nothing is written")
            return
        if not agreed:
            complain(f"Nothing is written yet: magcomp {word} yes")
            return
        self._session.wait_disarmed(0.0)
        backup = new_file("backup", ".param", plan.vehicle, time.time())
        code = carry_out(
            plan,
            lambda tell, stopped: write(plan, backup, tell, stopped),
            backup,
            # There is one vehicle here: what brings it back needs no address, but consent.
            (_YES,),
            self._stop,
            # A line that is drawn anew again and again would be drawn over the prompt.
            StatusLine(terminal=False),
        )
        if code is ExitCode.GOOD:
            self._backup = backup
            complain("To undo this: magcomp undo")
