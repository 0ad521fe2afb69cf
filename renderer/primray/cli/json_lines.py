"""Output of `--json`: one JSON object per line on stdout, each with a "type" (progress, report, scene, error)."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any


def print_line(line: Mapping[str, Any]) -> None:
    print(dumps(line, ascii=not _is_unicode(sys.stdout)), flush=True)


def dumps(value: Any, *, indent: int | None = None, ascii: bool = False) -> str:
    """Return strict JSON, with null for numbers that are not finite.

    Bytes of a file name that are not UTF-8 are escaped, and with `ascii` every character beyond ASCII.
    """
    text = json.dumps(_finite(value), indent=indent, ensure_ascii=ascii, allow_nan=False)
    return text.encode("utf-8", "backslashreplace").decode()  # lone surrogates become \udcxx, which is valid JSON


def _is_unicode(stream: Any) -> bool:
    return str(getattr(stream, "encoding", None) or "utf-8").lower().replace("-", "").startswith("utf")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
