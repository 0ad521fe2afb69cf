"""Which diagnostics make primray refuse a stage: the settings `strict`, `fail_on` and `allow` combined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .diagnostic_codes import CODES
from .errors import SettingsError, did_you_mean

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
            raise SettingsError(f"there is no diagnostic {name!r}; {hint}", where=where, code="unknown-diagnostic")
