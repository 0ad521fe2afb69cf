"""Packages uploaded by content: files are sent by their digests, and a scene is assembled from those that the server has.

A manifest is a package as a list of its files: paths, digests and sizes. The scene's id is the digest of the list in canonical
form: equal files at equal paths are one scene, whoever sends them.

contents/<tenant>/<sha256> holds a tenant's files, each once. A package's members are links to them (copies where links are
impossible), so a scene that shares files with another takes space only for new ones. A file is created before its row, and
removed after it; the lock of scenes/ keeps the two together.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ..executor.slots import NO_LINKS
from ..files import DataDirectory, sync
from ..jobs import Json, Scene, SceneState
from ..limits import Limits, Quotas
from ..problems import Problem
from ..store.base import Conflict, Store
from .preparing import ABOUT, locked, sync_all
from .receive import Received
from .recognize import candidates
from .staging import staging_here
from .zip_directory import ARCHIVE_HEAD_BYTES, STORED, Member, archive_kind, refuse_names, shown, unsafe

EMPTY = hashlib.sha256(b"").hexdigest()
FORMAT = "primray-package-1"


@dataclass(frozen=True)
class Part:
    sha256: str
    bytes: int


@dataclass(frozen=True)
class FileOfPackage:
    """A file of a package. `parts`: byte ranges that are sent separately, in order, as a usdz is split at its members; none: it
    is sent whole."""

    path: str
    sha256: str
    bytes: int
    parts: Sequence[Part] = ()

    @property
    def sent(self) -> Sequence[Part]:
        """Return what is sent of the file: its parts, or itself; nothing for an empty file."""
        if self.parts:
            return self.parts
        return (Part(self.sha256, self.bytes),) if self.bytes else ()


@dataclass(frozen=True)
class Manifest:
    """A package's list; its files are in order of their paths."""

    files: Sequence[FileOfPackage]
    name: str = ""
    text: bytes = field(default=b"", repr=False)

    @property
    def scene_id(self) -> str:
        return f"sha256:{hashlib.sha256(self.text).hexdigest()}"

    @property
    def bytes(self) -> int:
        return sum(file.bytes for file in self.files)

    @property
    def sizes(self) -> Mapping[str, int]:
        """Return the sizes of everything that is sent, by digest."""
        return {part.sha256: part.bytes for file in self.files for part in file.sent}

    @property
    def joined_bytes(self) -> int:
        """Return the bytes of files that are joined from parts, and so stored in addition to them."""
        return sum(file.bytes for file in self.files if file.parts)


def manifest_of(files: Sequence[FileOfPackage], name: str, limits: Limits) -> Manifest:
    """Return the manifest; raises Problem for a list that no package could have, by the same rules as for a zip's directory."""
    count = sum(max(len(file.parts), 1) for file in files)
    if count > limits.package_entries:
        raise Problem(
            "package-unsafe", f"The package has {count} files or parts; at most {limits.package_entries} are allowed."
        )
    refuse_names([_member(file) for file in files], limits)
    sizes: dict[str, int] = {}
    for file in files:
        for part in (Part(file.sha256, file.bytes), *file.parts):
            if sizes.setdefault(part.sha256, part.bytes) != part.bytes or (part.sha256 == EMPTY) != (part.bytes == 0):
                raise Problem("invalid-request", f"The file {shown(file.path)!r} has a size that its digest cannot have.")
        if file.parts and sum(part.bytes for part in file.parts) != file.bytes:
            raise Problem("invalid-request", f"The parts of the file {shown(file.path)!r} do not add up to its size.")
        if file.bytes > limits.upload_bytes:
            raise Problem(
                "upload-too-large", f"A file may have at most {limits.upload_bytes} bytes.", limit=limits.upload_bytes
            )
    total = sum(file.bytes for file in files)
    if total > limits.unpacked_bytes:
        sentence = f"The package has {total} bytes; at most {limits.unpacked_bytes} are allowed."
        raise Problem("package-too-large", sentence, limit=limits.unpacked_bytes)
    if not candidates([file.path for file in files]):
        raise Problem("not-usd", f"None of the package's {len(files)} files is a usd, usda, usdc or usdz layer.")
    ordered = sorted(files, key=lambda file: file.path)
    return Manifest(ordered, name, _text(ordered))


def read_manifest(text: bytes, name: str = "") -> Manifest:
    """Return a manifest from the text that `manifest_of` wrote."""
    rows = json.loads(text)["files"]
    files = [FileOfPackage(path, sha256, size, [Part(*part) for part in parts]) for path, sha256, size, *parts in rows]
    return Manifest(files, name, text)


