"""Which layers of a package can be its root, and which of them a job means."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..problems import Problem
from .recognize import LAYER_SUFFIXES

ROOT_SUFFIXES = (*LAYER_SUFFIXES, ".usdz")
SHOWN = 50


def layers(paths: Iterable[str]) -> list[str]:
    """Those that may be named as a job's entry."""
    return sorted(path for path in paths if path.lower().endswith(ROOT_SUFFIXES) and not _is_left_over(path))


def candidates(paths: Iterable[str]) -> list[str]:
    """The layers in the outermost folder that has any: what is further in is referred to by them."""
    found = layers(paths)
    outermost = min((path.count("/") for path in found), default=0)
    return [path for path in found if path.count("/") == outermost]


def choose(entry: str | None, roots: Sequence[str], known: Sequence[str] | None = None) -> str | None:
    """The entry of a job: the one asked for, or the only candidate. None where nothing is known of the package yet.

    `roots`: candidates; `known`: all layers (None: those in `roots`).
    """
    if entry is not None:
        choice = known if known is not None else roots
        if choice and entry not in choice:
            raise Problem("entry-missing", f"The package has no layer {entry!r}.", candidates=list(roots[:SHOWN]))
        return entry
    if len(roots) > 1:
        raise Problem(
            "ambiguous-entry",
            f"The package has {len(roots)} layers that could be the root; name one of them as the scene's `entry`.",
            candidates=list(roots[:SHOWN]),
        )
    return roots[0] if roots else None


def _is_left_over(path: str) -> bool:
    """What macOS adds to zips, and hidden files."""
    return any(part == "__MACOSX" or part.startswith(".") for part in path.split("/"))
