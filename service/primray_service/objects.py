"""An object store that several servers share, by any URL that fsspec opens (s3://bucket/prefix, gs://..., memory://): the only
file that imports it. Files are put and fetched whole, by name; they do not change, except where a method says so.

Every method blocks, is thread-safe, and raises only FileNotFoundError or ObjectStoreFailed.
"""

from __future__ import annotations

import functools
import os
import secrets
import threading
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from primray.errors import SettingsError

P = ParamSpec("P")
T = TypeVar("T")


class ObjectStoreFailed(OSError):
    """The object store does not answer, or refuses (503)."""


def os_errors(method: Callable[P, T]) -> Callable[P, T]:
    """Convert all exceptions of the store's client, except FileNotFoundError, into ObjectStoreFailed."""

    @functools.wraps(method)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return method(*args, **kwargs)
        except FileNotFoundError:
            raise
        except Exception as error:
            raise ObjectStoreFailed(f"the object store failed: {type(error).__name__}: {error}"[:500]) from error

    return called


def opened(url: str) -> Objects:
    """Open a store; SettingsError if fsspec, or its package for this kind of URL, is not installed or cannot open it."""
    try:
        from fsspec.core import url_to_fs

        fs, root = url_to_fs(url, use_listings_cache=False)
    except ImportError as error:
        how = f"{error}; install it with: pip install 'primray[objects]', and the package for such URLs (s3fs, gcsfs, adlfs)"
        raise SettingsError(how, where="data", code="objects-missing") from None
    except Exception as error:
        raise SettingsError(f"{url} cannot be opened: {error}", where="data", code="objects-url") from None
    if hasattr(fs, "auto_mkdir"):
        fs.auto_mkdir = True  # creates folders if the store is a file system
    return Objects(fs, root.rstrip("/"), url)


class Objects:
    def __init__(self, fs: Any, root: str, url: str) -> None:
        self.url = url
        self._fs = fs
        self._root = root
        self._tags: dict[str, str] = {}  # by name: version of the local copy
        self._lock = threading.Lock()

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}"

    @os_errors
    def check(self) -> None:
        """Raise ObjectStoreFailed unless the store answers."""
        self._fs.exists(self._at("session.secret"))

    @os_errors
    def put(self, source: Path, name: str) -> None:
        self._fs.put_file(str(source), self._at(name))

    @os_errors
    def get(self, name: str, target: Path) -> None:
        """Fetch a complete file, or none; FileNotFoundError if it does not exist."""
        target.parent.mkdir(parents=True, exist_ok=True)
        beside = target.with_name(f"{target.name}.{secrets.token_hex(4)}.new")
        try:
            self._fs.get_file(self._at(name), str(beside))
            os.replace(beside, target)
        finally:
            beside.unlink(missing_ok=True)

    @os_errors
    def get_newest(self, name: str, target: Path) -> None:
        """Fetch a file that changes, unless the copy is current; if it does not exist, the local copy is removed as well."""
        try:
            tag = str(self._fs.ukey(self._at(name)))
        except FileNotFoundError:
            target.unlink(missing_ok=True)
            return
        with self._lock:
            is_known = self._tags.get(name) == tag and target.is_file()
        if not is_known:
            self.get(name, target)
            with self._lock:
                if len(self._tags) > 10_000:
                    self._tags.clear()
                self._tags[name] = tag

    @os_errors
    def read(self, name: str, begin: int, end: int) -> bytes:
        found: bytes = self._fs.cat_file(self._at(name), start=begin, end=end)
        return found

    @os_errors
    def write(self, name: str, content: bytes) -> None:
        self._fs.pipe_file(self._at(name), content)

    @os_errors
    def size(self, name: str) -> int:
        """Return the size of a file; FileNotFoundError if it does not exist."""
        return int(self._fs.size(self._at(name)))

    @os_errors
    def has(self, name: str) -> bool:
        return bool(self._fs.exists(self._at(name)))

    @os_errors
    def remove(self, name: str) -> None:
        """Remove a file; has no effect if it does not exist."""
        try:
            self._fs.rm_file(self._at(name))
        except FileNotFoundError:
            return

    @os_errors
    def remove_below(self, folder: str, keep: Collection[str] = ()) -> None:
        """Remove everything below a folder, except for these names."""
        kept = {self._at(name).lstrip("/") for name in keep}  # paths of some stores begin with a slash
        try:
            found = [path for path in self._fs.find(self._at(folder)) if path.lstrip("/") not in kept]
        except FileNotFoundError:
            return
        for path in found:
            try:
                self._fs.rm_file(path)
            except FileNotFoundError:
                continue

    @os_errors
    def folders(self, folder: str) -> list[str]:
        """Return the names directly below a folder."""
        try:
            found = self._fs.ls(self._at(folder), detail=False)
        except FileNotFoundError:
            return []
        return [path.rstrip("/").rsplit("/", 1)[1] for path in found]
