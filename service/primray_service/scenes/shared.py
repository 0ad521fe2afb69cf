"""Scenes in an object store that several servers share: scenes/<hex>/upload, as it was sent, and about.json, which marks it as
complete. Packages are unpacked where they are needed.

A lock in the database keeps an upload from relying on bytes that are about to be removed. Each server has a cache of local
copies, removed after a day without use, and sooner, least recently used first, if the disk is short.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from primray.content_hash import hash_of_file

from ..files import DataDirectory
from ..jobs import Json, Scene
from ..limits import Limits, Quotas
from ..objects import Objects
from ..problems import Problem
from ..store.base import Store
from .contents import MANIFEST, bring_package
from .preparing import ABOUT, locked, prepare, refuse_as_usdz, scene_row, set_aside
from .receive import Received
from .staging import staging_here

UPLOAD = "upload"


def keep(
    received: Received,
    tenant: str,
    store: Store,
    data: DataDirectory,
    objects: Objects,
    limits: Limits,
    quotas: Quotas,
    now: float,
) -> tuple[Scene, bool]:
    """Store a scene like keep.keep: the bytes first, then the row."""
    name = data.name_of(data.scene(received.scene_id))
    known = _known(objects, name)
    about: Json = prepare(received, data, limits) if known is None else known
    refuse_as_usdz(received, about)
    while True:
        if not objects.has(f"{name}/{ABOUT}"):
            objects.put(received.path, f"{name}/{UPLOAD}")
            objects.write(f"{name}/{ABOUT}", json.dumps(about).encode())
        with _lock(received.scene_id, store):
            if not objects.has(f"{name}/{ABOUT}"):
                continue  # removed meanwhile
            kept = store.put_scene(scene_row(received, tenant, about, now), quotas)
        if known is None:
            _take(received.path.parent, received.scene_id, data)
        return kept


def _known(objects: Objects, name: str) -> Json | None:
    try:
        about: Json = json.loads(objects.read(f"{name}/{ABOUT}", 0, 2**20))
    except FileNotFoundError:
        return None
    return about


def _take(staged: Path, scene_id: str, data: DataDirectory) -> None:
    """Make a local copy for this server."""
    with locked(data):
        if not data.scene(scene_id).exists():
            os.rename(staged, data.scene(scene_id))


def bring(scene: Scene, data: DataDirectory, limits: Limits) -> None:
    """Fetch the files of a scene that a worker needs. Blocks."""
    folder = data.scene(scene.id)
    if data.objects is None or scene.kind == "shared":
        return
    if folder.exists():
        os.utime(folder)  # marks it as just used, for `evict`
        return
    with staging_here(data) as staged:
        path = staged / UPLOAD
        try:
            data.objects.get(f"{data.name_of(folder)}/{UPLOAD}", path)
        except FileNotFoundError:
            if bring_package(scene, staged, data, limits):
                _take(staged, scene.id, data)
            return  # the reader reports it
        received = _received(scene, path)
        (staged / ABOUT).write_text(json.dumps(prepare(received, data, limits)))
        _take(staged, scene.id, data)


def _received(scene: Scene, path: Path) -> Received:
    sha256 = hash_of_file(path)
    if scene.id != f"sha256:{sha256}":
        raise Problem("internal", "The scene in the object store is damaged; upload it again.")
    return Received(path, sha256, path.stat().st_size, scene.name, "")


@contextmanager
def removing(scene_id: str, store: Store, data: DataDirectory) -> Iterator[None]:
    """Lock the scene, so that nobody relies on its bytes meanwhile."""
    if data.objects is None:
        yield
        return
    with _lock(scene_id, store):
        yield


def remove(scene_id: str, data: DataDirectory) -> None:
    """Remove bytes that belong to nobody; the completeness mark goes first."""
    if data.objects is not None:
        name = data.name_of(data.scene(scene_id))
        data.objects.remove(f"{name}/{ABOUT}")
        data.objects.remove(f"{name}/{UPLOAD}")
        data.objects.remove(f"{name}/{MANIFEST}")


def sweep(store: Store, data: DataDirectory) -> None:
    """Remove scenes without rows."""
    assert data.objects is not None
    for name in data.objects.folders("scenes"):
        scene_id = f"sha256:{name}"
        if len(name) != 64 or store.has_scene(scene_id):
            continue
        with _lock(scene_id, store):
            if not store.has_scene(scene_id):
                remove(scene_id, data)


@contextmanager
def _lock(scene_id: str, store: Store) -> Iterator[None]:
    with store.exclusive(f"scene {scene_id}"):
        yield


KEPT_S = 24 * 3600.0
USED_S = 600.0  # files used within this time may be in use
EVERY_S = 60.0


def evict(data: DataDirectory, wanted_bytes: int) -> int:
    """Evict copies, and return their number. Blocks."""
    now, removed = time.time(), 0
    for used_at, folder in sorted(_copies(data)):
        is_old = now - used_at > KEPT_S
        if not is_old and (now - used_at < USED_S or data.free_bytes() >= wanted_bytes):
            return removed
        _remove(folder, data)
        removed += 1
    return removed


def _copies(data: DataDirectory) -> Iterator[tuple[float, Path]]:
    """Yield the copies with the time of their last use."""
    for folder in data.scenes.iterdir():
        yield folder.stat().st_mtime, folder
    for path in data.contents.glob("*/*"):
        yield path.stat().st_mtime, path
    for folder in data.jobs.iterdir():
        yield max(path.stat().st_mtime for path in (folder, *folder.glob("frames/*"))), folder


def _remove(folder: Path, data: DataDirectory) -> None:
    if folder.parent.parent == data.contents:
        folder.unlink(missing_ok=True)  # packages that contain it keep their links
        return
    if folder.parent == data.jobs:
        shutil.rmtree(folder, ignore_errors=True)
        return
    with locked(data):
        gone = set_aside(f"sha256:{folder.name}", data)
    if gone is not None:
        shutil.rmtree(gone, ignore_errors=True)