def _text(files: Sequence[FileOfPackage]) -> bytes:
    rows = [[file.path, file.sha256, file.bytes, *([part.sha256, part.bytes] for part in file.parts)] for file in files]
    return json.dumps({"format": FORMAT, "files": rows}, separators=(",", ":"), ensure_ascii=False).encode()


def _member(file: FileOfPackage) -> Member:
    raw = file.path.encode()
    return Member(
        raw_name=raw,
        name=file.path,
        flags=0,
        method=STORED,
        crc=0,
        packed_bytes=file.bytes,
        bytes=file.bytes,
        unix_mode=0,
        dos_attributes=0,
        header_at=0,
        data_at=0,
    )


MANIFEST = "manifest.json"
JOINED_BYTES = 2**20


def keep_content(received: Received, tenant: str, store: Store, data: DataDirectory, quotas: Quotas, now: float) -> bool:
    """Store a complete file for the tenant, and return whether it is new. Blocks. Raises QuotaExceeded."""
    target = data.content(tenant, received.scene_id)
    with _changing(tenant, received.sha256, store, data):
        is_new_here = not target.exists()
        if is_new_here:
            target.parent.mkdir(mode=0o700, exist_ok=True)
            os.chmod(received.path, 0o600)
            sync(received.path)
            os.rename(received.path, target)
            sync(target.parent)
        try:
            data.share(target)
            return store.put_content(tenant, received.sha256, received.bytes, now, quotas)
        except BaseException:
            if is_new_here and not store.has_content(tenant, received.sha256):
                data.remove(target)
            raise


def missing_of(manifest: Manifest, tenant: str, store: Store, now: float) -> list[str]:
    """Return the digests that the tenant has to send, in the order of the package's files. Problem if a size contradicts its
    digest's."""
    known = store.contents(tenant, manifest.sizes, now)
    for file in manifest.files:
        for part in file.sent:
            if known.get(part.sha256, part.bytes) != part.bytes:
                raise Problem("invalid-request", f"The file {file.path!r} has {known[part.sha256]} bytes, by its digest.")
    return [sha256 for sha256 in manifest.sizes if sha256 not in known]


def keep_package(
    manifest: Manifest, tenant: str, store: Store, data: DataDirectory, limits: Limits, quotas: Quotas, now: float
) -> tuple[Scene, bool] | None:
    """Return the tenant's scene of these files, and whether it is new; None if a file no longer exists. Blocks. Raises Problem,
    QuotaExceeded."""
    folder = data.scene(manifest.scene_id)
    row = _row(manifest, tenant, now)
    try:
        with staging_here(data) as staged:
            is_here = folder.exists()
            if not is_here:
                _put_together(manifest, tenant, staged, data, limits)
            with _scene_lock(manifest.scene_id, store, data), locked(data):
                if not folder.exists():
                    if is_here:
                        return None  # removed meanwhile: ask again
                    os.rename(staged, folder)
                    sync(data.scenes)
                if data.objects is not None:
                    data.objects.put(folder / MANIFEST, data.name_of(folder / MANIFEST))
                return store.put_scene(row, quotas, manifest.sizes)
    except (Conflict, FileNotFoundError):
        return None


def bring_package(scene: Scene, staged: Path, data: DataDirectory, limits: Limits) -> bool:
    """Assemble a scene of an object store in a folder; False if it was not uploaded by content."""
    target = staged / MANIFEST
    assert data.objects is not None
    try:
        data.objects.get(data.name_of(data.scene(scene.id) / MANIFEST), target)
    except FileNotFoundError:
        return False
    manifest = read_manifest(target.read_bytes())
    if manifest.scene_id != scene.id:
        raise Problem("internal", "The package's list in the object store is damaged; upload it again.")
    target.unlink()
    _put_together(manifest, scene.tenant, staged, data, limits)
    return True


def release(digests: Iterable[str], tenant: str, store: Store, data: DataDirectory) -> None:
    """Remove the files of digests that have no row any more. Blocks."""
    for sha256 in digests:
        with _changing(tenant, sha256, store, data):
            if not store.has_content(tenant, sha256):
                data.remove(data.content(tenant, f"sha256:{sha256}"))


def forget(tenant: str, sha256: str, before: float, store: Store, data: DataDirectory) -> None:
    """Remove a content if no scene has it and nobody asked for it since `before`. Blocks."""
    with _changing(tenant, sha256, store, data):
        if store.forget_content(tenant, sha256, before):
            data.remove(data.content(tenant, f"sha256:{sha256}"))


