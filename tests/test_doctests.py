"""The examples in the docstrings of numerical functions print what they say."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "magcomp"

# Only these are imported: a module without an example costs nothing.
WITH_EXAMPLES = [
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
    for path in sorted(PACKAGE.rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]

NUMERICAL = {
    "magcomp.geometry",
    "magcomp.earth",
    "magcomp.compensate.equations",
    "magcomp.fit.ellipsoid",
    "magcomp.fit.line",
    "magcomp.fit.residual",
    "magcomp.fit.robust",
    "magcomp.judge.heading_error",
}


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_print_what_they_say(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def test_numerical_modules_have_examples() -> None:
    assert set(WITH_EXAMPLES) >= NUMERICAL


@pytest.mark.parametrize("name", ["magcomp.geometry", "magcomp.compensate.equations"])
def test_every_public_function_of_the_geometry_has_one(name: str) -> None:
    module = importlib.import_module(name)
    bare = [
        key
        for key, value in vars(module).items()
        if callable(value)
        and getattr(value, "__module__", None) == name
        and not key.startswith("_")
        and ">>> " not in (value.__doc__ or "")
    ]
    assert bare == []
