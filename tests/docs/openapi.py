"""schemas/: the API's document and the contracts in it, as files. `python -m tests.docs.openapi` brings them up to date."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from primray_service.app import operations
from primray_service.http.described import REF
from primray_service.http.openapi import openapi

FOLDER = Path(__file__).parents[2] / "schemas"
CONTRACTS = {
    "job": "Job",
    "job-request": "JobRequest",
    "problem": "Problem",
    "event": "Event",
    "frame": "Frame",
    "scene": "Scene",
}

Json = dict[str, Any]


def files() -> dict[str, str]:
    """Their texts by name."""
    document = openapi(operations())
    schemas = document["components"]["schemas"]
    texts = {f"{name}.schema.json": _text(alone(schemas, schema)) for name, schema in CONTRACTS.items()}
    return {"openapi.json": _text(document), **texts}


def alone(schemas: Json, name: str) -> Json:
    """A schema with all that it refers to, as a document of JSON Schema."""
    needed: set[str] = set()
    waiting = [name]
    while waiting:
        one = waiting.pop()
        needed.add(one)
        waiting += [ref for ref in references(schemas[one]) if ref not in needed]
    definitions = {other: moved(schemas[other]) for other in sorted(needed - {name})}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **moved(schemas[name]),
        **({"$defs": definitions} if definitions else {}),
    }


def references(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        if isinstance(value.get("$ref"), str):
            yield value["$ref"].removeprefix(REF)
        for member in value.values():
            yield from references(member)
    elif isinstance(value, list):
        for member in value:
            yield from references(member)


def moved(value: Any) -> Any:
    """With references to $defs."""
    if isinstance(value, dict):
        return {
            name: member.replace(REF, "#/$defs/") if name == "$ref" and isinstance(member, str) else moved(member)
            for name, member in value.items()
        }
    return [moved(member) for member in value] if isinstance(value, list) else value


def _text(value: Json) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, text in files().items():
        (FOLDER / name).write_text(text)
        print(f"schemas/{name}")
