"""Which diagnostics refuse a stage: the settings `strict`, `fail_on` and `allow` together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .diagnostic_codes import CODES
from .errors import SettingsError, did_you_mean

# Names of several codes. A file that is not there, or that nobody can read, has one of these codes, whatever names it.
GROUPS: dict[str, tuple[str, ...]] = {
    "missing": ("composition-error", "materialx-document", "asset-missing", "tile-missing", "texture-unreadable"),
}


@dataclass(frozen=True)
class Refusal:
    """What a stage is refused for. `fail_on` and `allow` are codes of diagnostics or names of `GROUPS`; allowed codes pass."""

    strict: bool = False
    fail_on: tuple[str, ...] = ()
    allow: tuple[str, ...] = ()

    def flag(self, code: str, changes_picture: bool) -> str | None:
        """Return the flag that refuses a diagnostic, as the command line names it; None where none does.

        `changes_picture`: it is a warning or an error that leaves the picture other than authored.
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
    """Return the codes that are meant, with those of groups."""
    return frozenset(code for name in names for code in GROUPS.get(name, (name,)))


def check_codes(names: Iterable[str], where: str) -> None:
    """Raise SettingsError for a name that is neither a diagnostic's code nor a group's."""
    known = [*GROUPS, *CODES]
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known, "docs/diagnostics.md lists them")
            raise SettingsError(f"there is no diagnostic {name!r}; {hint}", where=where, code="unknown-diagnostic")
