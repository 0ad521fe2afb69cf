"""Workers and running frames, for an administrator."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from starlette.responses import Response

from ...api import views
from ...api.job_json import time_text
from ...http.answers import json_answer
from ...http.callers import Admin, Serving
from ...http.described import answer
from ...http.routing import Router
from ...jobs import Frame, Job, Json

router = Router("/v1/admin/workers", tag="admin")


@router.get("", answer(views.Workers), problems=("invalid-request",))
def list_workers(
    caller: Admin,
    service: Serving,
    limit: Annotated[int, Field(ge=1, le=1000, description="Most running frames to list.")] = 200,
) -> Response:
    """Return the executor of the server that dispatches, its nodes, and the running frames of all tenants, by start time."""
    leading = service.who_leads.now()
    capacity = leading.capacity
    here: Json = {"id": "local", "slots": capacity.slots, "why": ""}
    return json_answer(
        {
            "dispatcher": leading.where,
            "slots": capacity.slots,
            "cores": capacity.cores,
            "memory_bytes": capacity.memory_bytes,
            "nodes": list(leading.nodes) or [here],
            "running": [_running_json(job, frame) for job, frame in service.store.running_frames(limit)],
        }
    )


def _running_json(job: Job, frame: Frame) -> Json:
    return {
        "job": job.id,
        "name": job.name,
        "tenant": job.tenant,
        "priority": job.priority,
        "state": job.state.value,
        "frame": frame.number,
        "time_code": frame.time_code,
        "phase": frame.phase,
        "fraction": float(frame.progress.get("fraction", 0.0)),
        "parts": job.parallel,
        "started_at": time_text(frame.started_at),
        "cpu_s": frame.cpu_s,
    }
