"""What the code cites stands in the documentation under that very heading."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = ("method", "autopilots")

CITATION = re.compile(r"docs/(method|autopilots)\.md,\s+(.{0,80})", re.DOTALL)
SERIES = re.compile(r"(Equation)s (\d+) (?:to|and) (\d+)")


def sources() -> Iterator[Path]:
    for folder in ("magcomp", "tests", "benchmarks"):
        yield from sorted((ROOT / folder).rglob("*.py"))


def headings(document: str) -> set[str]:
    """A heading up to its colon where it has a number, else the whole of it."""
    text = (ROOT / "docs" / f"{document}.md").read_text(encoding="utf-8")
    found = set(re.findall(r"^#{2,} (.+)$", text, re.MULTILINE))
    return found | {heading.split(":")[0] for heading in found if re.search(r"\d", heading)}


def citations() -> list[tuple[str, str, str]]:
    """Where, which document, and the words that begin with the heading."""
    found = []
    for path in sources():
        if path == Path(__file__):
            continue
        text = path.read_text(encoding="utf-8").replace("#", " ")
        for match in CITATION.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            words = " ".join(match[2].split())
            found.append((f"{path.relative_to(ROOT).as_posix()}:{line}", match[1], words))
    return found


def named(words: str) -> list[str]:
    """The headings that a citation's words name: one, or each of a series."""
    series = SERIES.match(words)
    if series is None:
        return [words]
    return [f"{series[1]} {number}" for number in range(int(series[2]), int(series[3]) + 1)]


def is_named(words: str, known: set[str]) -> bool:
    # "Equation 1" must not pass for a citation of Equation 17.
    return any(re.match(rf"{re.escape(heading)}(?!\w)", words) for heading in known)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_citation_names_a_heading(document: str) -> None:
    known = headings(document)
    cited = [(where, words) for where, of, words in citations() if of == document]
    assert len(cited) >= 10, "the search for citations must find them"
    stray = [f"{w}: {t}" for w, t in cited if not all(is_named(n, known) for n in named(t))]
    assert stray == []


def test_no_citation_names_a_document_without_a_place_in_it() -> None:
    stray = [
        path.relative_to(ROOT).as_posix()
        for path in sources()
        if path != Path(__file__)
        and re.search(
            r"(PAPER|AUTOPILOTS|PX4_FACTS)\.md|docs/(method|autopilots)\.md(?!,\s)",
            path.read_text(encoding="utf-8"),
        )
    ]
    assert stray == []


def test_every_equation_of_the_paper_has_a_heading_of_its_own() -> None:
    assert {f"Equation {number}" for number in range(1, 17)} <= headings("method")


@pytest.mark.parametrize(
    "page", [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md"], ids=lambda path: path.name
)
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", text):
        assert (page.parent / target).exists(), f"{page.name}: {target}"
