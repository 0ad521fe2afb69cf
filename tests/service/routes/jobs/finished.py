"""Jobs that are as far as a test wants them, made by the store's own methods on a server that dispatches nothing."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.service.scenes.zips import LAYER
from tests.service.serving import RunningServer

from primray_service.files import DataDirectory
from primray_service.jobs import Frame, FrameState, Output
from primray_service.limits import Quotas
from primray_service.store import open_store

MEDIA_TYPES = {".exr": "image/x-exr", ".png": "image/png", ".json": "application/json"}


def queued_job(server: RunningServer, **settings: Any) -> str:
    """Its id; the scene is one of its own."""
    client = server.client()
    scene = client.post("/v1/scenes", content=LAYER + os.urandom(8).hex().encode()).json()
    job = client.post("/v1/jobs", json={"scene": {"id": scene["id"]}, "settings": settings})
    assert job.status_code == 202, job.text
    return str(job.json()["id"])


def running_frame(server: RunningServer, job_id: str) -> tuple[int, Frame]:
    """The fence, and the frame as a dispatcher has it."""
    store = open_store(f"sqlite:///{server.data / 'primray.sqlite'}")
    now = time.time()
    fence = store.acquire_lease("test", now, 0.0)
    assert fence is not None
    while (scene := store.next_check(fence)) is not None:
        store.scene_checked(fence, scene.id, now, facts={"entries": []}, warnings=[], problem=None)
    claim = store.claim_frame(fence, now, lambda _: Quotas())
    assert claim is not None
    assert claim.job.id == job_id
    store.close()
    return fence, claim.frame


def finished_job(server: RunningServer, files: Mapping[str, bytes], state: FrameState = FrameState.SUCCEEDED) -> str:
    """A job of one frame that ended with these outputs."""
    job_id = queued_job(server)
    fence, frame = running_frame(server, job_id)
    folder = DataDirectory(server.data).outputs(job_id)
    folder.mkdir(parents=True)
    outputs = []
    for name, data in files.items():
        (folder / name).write_bytes(data)
        digest = hashlib.sha256(data).hexdigest()
        outputs.append(Output(job_id, name, 0, len(data), digest, MEDIA_TYPES[Path(name).suffix], time.time()))
    store = open_store(f"sqlite:///{server.data / 'primray.sqlite'}")
    store.end_frame(fence, replace(frame, state=state), time.time(), outputs=outputs, job_changes={})
    store.close()
    return job_id
