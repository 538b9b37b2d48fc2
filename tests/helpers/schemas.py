"""A JSON report against the schema that it names."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema

SCHEMAS = {
    path.name.removesuffix(".schema.json"): json.loads(path.read_text())
    for path in (Path(__file__).parents[2] / "docs/schemas").glob("*.json")
}


def validated(text: str) -> dict[str, Any]:
    """The report, once it agrees with its schema."""
    report = json.loads(text)
    assert isinstance(report, dict)
    jsonschema.validate(report, SCHEMAS[report["schema"].removeprefix("dripmill.")])
    return report
