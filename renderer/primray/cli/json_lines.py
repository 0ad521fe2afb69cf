"""What `--json` prints to stdout: one JSON object a line, each with its "type" (progress, report, scene, error)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def print_line(line: Mapping[str, Any]) -> None:
    print(dumps(line), flush=True)


def dumps(value: Any, *, indent: int | None = None) -> str:
    """JSON in the strict sense: numbers that are not finite become null."""
    return json.dumps(_finite(value), indent=indent, ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
