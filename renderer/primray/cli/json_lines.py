"""What `--json` prints to stdout: one JSON object a line, each with its "type" (progress, report, scene, error)."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any


def print_line(line: Mapping[str, Any]) -> None:
    print(dumps(line, ascii=not _is_unicode(sys.stdout)), flush=True)


def dumps(value: Any, *, indent: int | None = None, ascii: bool = False) -> str:
    """JSON in the strict sense: numbers that are not finite become null. Bytes of a file's name that are no UTF-8 are escaped,
    and with `ascii` every other letter beyond it."""
    text = json.dumps(_finite(value), indent=indent, ensure_ascii=ascii, allow_nan=False)
    return text.encode("utf-8", "backslashreplace").decode()  # lone surrogates: \udcxx is JSON too


def _is_unicode(stream: Any) -> bool:
    return str(getattr(stream, "encoding", None) or "utf-8").lower().replace("-", "").startswith("utf")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
