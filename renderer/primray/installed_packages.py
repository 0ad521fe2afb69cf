"""Versions and locations of installed packages, found by the names of their `.dist-info` folders.

`importlib.metadata` reads the same files but takes as long to import as OpenImageIO, so it is only the fallback.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_SUFFIX = ".dist-info"
SCHEMAS = "PXR_PLUGINPATH_NAME"  # environment variable in which USD looks for plugin schemas


@cache
def version_of(package: str) -> str | None:
    """Return the version of an installed package, or None if it is not installed."""
    wanted = _normal(package)
    for _, name in _found():
        found, _, version = name.removesuffix(_SUFFIX).partition("-")
        if _normal(found) == wanted and version:
            return version
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def library_of(package: str, prefix: str) -> Path | None:
    """Return the shared library bundled in a package's wheel whose file name begins with `prefix`, or None."""
    for folder, name in _found():
        if _normal(name.partition("-")[0]) == _normal(package):
            brought = sorted(Path(folder, f"{package}.libs").glob(f"{prefix}*"))
            if brought:
                return brought[0]
    from importlib import metadata

    try:
        files = metadata.files(package) or []
    except metadata.PackageNotFoundError:
        return None
    return next((Path(str(file.locate())) for file in files if file.name.startswith(prefix)), None)


def schema_folder() -> Path:
    """Return the folder of the applied schemas that primray defines: the installed package's, else the source tree's."""
    package = Path(__file__).resolve().parent
    installed = package / "schemas"
    return installed if installed.is_dir() else package.parents[1] / "schemas/usd"


@cache
def _found() -> tuple[tuple[str, str], ...]:
    """Return (folder, name) of every `.dist-info` folder on sys.path, in import order."""
    return tuple((folder, name) for folder in sys.path for name in _names(folder) if name.endswith(_SUFFIX))


def _names(folder: str) -> Iterator[str]:
    try:
        yield from os.listdir(folder or ".")
    except OSError:
        return


def _normal(name: str) -> str:
    return name.lower().replace("-", "_").replace(".", "_")
