"""Jobs of all tenants, for an administrator: list, show, change, cancel, pause, resume, retry a frame; and the workers that
run them.

Pictures and scenes are the tenant's alone: no route here returns them.
"""

from __future__ import annotations

from typing import Annotated, Literal
from urllib.parse import urlencode

from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response

from ..api import views
from ..api.job_json import frame_json, time_text
from ..api.models import JobPatch
from ..http.answers import json_answer, json_bytes
from ..http.bodies import json_body
from ..http.callers import Admin, Serving, audit
from ..http.described import answer
from ..http.routing import Router
from ..jobs import Frame, Job, JobState, Json
from ..problems import Problem
from ..service import Service
from ..store.base import JobFilter
from .jobs.jobs import (
    JOB_ID,
    FrameNumber,
    JobId,
    canceled,
    check_version,
    job_answer,
    no_job,
    paused,
    resumed,
    retried,
    split_label,
    updated,
)

router = Router("/v1/admin/jobs", resource="admin_jobs", tag="admin")

CHANGED = ("not-found", "conflict", "precondition-failed")
TENANT_TEXT = "Only jobs of this tenant."


def admin_json(service: Service, job: Job) -> Json:
    return {**service.job_json(job), "tenant": job.tenant}


def found(service: Service, job_id: str) -> Job:
    job = service.store.job(job_id) if JOB_ID.fullmatch(job_id) else None
    if job is None:
        raise no_job()
    return job


def answered(service: Service, job: Job, status: int = 200) -> Response:
    return job_answer(job, json_bytes(admin_json(service, job)), status)


@router.get("", answer(views.AdminJobPage, headers=("Link",)), problems=("invalid-request",))
def list_jobs(
    caller: Admin,
    service: Serving,
    tenant: Annotated[str | None, Field(max_length=64, description=TENANT_TEXT)] = None,
    state: Annotated[list[JobState] | None, Field(description="Jobs in any of these states.")] = None,
    label: Annotated[
        list[Annotated[str, Field(pattern=r"^[^:=\x00]+[:=][^\x00]*$", max_length=600)]] | None,
        Field(max_length=32, description="name:value; jobs with all of these labels; requires tenant."),
    ] = None,
    limit: Annotated[int, Field(ge=1, le=200)] = 50,
    cursor: Annotated[str | None, Field(max_length=512, description="Cursor from the previous page.")] = None,
    order: Annotated[Literal["desc", "asc"], Field(description="Order by creation; desc: newest first.")] = "desc",
) -> Response:
    """List jobs of all tenants, or of one, a page at a time."""
    if label and tenant is None:
        raise Problem(
            "invalid-request", "label: labels are searched within one tenant; name the tenant as well.", member="label"
        )
    where = JobFilter(frozenset(state or ()), dict(split_label(text) for text in label or []))
    try:
        page = service.store.jobs(tenant, where, limit, cursor, order == "desc")
    except ValueError:
        raise Problem("invalid-request", "cursor: this cursor is not from this server's answers.", member="cursor") from None
    headers = {}
    if page.next_cursor is not None:
        query: list[tuple[str, str]] = [("state", each.value) for each in state or ()]
        query += [("label", text) for text in label or ()] + ([] if tenant is None else [("tenant", tenant)])
        query += [("limit", str(limit)), ("order", order), ("cursor", page.next_cursor)]
        headers["link"] = f'</v1/admin/jobs?{urlencode(query)}>; rel="next"'
    items = [admin_json(service, job) for job in page.items]
    return json_answer({"items": items, "next_cursor": page.next_cursor}, headers=headers)


@router.get("/{job_id}", answer(views.AdminJob, headers=("ETag", "Retry-After")), problems=("not-found",))
def show(job_id: JobId, caller: Admin, service: Serving) -> Response:
    """Return one job of any tenant."""
    return answered(service, found(service, job_id))


