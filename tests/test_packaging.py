"""What is installed, and with what, is written down once and alike everywhere."""

from __future__ import annotations

import re
import tomllib
from importlib import resources
from pathlib import Path

import magcomp

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WORKFLOW = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
LOCK = (ROOT / "requirements-dev.lock").read_text(encoding="utf-8")


def name_of(requirement: str) -> str:
    found = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert found is not None, requirement
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def pythons(text: str) -> set[str]:
    return set(re.findall(r"\b3\.1\d\b", text))


def test_the_version_stands_in_the_package_and_nowhere_else() -> None:
    project = PROJECT["project"]
    assert "version" not in project
    assert project["dynamic"] == ["version"]
    where = ROOT / PROJECT["tool"]["hatch"]["version"]["path"]
    assert f'__version__ = "{magcomp.__version__}"' in where.read_text(encoding="utf-8")


def test_users_type_checkers_see_the_types() -> None:
    assert resources.files("magcomp").joinpath("py.typed").is_file()


def test_the_lock_holds_every_package_that_is_asked_for_with_its_hash() -> None:
    project = PROJECT["project"]
    # "dev" asks for the project's own extras, which are no package.
    extras = project["optional-dependencies"].values()
    asked = {*project["dependencies"], *(each for extra in extras for each in extra)}
    asked -= {each for each in asked if each.startswith(f"{project['name']}[")}
    locked = re.findall(r"^([a-z0-9-]+)==\S+(?: ;.*)? \\\n\s+--hash=sha256:", LOCK, re.MULTILINE)
    assert {name_of(requirement) for requirement in asked} <= set(locked)
    assert len(re.findall(r"^\S+==", LOCK, re.MULTILINE)) == len(locked)


def test_hosted_ci_runs_every_python_that_is_promised_on_three_systems() -> None:
    promised = pythons(" ".join(PROJECT["project"]["classifiers"]))
    matrix = re.search(r"python: \[(.*)\]", WORKFLOW)
    assert matrix is not None
    assert pythons(matrix[1]) == promised
    assert {"ubuntu-latest", "macos-latest", "windows-latest"} <= set(
        re.findall(r"\w+-latest", WORKFLOW)
    )
