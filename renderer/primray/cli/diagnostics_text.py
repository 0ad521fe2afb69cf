"""Diagnostics as a person reads them: grouped by code, worst first, with the first few prims of each."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping

_ORDER = ("error", "warning", "info")
_PRIMS_SHOWN = 3


def print_diagnostics(diagnostics: Iterable[Mapping[str, str]], *, verbose: bool) -> None:
    """To stderr: stdout is for what was asked for."""
    for line in diagnostics_lines(diagnostics, verbose=verbose):
        print(line, file=sys.stderr)


def diagnostics_lines(diagnostics: Iterable[Mapping[str, str]], *, verbose: bool = False) -> list[str]:
    """Lines for diagnostics in their JSON form; with all their prims if `verbose`."""
    groups: dict[tuple[str, str], list[Mapping[str, str]]] = {}
    for diagnostic in diagnostics:
        groups.setdefault((diagnostic["severity"], diagnostic["code"]), []).append(diagnostic)
    lines = []
    for (severity, code), group in sorted(groups.items(), key=lambda item: (_ORDER.index(item[0][0]), item[0][1])):
        times = f" ({len(group)} times)" if len(group) > 1 else ""
        lines.append(f"{severity}: {code}: {group[0]['message']}{times}")
        paths = list(dict.fromkeys(d["prim_path"] for d in group if d["prim_path"]))
        shown = paths if verbose else paths[:_PRIMS_SHOWN]
        more = f" and {len(paths) - len(shown)} more" if len(paths) > len(shown) else ""
        if shown:
            lines.append(f"    {', '.join(shown)}{more}")
    return lines
