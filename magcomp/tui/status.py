"""Where the pilot stands on the road: which steps there are, which are done, what is missing."""

from __future__ import annotations

from magcomp.live.situation import Situation
from magcomp.live.snapshot import LiveSnapshot
from magcomp.model import Grade
from magcomp.report import words
from magcomp.tui.widgets.top_bar import STEPS, Status
from magcomp.tui.work import Work

_LINKS = ((0.05, "good"), (0.2, "weak"))
"""Share of frames lost below which a link is called so."""

WRITING = "writing"
"""What is being done while a vehicle is written."""


def road(work: Work) -> tuple[str, ...]:
    """Steps for what is in hand; a log has nothing to record and nothing to verify."""
    return tuple(STEPS) if work.live or not work.source else ("connect", "fit", "review")


def missing(step: str, work: Work) -> str:
    """Why a step cannot be taken yet; empty where it can."""
    if not work.source:
        return "" if step == "connect" else "Connect to a vehicle or open a log first."
    if step not in road(work):
        return f"{STEPS[step]} needs a vehicle; this is a log."
    if step == "fit" and work.live and work.card is None:
        return "Wait until the vehicle's calibration is read."
    return _nothing_to_write(work) if step == "review" else ""


def _nothing_to_write(work: Work) -> str:
    if work.analysis is None:
        return "Fit first: there is nothing to write yet."
    if work.analysis.grade is Grade.REJECTED:
        return "The fit is rejected: there is nothing to write."
    return ""


def steps_done(work: Work, live: LiveSnapshot | None) -> frozenset[str]:
    """Steps that need no more work."""
    enough = live is not None and live.guidance.enough
    found = {
        "connect": work.card is not None,
        "record": enough or (work.live and work.analysis is not None),
        "fit": work.analysis is not None and work.analysis.grade is not Grade.REJECTED,
        "review": bool(work.kept),
    }
    return frozenset(step for step, done in found.items() if done)


def status(work: Work, live: LiveSnapshot | None) -> Status:
    """What is connected, and how well."""
    if live is None:
        if not work.source:
            return Status("no vehicle, no log")
        length = "" if work.recording is None else words.duration(work.recording.duration_s)
        return Status(f"log {work.name}", length)
    name = work.name if live.vehicle is None else words.vehicle(live.vehicle)
    if live.vehicle is None:
        return Status(f"{work.name}: looking for a vehicle", "")
    if not live.connected:
        return Status(name, "LINK LOST: trying again", alarm=True)
    state = {True: "ARMED", False: "disarmed", None: ""}[live.armed]
    return Status(name, f"{state}  {link_words(live.link.loss)}".strip())


def link_words(loss: float) -> str:
    """How good a link is, from the share of its frames that is lost."""
    word = next((word for most, word in _LINKS if loss < most), "bad")
    return f"link {word}, {100 * loss:.0f} % lost"


def quit_question(work: Work, live: LiveSnapshot | None, doing: str) -> str:
    """What would be lost by quitting; empty where nothing."""
    if doing == WRITING:
        return "The vehicle is being written. Quitting puts everything back first. Quit?"
    if work.unwritten:
        return "The results are not written anywhere yet. Quit all the same?"
    moved = live is not None and live.recording and live.situation is not Situation.GROUND
    if moved and not work.kept:
        return "The recording goes on. Quitting ends it; the file stays. Quit?"
    return ""
