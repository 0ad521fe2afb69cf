"""Preparation of a staged upload for storage: it is recognised, unpacked, described and synced; and the lock of scenes/.

A folder in scenes/ appears complete, by one rename, after everything in it was synced; the row follows. So a crash leaves at
worst a folder without a row, which a sweep removes. The lock keeps an upload from relying on bytes that are about to be
removed; it is a lock of a file open for writing, since servers on several machines may share a data directory (staging.py).
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..files import DataDirectory
from ..jobs import Json, Scene, SceneState
from ..limits import Limits
from ..problems import problem_of
from .entries import candidates
from .receive import Received
from .recognize import HEAD_BYTES, called_usdz, recognize, without_layers, wrong_as_usdz
from .unpack import unpack
from .zip_directory import read_directory
from .zip_names import refuse_names

ABOUT = "about.json"  # description from unpacking, for the next tenant who sends the same bytes
LIBC = ctypes.CDLL(None, use_errno=True)


def set_aside(scene_id: str, data: DataDirectory) -> Path | None:
    """Rename the scene's folder out of scenes/ at once, since its deletion may take long."""
    gone = Path(tempfile.mkdtemp(prefix="gone-", dir=data.incoming))
    try:
        os.rename(data.scene(scene_id), gone)
    except FileNotFoundError:
        shutil.rmtree(gone, ignore_errors=True)
        return None
    return gone


@contextmanager
def locked(data: DataDirectory) -> Iterator[None]:
    lock = os.open(data.root / "scenes.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def prepare(received: Received, data: DataDirectory, limits: Limits) -> Json:
    """Recognise, unpack and describe the upload, and sync all of it."""
    staged = received.path.parent
    with received.path.open("rb") as file:
        kind: str = recognize(file.read(HEAD_BYTES), received.name)
        about: Json = {"kind": kind, "files": 1, "unpacked_bytes": 0}
        if kind == "zip":
            members = read_directory(file, limits)
            refuse_names(members, limits)
            wrong = wrong_as_usdz(members)
            if wrong is None:
                about["kind"] = "usdz"
            else:
                about["no_usdz_because"] = wrong.as_json()
                refuse_as_usdz(received, about)
                paths = [member.name for member in members if not member.is_folder]
                if not candidates(paths):
                    raise without_layers(paths)
                unpacked = unpack(file, members, staged / "package", limits, data.free_bytes)
                about |= {"files": unpacked.files, "unpacked_bytes": unpacked.bytes}
    (staged / ABOUT).write_text(json.dumps(about))
    sync_all(staged)
    return about


def refuse_as_usdz(received: Received, about: Json) -> None:
    """Raise Problem for a zip that was sent as a usdz, but is not one."""
    if about["kind"] == "zip" and called_usdz(received.media_type, received.name):
        raise problem_of(about["no_usdz_because"])


def sync_all(folder: Path) -> None:
    """Sync all files of a folder by one call for the whole file system, since a package may have thousands."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        if LIBC.syncfs(handle):  # syncfs(2)
            raise OSError(ctypes.get_errno(), "syncfs failed")
    finally:
        os.close(handle)


def scene_row(received: Received, tenant: str, about: Json, now: float) -> Scene:
    return Scene(
        id=received.scene_id,
        tenant=tenant,
        state=SceneState.CHECKING,
        kind=about["kind"],
        name=received.name,
        bytes=received.bytes,
        stored_bytes=received.bytes + about["unpacked_bytes"],
        created_at=now,
        used_at=now,
    )