@router.get("/{job_id}/frames", answer(views.AdminFramePage), problems=("not-found", "invalid-request"))
def frames(
    job_id: JobId,
    caller: Admin,
    service: Serving,
    limit: Annotated[int, Field(ge=1, le=1000)] = 200,
    after: Annotated[int, Field(ge=-1, lt=2**31, description="Only frames with higher numbers.")] = -1,
) -> Response:
    """List the frames of a job of any tenant, in order, a page at a time."""
    found(service, job_id)
    rows = service.store.frames(job_id, limit + 1, after)
    next_after = rows[limit - 1].number if len(rows) > limit else None
    return json_answer({"items": [frame_json(row) for row in rows[:limit]], "next_after": next_after})


@router.patch(
    "/{job_id}",
    answer(views.AdminJob, headers=("ETag", "Retry-After")),
    problems=("not-found", "precondition-failed", "limit-exceeded"),
    headers=("If-Match",),
)
def change(
    job_id: JobId,
    request: Request,
    caller: Admin,
    service: Serving,
    patch: Annotated[JobPatch, json_body(JobPatch, {"priority": 80})],
) -> Response:
    """Change the priority, labels, name or time to live of a job of any tenant."""
    job, changes = updated(service, request, found(service, job_id), patch)
    audit(caller, "change-job", job.tenant, job_id=job_id, changes=changes)
    return answered(service, job)


@router.post(
    "/{job_id}/cancel",
    answer(views.AdminJob, 202, "The job has ended, or ends soon.", headers=("ETag", "Retry-After")),
    problems=CHANGED,
    headers=("If-Match",),
)
def cancel(job_id: JobId, request: Request, caller: Admin, service: Serving) -> Response:
    """Cancel a job of any tenant; the picture rendered so far is kept."""
    check_version(request, found(service, job_id))
    job = canceled(service, job_id)
    audit(caller, "cancel-job", job.tenant, job_id=job_id)
    return answered(service, job, 202)


@router.post(
    "/{job_id}/pause",
    answer(views.AdminJob, 202, "The job is paused, or soon will be.", headers=("ETag", "Retry-After")),
    problems=CHANGED,
    headers=("If-Match",),
)
def pause(job_id: JobId, request: Request, caller: Admin, service: Serving) -> Response:
    """Pause a job of any tenant."""
    check_version(request, found(service, job_id))
    job = paused(service, job_id)
    audit(caller, "pause-job", job.tenant, job_id=job_id)
    return answered(service, job, 202)


@router.post(
    "/{job_id}/resume",
    answer(views.AdminJob, 202, "Its frames are queued again.", headers=("ETag", "Retry-After")),
    problems=CHANGED,
    headers=("If-Match",),
)
def resume(job_id: JobId, request: Request, caller: Admin, service: Serving) -> Response:
    """Resume a paused job of any tenant."""
    check_version(request, found(service, job_id))
    job = resumed(service, job_id)
    audit(caller, "resume-job", job.tenant, job_id=job_id)
    return answered(service, job, 202)


@router.post(
    "/{job_id}/frames/{number}/retry",
    answer(views.AdminJob, 202, "The frame is queued again.", headers=("ETag", "Retry-After")),
    problems=("not-found", "conflict", "invalid-request", "precondition-failed", "quota-exceeded"),
    headers=("If-Match",),
)
def retry(job_id: JobId, number: FrameNumber, request: Request, caller: Admin, service: Serving) -> Response:
    """Render one frame of a job of any tenant again; it counts towards that tenant's usage."""
    job = found(service, job_id)
    check_version(request, job)
    job = retried(service, job_id, number, service.tenant_quotas.of(job.tenant))
    audit(caller, "retry-frame", job.tenant, job_id=job_id, frame=number)
    return answered(service, job, 202)


workers_router = Router("/v1/admin/workers", resource="admin_workers", tag="admin")


@workers_router.get("", answer(views.Workers), problems=("invalid-request",))
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
