"""The documentation builds as a site, without a word of complaint."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_every_page_is_in_a_table_of_contents() -> None:
    text = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert page.stem == "index" or f"\n{page.stem}\n" in text, page.name


@pytest.mark.slow
def test_the_site_builds_strictly(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    pytest.importorskip("myst_parser")
    pytest.importorskip("furo")
    options = ("-E", "-W", "--keep-going", "-q", "-b", "html")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, ROOT / "docs", tmp_path],
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr.decode()) == (0, "")
    page = (tmp_path / "api.html").read_text(encoding="utf-8")
    for name in ("magcomp.sources.read", "magcomp.analysis.analyse", "magcomp.errors.LogError"):
        assert f'id="{name}"' in page
    assert "Load the parameters" in (tmp_path / "index.html").read_text(encoding="utf-8")
