"""What a log says of itself is shown and never obeyed: by a terminal, a page, a table, a shell."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest
from report_analyses import Case, flown
from report_page import content_of

from magcomp.model import Analysis, Recording
from magcomp.report import as_json, as_text
from magcomp.report.as_html import html
from magcomp.report.as_markdown import markdown
from magcomp.report.look import Look

EVIL = "\x1b[2J\x07<script>alert(1)</script>\x9b31m=1+1|`x`\u202egnp.\r\n# lie\x00"
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


@cache
def hostile() -> tuple[Recording, Analysis]:
    """A flight that says nonsense wherever a log holds words."""
    made: Case = flown()
    vehicle = replace(made.recording.vehicle, firmware=EVIL, board=EVIL, kind=EVIL)
    recording = replace(made.recording, source=EVIL, vehicle=vehicle)
    (result,) = made.analysis.compasses
    fit = replace(result.fit, why=EVIL, origin=result.fit.origin)
    verdict = replace(result.verdict, reasons=(EVIL, *result.verdict.reasons))
    told = replace(result, fit=fit, verdict=verdict)
    analysis = replace(
        made.analysis, source=EVIL, vehicle=vehicle, compasses=(told,), notes=(EVIL,)
    )
    return recording, analysis


def terminal(verbose: bool = False, **more: str) -> str:
    _, analysis = hostile()
    return as_text.analysis_text(analysis, {}, {}, Look(), verbose=verbose, **more)


def checked() -> str:
    recording, analysis = hostile()
    verdicts = {each.fit.compass: each.verdict for each in analysis.compasses}
    return as_text.check_text(recording, verdicts, "current", Look())


def report() -> str:
    return markdown(as_json.analysis_object(hostile()[1]), {})


def page() -> str:
    return html(*hostile(), options=flown().options)


SHOWN: dict[str, Callable[[], str]] = {
    "terminal": terminal,
    "terminal -v": lambda: terminal(verbose=True),
    "check": checked,
    "markdown": report,
    "page": page,
}


@pytest.mark.parametrize("where", SHOWN)
def test_no_control_character_comes_through(where: str) -> None:
    text = SHOWN[where]()
    assert "alert(1)" in text
    assert not CONTROL.search(text)


def test_no_word_of_a_log_becomes_a_line_of_its_own() -> None:
    for where in ("terminal", "terminal -v", "check", "markdown"):
        assert not re.search(r"^\s*# lie", SHOWN[where](), re.MULTILINE), where


def test_no_word_of_a_log_becomes_part_of_the_page() -> None:
    found = content_of(page())
    assert not any("alert" in script for script in found.scripts.values() if "{" not in script)
    assert found.json("result")["source"] == EVIL
    assert "script" in found.tags
    assert page().count("<script>alert") == 0


def test_json_is_ascii_and_says_exactly_what_the_log_said() -> None:
    text = as_json.dumps(as_json.analysis_object(hostile()[1]))
    assert text.isascii()
    assert not CONTROL.search(text)
