"""Diagnostics: whatever a stage asks for that is ignored, approximated, defaulted or missing, with its code and prim path.

`CODES` is the one table of codes; the documentation's list of what is and isn't supported is generated from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

from .errors import UnsupportedError


class Severity(Enum):
    INFO = "info"  # defaulted or chosen by us; the picture is what the stage says
    WARNING = "warning"  # approximated or ignored; the picture may differ from what the stage says
    ERROR = "error"  # a part is missing from the picture


@dataclass(frozen=True)
class Diagnostic:
    severity: Severity
    code: str
    prim_path: str
    message: str

    def as_json(self) -> dict[str, str]:
        return {"severity": self.severity.value, "code": self.code, "prim_path": self.prim_path, "message": self.message}


@dataclass(frozen=True)
class Code:
    severity: Severity
    meaning: str


# code -> severity and what it means; add a row here before using a new code.
CODES: dict[str, Code] = {
    "texture-bad-texels": Code(Severity.WARNING, "Texels of a texture that are negative or not finite are read as 0."),
    "texture-unreadable": Code(Severity.ERROR, "A light whose texture cannot be read is left out."),
}


class Diagnostics:
    """An ordered collection of diagnostics; a code repeated on one prim with the same message is kept once."""

    def __init__(self) -> None:
        self._seen: dict[Diagnostic, None] = {}

    def add(self, code: str, prim_path: str, message: str) -> None:
        """Record one; KeyError if the code is not in `CODES`."""
        self._seen.setdefault(Diagnostic(CODES[code].severity, code, prim_path, message))

    def extend(self, others: Iterable[Diagnostic]) -> None:
        for diagnostic in others:
            self._seen.setdefault(diagnostic)

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._seen)

    def __len__(self) -> int:
        return len(self._seen)

    def raise_if_strict(self) -> None:
        """UnsupportedError naming the first warning or error and their number; information passes."""
        bad = [d for d in self._seen if d.severity is not Severity.INFO]
        if bad:
            more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
            raise UnsupportedError(f"--strict: {bad[0].code}: {bad[0].message}{more}", where=bad[0].prim_path, code="strict")
