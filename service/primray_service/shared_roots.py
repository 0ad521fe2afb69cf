"""Folders of shared storage that jobs may name: `shared:NAME/path.usda`. The configuration lists the tenants that may use each.

The server only resolves paths; a worker opens the stage, in a sandbox in which this root is readable and no other.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from primray.errors import SettingsError

from .problems import Problem

PREFIX = "shared:"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
MEMBER = "scene.shared"


@dataclass(frozen=True)
class SharedRoot:
    """A shared folder. `path` has no symbolic links in it; `tenants` may use it, None: all."""

    name: str
    path: Path
    tenants: frozenset[str] | None = None

    def allows(self, tenant: str) -> bool:
        return self.tenants is None or tenant in self.tenants


@dataclass(frozen=True)
class SharedFile:
    root: SharedRoot
    path: Path

    @property
    def name(self) -> str:
        return f"{PREFIX}{self.root.name}/{self.path.relative_to(self.root.path).as_posix()}"

    @property
    def scene_id(self) -> str:
        """Return the scene id of the current root layer: when the file changes it is another scene, which is checked again."""
        found = self.path.stat()
        said = f"primray-shared-1\n{self.name}\n{found.st_size}\n{found.st_mtime_ns}"
        return f"sha256:{hashlib.sha256(said.encode()).hexdigest()}"


@dataclass(frozen=True)
class SharedRoots:
    roots: Sequence[SharedRoot] = ()

    def names(self, tenant: str) -> list[str]:
        return sorted(root.name for root in self.roots if root.allows(tenant))

    def file(self, text: str, tenant: str) -> SharedFile:
        """Return the file for `shared:NAME/path.usda`, or NAME/path.usda. Raises Problem; another tenant's root is reported
        like one that does not exist. Blocks on the file system."""
        name, _, path = text.removeprefix(PREFIX).partition("/")
        root = next((root for root in self.roots if root.name == name and root.allows(tenant)), None)
        if root is None:
            raise Problem("not-found", f"{MEMBER}: there is no shared root of this name for this tenant.", member=MEMBER)
        if not path or "\0" in path or any(part in ("", ".", "..") for part in path.split("/")):
            raise _invalid("write it NAME/path.usda, without . and .. in the path")
        if not path.lower().endswith(SUFFIXES):
            raise _invalid(f"{PurePosixPath(path).name!r} is not a usd, usda, usdc or usdz file")
        found = Path(os.path.realpath(root.path / path))
        if not found.is_relative_to(root.path):
            raise _invalid("the path is a link to a file outside the shared root")
        if not found.is_file():
            raise Problem("not-found", f"{MEMBER}: there is no such file in the shared root {name!r}.", member=MEMBER)
        return SharedFile(root, found)


def _invalid(detail: str) -> Problem:
    return Problem("invalid-request", f"{MEMBER}: {detail}.", member=MEMBER)


def roots_of(folders: Iterable[str], tenants: Iterable[str]) -> SharedRoots:
    """Return the roots from NAME=/folder and NAME=tenant,tenant, as given to `primray serve`. Raises SettingsError."""
    allowed: dict[str, frozenset[str]] = dict(_tenants(text) for text in tenants)
    found: dict[str, SharedRoot] = {}
    for text in folders:
        name, sign, folder = text.partition("=")
        if not sign or not NAME.fullmatch(name) or not os.path.isabs(folder):
            raise _wrong(f"{text!r} is not a shared root: write NAME=/folder")
        if name in found:
            raise _wrong(f"there are two shared roots {name!r}")
        path = Path(os.path.realpath(folder))
        if not path.is_dir() or path == Path("/"):
            raise _wrong(f"{folder} cannot be a shared root: it is not an accessible folder")
        found[name] = SharedRoot(name, path, allowed.get(name))
    unknown = allowed.keys() - found.keys()
    if unknown:
        raise _wrong(f"tenants are given for an unknown shared root {min(unknown)!r}")
    return SharedRoots(tuple(found.values()))


def _tenants(text: str) -> tuple[str, frozenset[str]]:
    name, sign, tenants = text.partition("=")
    if not sign:
        raise _wrong(f"{text!r} names no tenants: write NAME=tenant,tenant")
    return name, frozenset(filter(None, tenants.split(",")))


def _wrong(detail: str) -> SettingsError:
    return SettingsError(detail, where="shared_roots", code="shared-root")


def shared_name(facts: Mapping[str, object]) -> str | None:
    """Return the name by which a scene of shared storage was requested; None for an uploaded one."""
    name = facts.get("shared")
    return name if isinstance(name, str) else None
