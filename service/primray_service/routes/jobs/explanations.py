"""One pixel of a frame's picture in parts, as `primray explain` prints it."""

from __future__ import annotations

import time
from typing import Annotated

from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from ...admission import products_by_name
from ...api import views
from ...api.models import PixelRequest
from ...auth import Caller
from ...http.answers import json_answer
from ...http.bodies import json_body
from ...http.callers import Serving, Submitter
from ...http.described import answer
from ...http.routing import Router
from ...jobs import FRAME_TERMINAL, Frame, Job, Scene, SceneState
from ...problems import Problem
from ...service import Service
from ...store.base import QuotaExceeded
from .jobs import FrameNumber, JobId, found

router = Router("/v1/jobs", resource="explanations", tag="jobs")


@router.post(
    "/{job_id}/frames/{number}/explain",
    answer(views.ExplainedPixel),
    problems=(
        *("not-found", "conflict", "quota-exceeded"),
        *("time-limit", "memory-limit", "storage-limit", "settings-rejected", "scene-rejected", "layer-unreadable"),
        *("scene-too-large", "limit-exceeded", "strict-warnings", "renderer-crashed", "render-failed", "internal"),
    ),
)
async def explain(
    job_id: JobId,
    number: FrameNumber,
    caller: Submitter,
    service: Serving,
    asked: Annotated[PixelRequest, json_body(PixelRequest, {"x": 12, "y": 8})],
) -> Response:
    """Return whose light one pixel of a frame that has ended is made of: by light, by kind of path, by bounce, and by the prim
    that sends it, with errors, and the paths that make its noise.

    The pixel is rendered again with the job's settings and as many samples as the picture has of it on average (at most 1,024),
    and with 15 other seeds. That takes a moment, and CPU seconds that count towards the tenant's day.
    """
    job, frame, scene = await run_in_threadpool(_explainable, service, caller, job_id, number)
    if service.explanations is None:
        raise Problem("unavailable", "This server runs no workers; send the request to one that does.")
    return json_answer(
        await service.explanations.explain(job, frame, scene, (asked.x, asked.y)),
        headers={"cache-control": "private, no-store"},
    )


def _explainable(service: Service, caller: Caller, job_id: str, number: int) -> tuple[Job, Frame, Scene]:
    """Return what is needed of the store; raises Problem where the frame cannot be explained, or QuotaExceeded."""
    job = found(service, caller, job_id)
    frame = service.store.frame(job_id, number)
    if frame is None:
        raise Problem("not-found", "The job has no such frame.")
    if frame.state not in FRAME_TERMINAL:
        sentence = f"Frame {number} is {frame.state.value}: only pixels of a frame that has ended are explained."
        raise Problem("conflict", sentence, state=frame.state.value)
    if products_by_name(job.settings) is not None:
        raise Problem("conflict", "The job renders products in files of their own; pixels of one picture alone are explained.")
    scene = service.store.scene(job.tenant, job.scene_id)
    if scene is None or scene.state is not SceneState.READY:
        raise Problem("conflict", "The job's scene was deleted, or could not be read.")
    most = service.quotas_of(caller).cpu_s_per_day
    if most is not None and service.store.usage(job.tenant, time.time()).cpu_s_today >= most:
        raise QuotaExceeded("cpu_s_per_day")
    return job, frame, scene
