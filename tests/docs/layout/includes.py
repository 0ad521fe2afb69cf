"""Which folders of the core include which others: by quoted includes, which are paths from renderer/core on."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath


def folder_graph(sources: Mapping[PurePosixPath, str]) -> dict[str, set[str]]:
    """By folder, those that its files include; a folder's own folders are others."""
    graph: dict[str, set[str]] = {str(path.parent): set() for path in sources}
    for path, text in sources.items():
        for included in re.findall(r'^#include "([^"]+)"', text, re.MULTILINE):
            other = str(PurePosixPath(included).parent)
            if other != str(path.parent):
                graph[str(path.parent)].add(other)
                graph.setdefault(other, set())
    return graph


def core_sources(root: Path) -> dict[PurePosixPath, str]:
    core = root / "renderer" / "core"
    return {
        PurePosixPath(path.relative_to(core).as_posix()): path.read_text(encoding="utf-8")
        for path in sorted(core.rglob("*.[hc]pp"))
    }
