"""The overview: what needs attention leads, every log is linked, nothing in it is obeyed."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from browser_checks import axe_findings, show
from chromium import chromium_page, find_chromium
from made_flights import MOTOR, fleet, log_of, row

from magcomp.fleet.as_html import MOST_FLIGHTS, html
from magcomp.fleet.row import without_fit


class Reader(HTMLParser):
    """Which elements a page has, and what they say."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.said: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name == "href"]

    def handle_data(self, data: str) -> None:
        self.said.append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    return reader


def test_what_needs_attention_leads_and_links_its_reports() -> None:
    rows = [
        row(0, uid="fine"),
        row(1, uid="bad", before_deg=33.0),
        row(2, uid="so-so", before_deg=3),
    ]
    page = html(fleet(rows), {rows[1].digest[:32]: "reports/one.html"})
    found = read(page)
    text = " ".join(found.said)
    assert text.index("bad") < text.index("so-so") < text.index("fine")
    assert "1 aircraft to act on now, 1 to look at" in text
    assert "reports/one.html" in found.links
    anchors = {link[1:] for link in found.links if link.startswith("#")}
    assert anchors == set(re.findall(r'id="(a\d+)"', page)) == {"a0", "a1"}


def test_nothing_of_a_log_is_obeyed() -> None:
    evil = '<script>alert(1)</script>"><img src=x onerror=y>\x1b[0m'
    rows = [row(0, uid=evil, firmware=evil, before_deg=20.0, reasons=evil, verdict="marginal")]
    bad = without_fit(log_of(row(2)), "f" * 64, evil)
    page = html(fleet([*rows, *bad]), {rows[0].digest[:32]: quote(evil)})
    assert {"script", "img"}.isdisjoint(read(page).tags)
    assert "\x1b" not in page


def test_many_flights_are_shown_as_the_newest() -> None:
    rng = np.random.default_rng(0)
    rows = [row(k, MOTOR + 0.01 * rng.normal(size=3), before_deg=9.0) for k in range(60)]
    page = html(fleet(rows), {})
    assert page.count("flight000") == MOST_FLIGHTS
    assert page.count("<circle") >= 60
    assert "60 flights together" in page


@pytest.mark.slow
@pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine")
def test_it_stands_up_in_a_browser(tmp_path: Path) -> None:
    path = tmp_path / "fleet.html"
    rows = [row(k, uid=f"uid{k % 3}", before_deg=float(k), verdict="good") for k in range(12)]
    bad = without_fit(log_of(row(20)), "f" * 64, "it holds no compass")
    path.write_text(html(fleet([*rows, *bad]), {}), encoding="utf-8")
    with chromium_page(tmp_path / "profile") as browser:
        for width in (1280, 390):
            show(browser, path, width, until="document.readyState === 'complete'")
            assert browser.complaints() == []
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
            assert axe_findings(browser) == []


def test_an_empty_fleet_is_a_page() -> None:
    assert "No aircraft needs attention" in html(fleet([]), {})
