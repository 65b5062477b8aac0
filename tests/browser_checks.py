"""What every page must stand up to in a real browser."""

from __future__ import annotations

from pathlib import Path

import pytest
from chromium import Page

LOCAL = ("file:", "data:", "blob:")
DRAWN = "document.documentElement?.dataset.drawn"

AXE = """axe.run(document, { resultTypes: ["violations"] }).then(({ violations }) =>
  violations.filter(({ impact }) => impact !== "minor")
    .map(({ impact, id, nodes }) => `${impact}: ${id}: ${nodes.map((n) => n.target)}`))"""

CLIPPED = """[...document.querySelectorAll(".canvas")].flatMap((canvas) => {
  const frame = canvas.getBoundingClientRect();
  return [...canvas.querySelectorAll("svg text")].filter((text) => {
    const box = text.getBoundingClientRect();
    return box.width && (box.left < frame.left - 1 || box.right > frame.right + 1
      || box.top < frame.top - 1 || box.bottom > frame.bottom + 1);
  }).map((text) => `${canvas.id}: ${text.textContent}`);
})"""


def prefer(browser: Page, scheme: str) -> None:
    """Set the machine's light or dark setting."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.call("Emulation.setEmulatedMedia", features=features)


def show(browser: Page, path: Path, width: int = 1280, until: str = DRAWN) -> None:
    """Open a page on a screen of a width, a phone's where it is narrow, and wait."""
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
    browser.wait_for(until)


def assert_clean(browser: Page, path: Path) -> None:
    """Every picture is drawn; nothing complained; nothing was asked for from elsewhere."""
    canvases = browser.evaluate("document.querySelectorAll('.canvas').length")
    assert canvases > 0
    assert browser.evaluate(f"Number({DRAWN})") == canvases
    assert browser.complaints() == []
    requests = browser.requests()
    assert path.resolve().as_uri() in requests
    assert [url for url in requests if not url.startswith(LOCAL)] == []


def axe_findings(browser: Page) -> list[str]:
    """What axe finds hard to use for people who see or move less.

    What it calls minor is left out: plotly gives the pictures in space of one page the same ids.
    """
    axe = Path(pytest.importorskip("axe_core_python").__file__).with_name("axe.min.js")
    browser.evaluate(axe.read_text(encoding="utf-8") + ";0")
    found: list[str] = browser.evaluate(AXE)
    return found


def clipped_labels(browser: Page) -> list[str]:
    """Labels of pictures that stand beyond the picture's edge."""
    found: list[str] = browser.evaluate(CLIPPED)
    return found
