"""Diagnostics: everything that a stage specifies and that was ignored, approximated, defaulted or missing.

Each has a code (see diagnostic_codes.py) and a prim path. `Refusal` combines the settings `strict`, `fail_on` and `allow`, by
which diagnostics refuse a stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice

from .diagnostic_codes import CODES, Kind, Severity
from .errors import SettingsError, UnsupportedError, did_you_mean


@dataclass(frozen=True)
class Diagnostic:
    """One diagnostic: what happened, to which prim."""

    severity: Severity
    code: str
    prim_path: str
    message: str
    attribute: str = ""  # attribute or relationship concerned, as the schema names it; "": the prim as a whole

    @property
    def kind(self) -> Kind:
        return CODES[self.code].kind

    @property
    def is_strict(self) -> bool:
        """Return whether `--strict` refuses the stage because of this.

        It refuses warnings and errors that make the picture differ from what was authored.
        """
        return self.severity is not Severity.INFO and self.kind.changes_picture

    def as_json(self) -> dict[str, str]:
        return {
            "severity": self.severity.value,
            "kind": self.kind.value,
            "code": self.code,
            "prim_path": self.prim_path,
            "attribute": self.attribute,
            "message": self.message,
        }


class Diagnostics:
    """An ordered collection of diagnostics; a code repeated on one prim with the same message is kept once."""

    def __init__(self, shown: Callable[[str], str] | None = None) -> None:
        self._seen: dict[Diagnostic, None] = {}
        self._shown = shown

    def name_files(self, shown: Callable[[str], str]) -> None:
        """Rewrite messages with `shown` from now on, so that they use the user's file names."""
        self._shown = shown

    def shown(self, message: str) -> str:
        return message if self._shown is None else self._shown(message)

    def add(self, code: str, prim_path: str, message: str, attribute: str = "") -> None:
        """Add a diagnostic. KeyError if the code is not in `CODES`."""
        self._seen.setdefault(Diagnostic(CODES[code].severity, code, prim_path, self.shown(message), attribute))

    def extend(self, others: Iterable[Diagnostic]) -> None:
        for diagnostic in others:
            self._seen.setdefault(diagnostic)

    def forget_after(self, count: int) -> None:
        """Keep only the first `count` diagnostics, because the work that produced the rest is repeated."""
        self._seen = dict.fromkeys(islice(self._seen, count))

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._seen)

    def __len__(self) -> int:
        return len(self._seen)

    def raise_if_refused(self, refusal: Refusal) -> None:
        """Raise UnsupportedError with the first refused diagnostic and their count; its code is `strict` or `fail-on`."""
        bad = [(flag, d) for d in self._seen if (flag := refusal.flag(d.code, d.is_strict)) is not None]
        if bad:
            flag, first = bad[0]
            more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
            at = f"{first.attribute}: " if first.attribute else ""
            message = f"{flag}: {first.code}: {at}{first.message}{more}"
            error = UnsupportedError(message, where=first.prim_path, code=flag.removeprefix("--"))
            error.refused = tuple(diagnostic.as_json() for _, diagnostic in bad)
            raise error


# Names for groups of codes. Any file that is missing or unreadable is reported with one of the codes of "missing".
GROUPS: dict[str, tuple[str, ...]] = {
    "missing": ("composition-error", "materialx-document", "asset-missing", "tile-missing", "texture-unreadable"),
}


@dataclass(frozen=True)
class Refusal:
    """The diagnostics for which a stage is refused.

    `fail_on` and `allow` hold diagnostic codes or names of `GROUPS`; allowed codes always pass.
    """

    strict: bool = False
    fail_on: tuple[str, ...] = ()
    allow: tuple[str, ...] = ()

    def flag(self, code: str, changes_picture: bool) -> str | None:
        """Return the command-line flag that refuses a diagnostic, or None if it passes.

        `changes_picture`: the diagnostic is a warning or error that makes the picture differ from what was authored.
        """
        if self.allows(code):
            return None
        if code in codes_of(self.fail_on):
            return "--fail-on"
        return "--strict" if self.strict and changes_picture else None

    def allows(self, code: str) -> bool:
        return code in codes_of(self.allow)


STRICT = Refusal(strict=True)


def codes_of(names: Iterable[str]) -> frozenset[str]:
    """Return the codes that are named, with groups expanded."""
    return frozenset(code for name in names for code in GROUPS.get(name, (name,)))


def check_codes(names: Iterable[str], where: str) -> None:
    """Raise SettingsError for a name that is neither a diagnostic code nor a group."""
    known = [*GROUPS, *CODES]
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known, "docs/diagnostics.md lists them")
            raise SettingsError(f"unknown diagnostic {name!r}; {hint}", where=where, code="unknown-diagnostic")


UNFINISHED = "picture-unfinished"


@contextmanager
def kept_without(what: str, diagnostics: Diagnostics) -> Iterator[None]:
    """Report any exception in the block as `what` being missing, and continue.

    Hours of samples are worth more than a clean failure. Requests that cannot be fulfilled are refused before sampling, so this
    covers the unforeseen: memory, a library, a disk.
    """
    try:
        yield
    except Exception as error:
        diagnostics.add(UNFINISHED, "", f"{what} is missing: {error or type(error).__name__}")
