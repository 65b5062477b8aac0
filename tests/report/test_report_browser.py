"""The page in a real browser: it draws, without errors, without a network."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser_checks import DRAWN, assert_clean, axe_findings, clipped_labels, prefer, show
from chromium import Page, chromium_page, find_chromium
from report_analyses import refused, still

from magcomp.analysis import Options, analyse
from magcomp.report import words
from magcomp.report.as_html import html

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine"),
]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with chromium_page(tmp_path_factory.mktemp("profile")) as page:
        yield page


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recording = still().recording
    options = Options(compass=1)
    path = tmp_path_factory.mktemp("good") / "report.html"
    path.write_text(html(recording, analyse(recording, options)), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = refused()
    path = tmp_path_factory.mktemp("bad") / "report.html"
    path.write_text(html(made.recording, made.analysis, options=made.options), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def shown(browser: Page, good: Path) -> Page:
    """The good report on a desk's screen."""
    show(browser, good)
    return browser


def test_every_picture_is_drawn_without_errors_and_without_a_network(
    shown: Page, good: Path
) -> None:
    assert_clean(shown, good)
    marks = "document.querySelectorAll('.canvas .points path, .canvas .lines path').length"
    assert shown.evaluate(marks) > 100
    assert shown.evaluate("document.querySelectorAll('.canvas canvas').length") >= 2


def test_it_follows_a_change_to_dark_and_back(shown: Page, good: Path) -> None:
    point = "getComputedStyle(document.querySelector('#heading-1 .points path')).fill"
    light = shown.evaluate(point)
    prefer(shown, "dark")
    shown.wait_for(f"{point} !== '{light}'")
    prefer(shown, "light")
    shown.wait_for(f"{point} === '{light}'")
    assert_clean(shown, good)


def test_it_prints_and_is_itself_again_afterwards(shown: Page, good: Path) -> None:
    width = "document.querySelector('#strength-1 svg').clientWidth"
    before = shown.evaluate(width)
    printed = base64.b64decode(shown.call("Page.printToPDF")["data"])
    assert printed.startswith(b"%PDF")
    shown.wait_for(f"{width} === {before}")
    assert_clean(shown, good)


MOVE = """(block, value, mode) => {
  const find = (what) => document.querySelector(`${block} ${what}`);
  const slider = find("input[type=range]");
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  find(`input[value=${mode}]`).click();
  return find(".said").textContent;
}"""


def move(page: Page, value: float, mode: str) -> str:
    """Move the slider and the switch of compass 1; what the page then says."""
    said: str = page.evaluate(f"({MOVE})('#compass-1', {value}, '{mode}')")
    return said


# A picture is drawn anew in the frame after the one in which its slider moved.
TWO_FRAMES = "new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(() => go(0))))"

MIDDLE = """(name) => {
  const trace = document.getElementById("cloud-1").data.find((each) => each.name === name);
  return [trace.x, trace.y, trace.z].map((every) => {
    const known = every.filter((value) => value !== null);
    return known.reduce((sum, value) => sum + value, 0) / known.length;
  });
}"""


def middle(page: Page, trace: str = "readings") -> list[float]:
    """Mean position of a trace of the field in space."""
    found: list[float] = page.evaluate(f"({MIDDLE})('{trace}')")
    return found


def test_the_slider_moves_cloud_centre_and_needle(shown: Page) -> None:
    compass = still().document["compasses"][0]
    centre = still().analysis.compasses[0].fit.correction.centre
    hand = "document.querySelector('#compass-1 .hand').getAttribute('transform')"
    turn = {}
    place = {}
    for value in (20, 80):
        move(shown, value, "raw")
        shown.wait_for(f"document.querySelector('#compass-1 output').textContent === '{value} %'")
        shown.evaluate(TWO_FRAMES)
        place[value] = np.array([middle(shown), middle(shown, "centre")])
        turn[value] = float(re.findall(r"[\d.]+", shown.evaluate(hand))[0])
    for moved in place[80] - place[20]:
        assert moved == pytest.approx(centre(0.8) - centre(0.2), abs=0.2)
    for row in compass["heading_error_deg"]:
        if round(100 * row["u"]) in turn:
            assert turn[round(100 * row["u"])] == pytest.approx(max(row["before"], row["p95"]))


def test_corrected_readings_stand_still_and_the_needle_is_within_the_bound(shown: Page) -> None:
    compass = still().document["compasses"][0]
    rows = {round(100 * row["u"]): row for row in compass["heading_error_deg"]}
    for value in (20, 80):
        said = move(shown, value, "corrected")
        assert f"at most {words.degrees(rows[value]['p95'])} wrong" in said
        shown.evaluate(TWO_FRAMES)
        assert np.abs(middle(shown, "centre")).max() < 0.5
    move(shown, 50, "measured")


def test_three_compasses_print_on_five_pages(browser: Page, tmp_path: Path) -> None:
    made = still()
    path = tmp_path / "three.html"
    path.write_text(html(made.recording, made.analysis), encoding="utf-8")
    assert len(made.analysis.compasses) == 3
    show(browser, path)
    printed = base64.b64decode(browser.call("Page.printToPDF")["data"])
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 5


def test_a_phone_shows_a_rejected_fit_without_scrolling_sideways(browser: Page, bad: Path) -> None:
    show(browser, bad, width=390)
    assert_clean(browser, bad)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize(("which", "width"), [("good", 1280), ("bad", 390)])
def test_axe_finds_nothing(
    browser: Page, which: str, width: int, request: pytest.FixtureRequest
) -> None:
    show(browser, request.getfixturevalue(which), width)
    for scheme in ("light", "dark"):
        prefer(browser, scheme)
        assert axe_findings(browser) == []


@pytest.mark.parametrize("which", ["good", "bad"])
@pytest.mark.parametrize("width", [390, 1280])
def test_no_label_is_cut(
    browser: Page, which: str, width: int, request: pytest.FixtureRequest
) -> None:
    show(browser, request.getfixturevalue(which), width)
    assert clipped_labels(browser) == []


def test_the_check_would_notice_an_error_and_a_request(browser: Page, tmp_path: Path) -> None:
    page = tmp_path / "faulty.html"
    page.write_text(
        "<!DOCTYPE html><img src='http://127.0.0.1:9/x.png'><script>"
        "addEventListener('load', () => { document.documentElement.dataset.drawn = 1; });"
        "throw new Error('on purpose')</script>"
    )
    browser.events.clear()
    browser.open(page)
    browser.wait_for(DRAWN)
    assert "http://127.0.0.1:9/x.png" in browser.requests()
    assert any("Uncaught" in complaint for complaint in browser.complaints())
