"""Storage of scenes: from a staged file to scenes/<hex> and a row in the store, and removal; shared.py is for a shared object
store."""

from __future__ import annotations

import json
import os
import shutil

from ..files import DataDirectory, sync
from ..jobs import Json, Scene
from ..limits import Limits, Quotas
from ..store.base import Store
from . import shared
from .contents import release
from .preparing import ABOUT, locked, prepare, refuse_as_usdz, scene_row, set_aside
from .receive import Received
from .staging import sweep as sweep_incoming


def keep(
    received: Received, tenant: str, store: Store, data: DataDirectory, limits: Limits, quotas: Quotas, now: float
) -> tuple[Scene, bool]:
    """Return the tenant's scene of these bytes, and whether it is new. Blocks. Raises Problem if it is refused."""
    if data.objects is not None:
        return shared.keep(received, tenant, store, data, data.objects, limits, quotas, now)
    folder = data.scene(received.scene_id)
    staged = received.path.parent
    about: Json | None = None
    while True:
        with locked(data):
            if about is not None and not folder.exists():
                os.rename(staged, folder)
                sync(data.scenes)
                moved = True
            else:
                moved = False
            if folder.exists():
                about = json.loads((folder / ABOUT).read_text())
                try:
                    refuse_as_usdz(received, about)
                    return store.put_scene(scene_row(received, tenant, about, now), quotas)
                except BaseException:
                    if moved:
                        os.rename(folder, staged)
                    raise
        about = prepare(received, data, limits)


def remove(scene_id: str, tenant: str, store: Store, data: DataDirectory) -> None:
    """Remove the tenant's row, and the bytes if no other tenant has them. Conflict, KeyError: see Store.delete_scene.
    Blocks."""
    contents = store.contents_of_scene(tenant, scene_id)
    with shared.removing(scene_id, store, data), locked(data):
        is_nobodys = store.delete_scene(tenant, scene_id)
        gone = set_aside(scene_id, data) if is_nobodys else None
        if is_nobodys:
            shared.remove(scene_id, data)
    release(contents, tenant, store, data)
    if gone is not None:
        shutil.rmtree(gone, ignore_errors=True)


def sweep(store: Store, data: DataDirectory) -> int:
    """Remove uploads that were in progress when their server died, and folders without rows; return their number."""
    removed = sweep_incoming(data.incoming)
    ids = [f"sha256:{folder.name}" for folder in data.scenes.iterdir() if len(folder.name) == 64]
    for scene_id in ids:
        with locked(data):
            gone = None if store.has_scene(scene_id) else set_aside(scene_id, data)
        if gone is not None:
            shutil.rmtree(gone, ignore_errors=True)
            removed += 1
    return removed
