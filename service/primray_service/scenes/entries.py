"""Entries of a package: layers that can be its root, and the one that a job selects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..problems import Problem
from .recognize import LAYER_SUFFIXES

ROOT_SUFFIXES = (*LAYER_SUFFIXES, ".usdz")
SHOWN = 50


def layers(paths: Iterable[str]) -> list[str]:
    """Return the layers that can be a job's entry."""
    return sorted(path for path in paths if path.lower().endswith(ROOT_SUFFIXES) and not _is_left_over(path))


def candidates(paths: Iterable[str]) -> list[str]:
    """Return the layers in the outermost folder that has any: those further in are referenced by them."""
    found = layers(paths)
    outermost = min((path.count("/") for path in found), default=0)
    return [path for path in found if path.count("/") == outermost]


def choose(entry: str | None, roots: Sequence[str], known: Sequence[str] | None = None) -> str | None:
    """Return a job's entry: the requested one, or the only candidate. None if nothing is known of the package yet.

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
            f"The package has {len(roots)} layers that can be its root; name one of them as the scene's `entry`.",
            candidates=list(roots[:SHOWN]),
        )
    return roots[0] if roots else None


def _is_left_over(path: str) -> bool:
    """Return whether the path is one that macOS adds to zips, or a hidden file."""
    return any(part == "__MACOSX" or part.startswith(".") for part in path.split("/"))
