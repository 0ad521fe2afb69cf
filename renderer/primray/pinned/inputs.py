"""What a picture's bits depend on besides the code: files by their content, and settings, without those of the machine.

Files are named relative to the stage's folder, so that a lock holds wherever the folder is.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..content_hash import hash_of_file
from ..installed_packages import SCHEMAS, version_of
from ..read_files import check_kept, note_read
from ..report.report import package_versions
from ..settings import RenderSettings, rows, settings_as_json, settings_of_json
from ..settings.setting import file

# Settings on which no pixel depends: of the machine, and of what is refused.
FREE = (
    *("threads", "max_memory_bytes", "texture_memory_bytes", "texture_cache", "texture_cache_bytes"),
    *("strict", "fail_on", "allow"),
)
FILES = tuple(row.name for row in rows(RenderSettings) if row.read is file and row.name not in FREE)
STAGES = (".usd", ".usda", ".usdc", ".usdz")
# Environment variables that may change pixels. The file that OCIO names is an input as well.
ENVIRONMENT = ("OCIO", "PXR_AR_DEFAULT_SEARCH_PATH", SCHEMAS, "PRIMRAY_LANES")


def with_real_folder(path: Path) -> Path:
    """Return an absolute path whose folder has no symbolic links, and which may be one itself.

    A relative path between two such paths leads from one to the other, which ".." through a link does not; a stage that is a
    link keeps its name, from which its own relative paths are resolved.
    """
    return Path(os.path.realpath(path.absolute().parent)) / path.name


def files_of(stage: Path, settings: RenderSettings) -> list[str]:
    """Return all files that a stage and the settings name, those of the stage first."""
    from .. import usd

    found = [*usd.dependencies(str(stage)).files]
    named = [getattr(settings, name) for name in FILES] + [os.environ.get("OCIO")]
    for path in named:
        if path is not None and os.path.isfile(path):
            if path.lower().endswith(STAGES):
                found += usd.dependencies(path).files
            else:
                note_read(path)
                found.append(os.path.abspath(path))
    check_kept()
    return list(dict.fromkeys(found))


def hashes(files: Iterable[str], folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file by its path relative to a folder; files that are not there are left out."""
    return {_relative(path, folder): hash_of_file(path) for path in files if os.path.isfile(path)}


def _relative(path: str, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def hashes_now(names: Iterable[str], folder: Path) -> dict[str, str]:
    """Return the SHA-256 of files that are named as `hashes` names them."""
    return {name: hash_of_file(folder / name) for name in names if (folder / name).is_file()}


def settings_for_lock(settings: RenderSettings, folder: Path) -> dict[str, Any]:
    """Return the settings that decide about pixels, as JSON, with files named relative to the folder."""
    values = {name: value for name, value in settings_as_json(settings).items() if name not in FREE}
    for name in FILES:
        if values.get(name) is not None and os.path.isfile(values[name]):
            values[name] = _relative(values[name], folder)
    return values


def settings_of_lock(values: Mapping[str, Any], folder: Path) -> RenderSettings:
    """Return the settings of a lock, with files found from the folder; TypeError or ValueError for unknown ones."""
    found = dict(values)
    for name in FILES:
        if found.get(name) is not None and (folder / found[name]).is_file():
            found[name] = str(folder / found[name])
    return settings_of_json(found)


def versions() -> dict[str, str]:
    """Return versions of all packages that affect pixels, and the digest of the core's build."""
    from .. import core

    found = package_versions() | core.versions()
    return found | {"MaterialX": version_of("MaterialX") or "not installed", "core": core.build_digest()}


def environment() -> dict[str, str]:
    return {name: os.environ[name] for name in ENVIRONMENT if name in os.environ}
