"""docs/schema/, and a test of a document against it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema

from magcomp.report import as_json

SCHEMA: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "docs" / "schema" / f"magcomp-{as_json.SCHEMA}.json").read_text(
        encoding="utf-8"
    )
)


def strict(schema: Any) -> Any:
    """The schema, where a key that it does not name is a fault."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    named = {key: strict(value) for key, value in schema.items()}
    return {"additionalProperties": False, **named} if "properties" in schema else named


def must_be(command: str, document: object) -> None:
    jsonschema.validate(document, {**strict(SCHEMA), "$ref": f"#/$defs/{command}"})