def sweep(store: Store, data: DataDirectory) -> None:
    """Remove files without rows, which a server leaves that dies between the two steps. Blocks."""
    names = [folder.name for folder in data.contents.iterdir()]
    names += [] if data.objects is None else data.objects.folders("contents")
    for name in dict.fromkeys(names):
        folder, tenant = data.contents / name, name.partition("-")[2]
        files = [path.name for path in folder.iterdir()] if folder.is_dir() else []
        files += [] if data.objects is None else data.objects.folders(f"contents/{name}")
        for sha256 in dict.fromkeys(files):
            if len(sha256) == 64 and not store.has_content(tenant, sha256):
                release([sha256], tenant, store, data)


def _row(manifest: Manifest, tenant: str, now: float) -> Scene:
    """Return the scene's row. Its files count as the tenant's contents; the list, and files joined from parts, count as the
    scene's."""
    own = len(manifest.text) + manifest.joined_bytes
    state = SceneState.CHECKING
    return Scene(
        id=manifest.scene_id,
        tenant=tenant,
        state=state,
        kind="zip",
        name=manifest.name,
        bytes=manifest.bytes,
        stored_bytes=own,
        created_at=now,
        used_at=now,
    )


def _put_together(manifest: Manifest, tenant: str, staged: Path, data: DataDirectory, limits: Limits) -> None:
    """Make the package's folder and its description. FileNotFoundError if a file is gone."""
    package = staged / "package"
    package.mkdir(mode=0o700)
    for file in manifest.files:
        target = package / file.path
        target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        contents = [_brought(part.sha256, tenant, data) for part in file.sent]
        if file.parts:
            _join(contents, target, file, data, limits)
        elif contents:
            _link(contents[0], target, data, limits)
        else:
            target.touch(0o600)
        _refuse_archive(target, file.path)
    about: Json = {"kind": "zip", "files": len(manifest.files), "unpacked_bytes": manifest.bytes}
    (staged / MANIFEST).write_bytes(manifest.text)
    (staged / ABOUT).write_text(json.dumps(about))
    sync_all(staged)


def _brought(sha256: str, tenant: str, data: DataDirectory) -> Path:
    content = data.content(tenant, f"sha256:{sha256}")
    if not data.bring(content):
        raise FileNotFoundError(sha256)
    return content


def _join(parts: list[Path], target: Path, file: FileOfPackage, data: DataDirectory, limits: Limits) -> None:
    """Join a file's parts; the result must have the announced digest."""
    _refuse_without_room(file.bytes, data, limits)
    with target.open("xb") as joined:
        os.chmod(target, 0o600)
        for part in parts:
            with part.open("rb") as content:
                shutil.copyfileobj(content, joined, JOINED_BYTES)
    with target.open("rb") as joined:
        found = hashlib.file_digest(joined, "sha256").hexdigest()
    if found != file.sha256:
        raise Problem("digest-mismatch", f"The parts of {file.path!r} have the digest {found} together, not {file.sha256}.")


def _refuse_archive(content: Path, path: str) -> None:
    with content.open("rb") as file:
        kind = archive_kind(file.read(ARCHIVE_HEAD_BYTES))
    if kind is not None and not (kind == "zip" and path.lower().endswith(".usdz")):
        raise unsafe(f"The member is an archive ({kind}); only usdz archives are allowed in a package.", path)


def _link(content: Path, target: Path, data: DataDirectory, limits: Limits) -> None:
    try:
        os.link(content, target, follow_symlinks=False)
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        _refuse_without_room(content.stat().st_size, data, limits)
        shutil.copyfile(content, target, follow_symlinks=False)


def _refuse_without_room(coming: int, data: DataDirectory, limits: Limits) -> None:
    if data.free_bytes() < limits.free_disk_bytes + coming:
        raise Problem("storage-full", "The server's disk has no room for this package.")


@contextmanager
def _changing(tenant: str, sha256: str, store: Store, data: DataDirectory) -> Iterator[None]:
    """Lock this content, so that no server adds or removes it meanwhile."""
    if data.objects is None:
        with locked(data):
            yield
        return
    with store.exclusive(f"content {tenant} {sha256}"):
        yield


@contextmanager
def _scene_lock(scene_id: str, store: Store, data: DataDirectory) -> Iterator[None]:
    if data.objects is None:
        yield
        return
    with store.exclusive(f"scene {scene_id}"):
        yield
