"""The page in a real browser: it draws, without errors, without a network."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from chromium import Page, chromium_page, find_chromium
from report_analyses import refused, still

from magcomp.analysis import Options, analyse
from magcomp.report.as_html import html

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine"),
]

LOCAL = ("file:", "data:", "blob:")
DRAWN = "document.documentElement?.dataset.drawn"


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


def prefer(browser: Page, scheme: str) -> None:
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.call("Emulation.setEmulatedMedia", features=features)


def show(browser: Page, path: Path, width: int = 1280) -> None:
    browser.call(
        "Emulation.setDeviceMetricsOverride",
        width=width,
        height=900,
        deviceScaleFactor=1,
        mobile=width < 500,
    )
    browser.call("Emulation.setTouchEmulationEnabled", enabled=width < 500)
    prefer(browser, "light")
    browser.open(path)
    browser.wait_for(DRAWN)


def assert_clean(browser: Page, path: Path) -> None:
    """Every picture is drawn; nothing complained; nothing was asked for from elsewhere."""
    canvases = browser.evaluate("document.querySelectorAll('.canvas').length")
    assert canvases > 0
    assert browser.evaluate(f"Number({DRAWN})") == canvases
    assert browser.complaints() == []
    requests = browser.requests()
    assert path.resolve().as_uri() in requests
    assert [url for url in requests if not url.startswith(LOCAL)] == []


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
