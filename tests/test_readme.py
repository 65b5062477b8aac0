"""The README says nothing that a newcomer's hands could not repeat."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from magcomp.cli.app import COMMANDS, run
from magcomp.mavproxy.commands import USAGE
from magcomp.writing.files import SUFFIXES

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SOURCE = " ".join(
    re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8"))
    for path in sorted((ROOT / "magcomp").rglob("*.py"))
)


def test_the_python_example_runs(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(example, "README.md", "exec"), {})  # noqa: S102 - our own page
    lines = capsys.readouterr().out.splitlines()
    assert "mGauss per A" in lines[0]
    assert lines[-1] == "2.0"
    assert all("° now, at most" in line for line in lines[1:-1])


@pytest.mark.slow
def test_the_first_answer_is_what_fit_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "sitl_fixtures").symlink_to(ROOT / "sitl_fixtures")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    (command, shown) = re.findall(r"    \$ magcomp (.+)\n\n((?:    .*\n|\n)+)", README)[0]
    run(command.split())
    printed = capsys.readouterr().out.splitlines()
    assert [line[4:] for line in shown.rstrip().splitlines()] == printed


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_command_it_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = set(re.findall(r"(?:^    |`|\$ )(?:\.venv/bin/)?magcomp ([a-z]+)", text, re.MULTILINE))
    at_the_prompt = {line.split()[1] for line in USAGE} if page.name == "mavproxy.md" else set()
    assert named <= set(COMMANDS) | at_the_prompt


def test_every_message_it_explains_is_one_that_is_said() -> None:
    table = README.partition("## When something goes wrong")[2].partition("Exit codes")[0]
    messages = re.findall(r"^\| (?!it says|-)(.+?) \|", table, re.MULTILINE)
    assert len(messages) >= 8
    for message in messages:
        for part in filter(None, (each.strip() for each in message.split("…"))):
            # A number is made when it is said.
            pieces = (re.escape(each.strip()) for each in re.split(r"\d+", part))
            pattern = r".{0,30}".join(each.replace(r"\ ", r"\W+") for each in pieces)
            assert re.search(pattern, SOURCE), f"nothing says {part!r}"


def test_the_parameter_files_it_names_are_written() -> None:
    assert set(re.findall(r"compass(\.param\w*|\.parm)\b", README)) <= set(SUFFIXES)


def test_anchors_lead_to_headings() -> None:
    headings = re.findall(r"^#+ (.+)$", README, re.MULTILINE)
    slugs = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    assert set(re.findall(r"\]\(#([^)]+)\)", README)) <= slugs
