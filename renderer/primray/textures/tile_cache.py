"""Cache on disk of textures' levels, in files of tiles that the core reads while it renders (core/texture/tile_file.hpp).

An entry is named by what its texels are made of: the file's bytes, the conversion, the channels, this format's version.
Nothing in the folder is ever changed: files are written under another name and renamed, and evicted by being removed, so that
processes may share it and open files stay readable. Whatever goes wrong with it costs memory or time, not the picture.

    FOLDER/<two digits>/<key>/header.json       what loading the file gives without its texels
    FOLDER/<two digits>/<key>/rgb3.2.tiles      three channels, level 2 and coarser ones
    FOLDER/contents/<digest>                    SHA-256 of a file with that path, size, time and inode
    FOLDER/locks/<three digits>                 held while an entry is written
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..color.color_space import ColorSpace
from ..content_hash import hash_of_file
from ..description import TextureFile, Wrap
from ..errors import AssetError
from ..installed_packages import version_of
from ..read_files import note_read
from ..settings import RenderSettings
from .image_layout import read_header
from .texture import ReadAsset, Texture, load_texture

FORMAT = 1  # of keys and headers; another number where a file's texels would differ
LEAST_TEXELS = 256 * 256  # smaller images are decoded sooner than found
LEFT_SHARE = 0.9  # of the bound, after files have been removed
LOCK_S = 120.0  # a writer that holds an entry for longer is not waited for
TEMPORARY_S = 3600.0  # files that nobody has renamed for so long are of writers that were killed
SETTLED_NS = 2 * 10**9  # a file that changed less than this ago may change again within the same time stamp

HEADER = "header.json"
_FIELDS = ("srgb_channels", "bad_texels", "turned", "environment")


@dataclass
class CacheCounts:
    """What one process did with the cache."""

    found: int = 0  # images whose levels were there
    written: int = 0
    written_bytes: int = 0
    removed: int = 0


class Gate:
    """Lets images be decoded at the same time whose floats are of at most `limit` bytes together, or one that is larger.

    A thread that is inside already passes: two that wait for each other's room would wait for ever.
    """

    def __init__(self, limit: int) -> None:
        self._limit, self._used, self._changed = limit, 0, threading.Condition()
        self._inside = threading.local()

    @contextmanager
    def of(self, size: int) -> Iterator[None]:
        if getattr(self._inside, "now", False):
            yield
            return
        with self._changed:
            self._changed.wait_for(lambda: self._used == 0 or self._used + size <= self._limit)
            self._used += size
        self._inside.now = True
        try:
            yield
        finally:
            self._inside.now = False
            with self._changed:
                self._used -= size
                self._changed.notify_all()


class TileCache:
    """The cache in one folder, for scenes whose textures have `memory_bytes`."""

    def __init__(self, folder: Path, memory_bytes: int, most_bytes: int) -> None:
        self.folder, self.most_bytes = folder, most_bytes
        self.counts = CacheCounts()
        self.gate = Gate(memory_bytes)
        self._memory_bytes, self._waiting = memory_bytes, 0
        self._failures: list[str] = []
        self._lock = threading.RLock()  # a texture may be collected while it is held

    # Reading files

    def load(
        self, file: TextureFile, path: str, channels: frozenset[str], read: ReadAsset | None, default_wrap: Wrap
    ) -> Texture:
        """Return the image as `load_texture` does, without its texels where its levels are in the cache.

        Texels that have been read stay in memory until the core takes them, up to the budget, beyond which they are read again.
        """

        note_read(path)  # its levels may be in the cache already

        def decoded() -> Texture:
            with self.gate.of(self._float_bytes(path, read, len(channels))):
                return load_texture(file, read, path=path, channels=channels, default_wrap=default_wrap)

        try:
            key = self._key_of(file, path, channels, read, default_wrap)
        except (OSError, ValueError):
            return decoded()  # which explains why the file cannot be read
        if (header := self._header(key)) is not None and self._has_tiles(key):
            return replace(header, content=key, loader=self._again(decoded, key, file, path, channels, read, default_wrap))
        texture = decoded()
        height, width, _ = texture.shape
        if height * width < LEAST_TEXELS:
            return texture
        if header is None:
            self._put_header(key, texture)
        if self._keeps(texture.stored):
            return replace(texture, content=key)
        again = self._again(decoded, key, file, path, channels, read, default_wrap)
        return replace(texture.without_texels(), content=key, loader=again)

    def _keeps(self, stored: npt.NDArray[Any]) -> bool:
        with self._lock:
            if self._waiting + stored.nbytes > self._memory_bytes:
                return False
            self._waiting += stored.nbytes
        weakref.finalize(stored, self._release, stored.nbytes)
        return True

    def _release(self, size: int) -> None:
        with self._lock:
            self._waiting -= size

    def _again(
        self,
        decoded: Callable[[], Texture],
        key: str,
        file: TextureFile,
        path: str,
        channels: frozenset[str],
        read: ReadAsset | None,
        default_wrap: Wrap,
    ) -> Callable[[], Texture]:
        def load() -> Texture:
            texture = decoded()
            try:
                same = self._key_of(file, path, channels, read, default_wrap) == key
            except OSError:
                same = False
            if not same:
                raise AssetError("the texture changed while the scene was prepared", where=path, code="texture-unreadable")
            return texture

        return load

    @staticmethod
    def _float_bytes(path: str, read: ReadAsset | None, channels: int) -> int:
        if read is None and path.endswith("]"):
            return 0
        spec = read_header(path, read or _no_package)
        return 0 if spec is None else 4 * spec.width * spec.height * max(channels, spec.nchannels)

    # Keys

    def _key_of(
        self, file: TextureFile, path: str, channels: frozenset[str], read: ReadAsset | None, default_wrap: Wrap
    ) -> str:
        package, _, member = path.partition("[")
        says = {
            "format": FORMAT,
            "content": self._digest_of(path, package, read) if member else self._digest_of(path, path, None),
            "suffix": Path(member.rstrip("]") or path).suffix.lower(),
            "layer": file.layer,
            "space": _named(file.color_space),
            "target": _named(file.target),
            "is_color": file.is_color,
            "channels": "".join(sorted(channels)),
            "wrap": default_wrap.name,
            "reader": version_of("OpenImageIO"),
        }
        return hashlib.sha256(json.dumps(says, sort_keys=True, default=str).encode()).hexdigest()

    def _digest_of(self, name: str, path: str, read: ReadAsset | None) -> str:
        """Return the SHA-256 of a file, or of a package's member, from a note of it where the file has not changed."""
        about = os.stat(path)
        states = (os.path.abspath(path), name, about.st_size, about.st_mtime_ns, about.st_ino, about.st_dev)
        note = self.folder / "contents" / hashlib.sha256(repr(states).encode("utf-8", "surrogatepass")).hexdigest()
        with suppress(OSError, ValueError):
            found = note.read_text("ascii")
            if len(found) == 64:
                return found
        digest = hash_of_file(path) if read is None else hashlib.sha256(read(name)).hexdigest()
        if time.time_ns() - about.st_mtime_ns > SETTLED_NS:
            self._put(note, lambda to: os.write(to, digest.encode()))
        return digest

    # Entries

    def find(self, key: str, channels: str, level: int) -> Path | None:
        """Return the file that has these channels with that level and all coarser ones; the smallest of several."""
        for name in (f"{channels}.{k}.tiles" for k in range(level, -1, -1)):
            path = self._entry(key) / name
            with suppress(OSError):
                os.utime(path)  # it has been used
                return path
            if path.exists():  # in a folder that may only be read
                return path
        return None

    def make(self, key: str, channels: str, level: int, write: Callable[[int], object]) -> Path | None:
        """Return the file that has these channels from that level on, written by `write(file)` if there is none.

        None where it cannot be written.
        """
        if (found := self.find(key, channels, level)) is not None:
            self.counts.found += 1
            return found
        path = self._entry(key) / f"{channels}.{level}.tiles"
        with self._alone(key):
            if (found := self.find(key, channels, level)) is not None:  # by the process that was waited for
                self.counts.found += 1
                return found
            if not self._put(path, write):
                return None
        with self._lock, suppress(OSError):
            self.counts.written += 1
            self.counts.written_bytes += path.stat().st_size
        for coarser in self._entry(key).glob(f"{channels}.*.tiles"):
            if coarser.name.split(".")[1].isdigit() and int(coarser.name.split(".")[1]) > level:
                coarser.unlink(missing_ok=True)
        return path

    def discard(self, path: Path) -> None:
        """Remove a file that turned out to be damaged, for it to be written again."""
        with suppress(OSError):
            path.unlink()

    def _entry(self, key: str) -> Path:
        return self.folder / key[:2] / key

    def _has_tiles(self, key: str) -> bool:
        return next(self._entry(key).glob("*.tiles"), None) is not None

    def _header(self, key: str) -> Texture | None:
        """Return what loading the file gives without its texels."""
        try:
            says = json.loads((self._entry(key) / HEADER).read_text("utf-8"))
            shape = tuple(int(n) for n in says["shape"])
            stored = np.broadcast_to(np.zeros((1, 1, 1), np.dtype(says["type"])), shape)
            wraps: dict[str, Any] = {name: Wrap[says[name]] for name in ("wrap_s", "wrap_t")}
            return Texture(stored=stored, **{name: says[name] for name in _FIELDS}, **wraps)
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def _put_header(self, key: str, texture: Texture) -> None:
        says: dict[str, Any] = {name: getattr(texture, name) for name in _FIELDS}
        says |= {"wrap_s": texture.wrap_s.name, "wrap_t": texture.wrap_t.name}
        says |= {"shape": texture.shape, "type": texture.stored.dtype.str}
        self._put(self._entry(key) / HEADER, lambda to: os.write(to, json.dumps(says).encode()))

    # Files

    def _put(self, path: Path, write: Callable[[int], object]) -> bool:
        """Write a file under another name and rename it; return whether that was possible."""
        temporary = ""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            to, temporary = tempfile.mkstemp(suffix=".tmp", dir=path.parent)
            try:
                fcntl.flock(to, fcntl.LOCK_EX | fcntl.LOCK_NB)  # `sweep` sees that its writer lives
                write(to)
                os.fsync(to)
            finally:
                os.close(to)
            os.rename(temporary, path)
            return True
        except OSError as error:
            self.fail(f"{error.strerror or error} ({path.parent})")
            with suppress(OSError):
                if temporary:
                    os.unlink(temporary)
            return False

    def fail(self, why: str) -> None:
        """Note why something could not be kept."""
        with self._lock:
            if why not in self._failures:
                self._failures.append(why)

    def take_failures(self) -> list[str]:
        """Return what was noted since the last call."""
        with self._lock:
            failures, self._failures = self._failures, []
        return failures

    @contextmanager
    def _alone(self, key: str) -> Iterator[None]:
        """Wait until no other process writes an entry of the key, or for two minutes."""
        try:
            (self.folder / "locks").mkdir(parents=True, exist_ok=True)
            lock = os.open(self.folder / "locks" / key[:3], os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError:
            yield  # writing will say why
            return
        try:
            _wait_for(lock)
            yield
        finally:
            os.close(lock)

    def sweep(self) -> None:
        """Remove what was not used for the longest time until the folder is within its bound, and what killed writers left."""
        try:
            lock = os.open(self.folder / "locks" / "sweep", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError:
            return
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._remove_oldest()
        except OSError:
            pass  # another process does it
        finally:
            os.close(lock)

    def _remove_oldest(self) -> None:
        files = [(about.st_mtime, about.st_blocks * 512, path) for path, about in _files_in(self.folder)]
        total, now = sum(size for _, size, _ in files), time.time()
        for _, size, path in [f for f in files if f[2].endswith(".tmp") and now - f[0] > TEMPORARY_S]:
            if _is_abandoned(path) and _removed(path):
                total -= size
        if total <= self.most_bytes:
            return
        for _, size, path in sorted(f for f in files if not f[2].endswith(".tmp")):
            if total <= LEFT_SHARE * self.most_bytes:
                break
            if _removed(path):
                total -= size
                self.counts.removed += 1
                with suppress(OSError):
                    os.rmdir(os.path.dirname(path))

    def facts(self) -> dict[str, Any]:
        """Return what was found and written, for the report."""
        return {"folder": str(self.folder), **asdict(self.counts)}


def _no_package(path: str) -> bytes:
    raise OSError(errno.ENOENT, "no reader of packages", path)


def _named(space: ColorSpace | str) -> str:
    """Return what decides a conversion from or to a space."""
    if isinstance(space, str) and space not in ("auto", "sRGB", "raw"):
        from ..color import ocio

        return f"{space} of {ocio.config_id()}"
    return repr(space)


def _wait_for(lock: int) -> None:
    end = time.monotonic() + LOCK_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as error:
            if error.errno not in (errno.EWOULDBLOCK, errno.EAGAIN) or time.monotonic() > end:
                return  # written by both, which is the same
        time.sleep(0.02)


def _files_in(folder: Path) -> Iterator[tuple[str, os.stat_result]]:
    """Yield the files of all entries, and notes; not the locks."""
    for top in os.scandir(folder):
        if not top.is_dir() or top.name == "locks":
            continue
        for base, _, names in os.walk(top.path):
            for name in names:
                path = os.path.join(base, name)
                with suppress(OSError):
                    yield path, os.stat(path)


def _is_abandoned(path: str) -> bool:
    try:
        file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    except OSError:
        return False
    finally:
        os.close(file)


def _removed(path: str) -> bool:
    try:
        os.unlink(path)
        return True
    except OSError:
        return False


def default_folder() -> Path:
    """Return the user's cache folder of textures, by the XDG Base Directory Specification."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "primray" / "textures"


def tile_cache(settings: RenderSettings) -> TileCache | None:
    """Return the cache that the settings ask for, one for all renders of the process; None: textures are held whole."""
    if settings.texture_memory_bytes is None:
        return None
    folder = Path(settings.texture_cache) if settings.texture_cache is not None else default_folder()
    return _cache(folder.absolute(), settings.texture_memory_bytes, settings.texture_cache_bytes)


@lru_cache(maxsize=8)
def _cache(folder: Path, memory_bytes: int, most_bytes: int) -> TileCache:
    return TileCache(folder, memory_bytes, most_bytes)
