"""What ``--json`` prints is what docs/schema/ says, no key less and none that it does not name."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import pytest
from json_schema import SCHEMA, must_be
from report_analyses import case, still
from truth import FIXTURES

from magcomp.analysis import Options, check, regressor_in_force
from magcomp.cli.app import run
from magcomp.report import as_json

PARTS = {"grade", "schema", "vehicle", "coverage", "heading_error", "lags", "compass_fit"}
"""Definitions of what is part of the others."""


def printed(document: object) -> Any:
    assert isinstance(document, dict)
    return json.loads(as_json.dumps(document))


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


def test_a_fit_is_as_the_schema_says() -> None:
    must_be("fit", still().document)


def test_a_fit_with_levels_and_a_line_is_as_the_schema_says() -> None:
    document = case("turntable_five_levels", Options(compass=1, end=200.0)).document
    assert document["compasses"][0]["line"]
    assert document["compasses"][0]["levels"]
    must_be("fit", document)


def test_a_check_is_as_the_schema_says() -> None:
    recording = still().recording
    verdicts = check(recording, Options())
    document = as_json.check_object(recording, verdicts, regressor_in_force(recording))
    must_be("check", printed(document))


@pytest.mark.parametrize("log", ["sweep_throttle_only.tlog", "flight.BIN", "px4_flight.ulg.gz"])
def test_info_is_as_the_schema_says(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(FIXTURES / log), "--json"]) == 0
    must_be("info", json.loads(capsys.readouterr().out))


def test_a_heading_is_as_the_schema_says(capsys: pytest.CaptureFixture[str]) -> None:
    log = str(FIXTURES / "sweep_throttle_only.tlog")
    assert run(["heading", log, "--json", "--in-force"]) == 0
    must_be("heading", json.loads(capsys.readouterr().out))


@pytest.mark.parametrize("command", sorted(SCHEMA["$defs"].keys() - PARTS))
def test_a_key_that_the_schema_does_not_name_is_seen(command: str) -> None:
    with pytest.raises(jsonschema.ValidationError, match="'novelty' was unexpected"):
        must_be(command, {"novelty": 1})
