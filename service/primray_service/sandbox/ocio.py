"""The server's OpenColorIO configuration inside the sandbox: which of its files a worker may read, and under what name.

Workers render untrusted scenes, so they see only the LUTs of the configuration's folder, and all of its other search paths.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

OCIO = "OCIO"
BUILTIN = "ocio://"
_LUTS = """3dl cc ccc cdl clf csp ctf cub cube hdl icc icm itx look lut m3d mga spi1d spi3d spimtx vf"""
LUTS = frozenset(f".{name}" for name in _LUTS.split())
MOST_FILES = 4000


def configuration() -> str | None:
    """Return the absolute path or name of the configuration in $OCIO; None if it names nothing that exists."""
    said = os.environ.get(OCIO, "")
    if said.startswith(BUILTIN):
        return said
    path = os.path.abspath(said) if said else ""
    return path if os.path.isfile(path) else None


def readable_files(source: str, slot: Path) -> tuple[str, ...]:
    """Return files and folders for workers; never one that contains a worker's own."""
    found = () if source.startswith(BUILTIN) else _files_of(source)
    return tuple(path for path in found if not slot.is_relative_to(path))


@cache
def _files_of(source: str) -> tuple[str, ...]:
    config = Path(source)
    folders = [Path(config.parent, path) for path in _search_paths(source)]
    others = [
        folder.resolve()
        for folder in folders
        if folder.is_dir() and not config.parent.resolve().is_relative_to(folder.resolve())
    ]
    beside = [path for path in sorted(config.parent.iterdir()) if path.is_file() and path.suffix.lower() in LUTS]
    linked = {str(path.resolve()) for path in (config, *beside)}
    return tuple(dict.fromkeys([source, *map(str, beside[:MOST_FILES]), *sorted(linked), *map(str, others)]))


def _search_paths(source: str) -> list[str]:
    """Return the configuration's search paths; none if it cannot be read, which the worker reports."""
    import PyOpenColorIO as ocio

    try:
        config = ocio.Config.CreateFromFile(source)
        context = config.getCurrentContext()
        return [context.resolveStringVar(path) for path in config.getSearchPaths()]
    except (ocio.Exception, ocio.ExceptionMissingFile, RuntimeError, ValueError):
        return []
