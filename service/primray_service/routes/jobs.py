"""Jobs: submit, list, look at, change, cancel, go on, delete."""

from __future__ import annotations

import asyncio
import re
import shutil
import time
from collections.abc import Callable
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.concurrency import run_in_threadpool

from ..admission import changes_of, fingerprint, new_job
from ..auth import Caller
from ..changes import wait
from ..job_json import job_json
from ..jobs import TERMINAL, Job, JobState, SceneState
from ..limits import Limits
from ..models import ContinueRequest, JobPatch, JobRequest
from ..problems import Problem, problem_of
from ..service import Service
from ..stop_rules import continued
from ..store.base import Conflict, JobFilter, KeyReused
from .access import Reader, Serving, Submitter
from .answers import check_match, json_answer, none_match, not_modified
from .bodies import json_body
from .guard import request_id_of

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

RETRY_AFTER_S = 2  # for who asks again and again
_PREFER_WAIT = re.compile(r"(?:^|[,;\s])wait=(\d{1,6})(?:$|[,;\s])", re.IGNORECASE)
_IDEMPOTENCY_KEY = re.compile(r"[\x21-\x7e](?:[\x20-\x7e]{0,253}[\x21-\x7e])?")
_TRACEPARENT = re.compile(r"[0-9a-f]{2}-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}")


def etag_of(job: Job) -> str:
    return f'"{job.version}"'


def no_job() -> Problem:
    return Problem("not-found", "There is no such job.")


def found(service: Service, caller: Caller, job_id: str) -> Job:
    """The tenant's job; another tenant's is as if it did not exist."""
    job = service.store.job(job_id, caller.tenant)
    if job is None:
        raise no_job()
    return job


def prefer_wait(request: Request, limits: Limits) -> float | None:
    """Seconds that the client would wait for an answer with more in it (RFC 7240), at most as long as is allowed."""
    match = _PREFER_WAIT.search(",".join(request.headers.getlist("prefer")))
    return None if match is None else min(float(match[1]), limits.wait_s)


def job_answer(job: Job, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    more = {"etag": etag_of(job), **(headers or {})}
    if job.state not in TERMINAL:
        more["retry-after"] = str(RETRY_AFTER_S)
    return json_answer(job_json(job), status, more)


@router.post("", status_code=202)
async def submit(
    request: Request, caller: Submitter, service: Serving, asked: Annotated[JobRequest, Depends(json_body(JobRequest))]
) -> Response:
    """Queue a job."""
    job, is_new = await run_in_threadpool(create, service, caller, asked, request)
    headers = {"location": f"/v1/jobs/{job.id}"}
    if not is_new:
        headers["idempotency-replayed"] = "true"
    seconds = prefer_wait(request, service.limits)
    if seconds is not None:
        headers["preference-applied"] = f"wait={seconds:g}"
        job = await ended(service, caller, job, seconds)
        return job_answer(job, 200 if job.state in TERMINAL else 202, headers)
    return job_answer(job, 202, headers)


def create(service: Service, caller: Caller, asked: JobRequest, request: Request) -> tuple[Job, bool]:
    """The new job, or the earlier one of the same idempotency key (False)."""
    traceparent = request.headers.get("traceparent", "")
    job, times = new_job(
        asked,
        caller.tenant,
        service.limits,
        time.time(),
        request_id=request_id_of(request),
        traceparent=traceparent if _TRACEPARENT.fullmatch(traceparent) else "",
    )
    key = idempotency_key(request)
    scene = service.store.scene(caller.tenant, asked.scene.id)
    if scene is None:
        raise no_scene()
    if scene.state is SceneState.REJECTED and scene.problem is not None:
        raise problem_of(scene.problem)
    try:
        job, is_new = service.store.create_job(
            job, times, caller.quotas(service.quotas), None if key is None else (key, fingerprint(asked))
        )
    except KeyReused:
        raise Problem("idempotency-key-reused", "The first request with this key asked for something else.") from None
    except Conflict:
        raise no_scene() from None
    service.dispatcher.wake()
    return job, is_new


def no_scene() -> Problem:
    return Problem("not-found", "scene.id: there is no such scene; upload it first (POST /v1/scenes).", member="scene.id")


def idempotency_key(request: Request) -> str | None:
    key = request.headers.get("idempotency-key")
    if key is not None and not _IDEMPOTENCY_KEY.fullmatch(key):
        raise Problem("invalid-request", "Idempotency-Key: 1 to 255 printable ASCII characters.", member="Idempotency-Key")
    return key


async def ended(service: Service, caller: Caller, job: Job, seconds: float) -> Job:
    """The job when it is at an end, or as it is after so many seconds, or when the server stops."""
    return await changed(service, caller, job, seconds, lambda now: now.state in TERMINAL)


async def changed(service: Service, caller: Caller, job: Job, seconds: float, is_enough: Callable[[Job], bool]) -> Job:
    """The job when it is enough, or as it is after so many seconds, or when the server stops."""
    until = time.monotonic() + seconds
    with service.changes.watching(job.id) as event:
        while not is_enough(job) and not service.changes.closing and (left := until - time.monotonic()) > 0:
            await wait(event, left)
            job = await run_in_threadpool(found, service, caller, job.id)
    return job


@router.get("")
def list_jobs(
    caller: Reader,
    service: Serving,
    state: Annotated[list[JobState] | None, Query()] = None,
    label: Annotated[list[str] | None, Query(max_length=32)] = None,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
    cursor: Annotated[str | None, Query(max_length=512)] = None,
    order: Annotated[str, Query(pattern="^(newest|oldest)$")] = "newest",
) -> Response:
    """The tenant's jobs, a page at a time."""
    labels = dict(split_label(text) for text in label or [])
    where = JobFilter(frozenset(state or ()), labels)
    try:
        page = service.store.jobs(caller.tenant, where, limit, cursor, order == "newest")
    except ValueError:
        raise Problem("invalid-request", "cursor: this is not a cursor that the server gave.", member="cursor") from None
    headers = {}
    if page.next_cursor is not None:
        query: list[tuple[str, str]] = [("state", each.value) for each in state or ()]
        query += [("label", text) for text in label or ()]
        query += [("limit", str(limit)), ("order", order), ("cursor", page.next_cursor)]
        headers["link"] = f'</v1/jobs?{urlencode(query)}>; rel="next"'
    return json_answer({"items": [job_json(job) for job in page.items], "next_cursor": page.next_cursor}, headers=headers)


def split_label(text: str) -> tuple[str, str]:
    match = re.fullmatch(r"([^:=\0]+)[:=]([^\0]*)", text, re.DOTALL)
    if match is None:
        raise Problem("invalid-request", "label: write it name:value.", member="label")
    return match[1], match[2]


@router.get("/{job_id}")
async def show(job_id: str, request: Request, caller: Reader, service: Serving) -> Response:
    """A job; with `Prefer: wait`, when it has ended, or is not as If-None-Match says any more."""
    job = await run_in_threadpool(found, service, caller, job_id)
    headers: dict[str, str] = {}
    seconds = prefer_wait(request, service.limits)
    if seconds is not None:
        headers["preference-applied"] = f"wait={seconds:g}"
        if "if-none-match" in request.headers:
            job = await changed(service, caller, job, seconds, lambda now: none_match(request, etag_of(now)))
        else:
            job = await ended(service, caller, job, seconds)
    if not none_match(request, etag_of(job)):
        return not_modified(etag_of(job), headers)
    return job_answer(job, headers=headers)


@router.patch("/{job_id}")
def change(
    job_id: str,
    request: Request,
    caller: Submitter,
    service: Serving,
    patch: Annotated[JobPatch, Depends(json_body(JobPatch))],
) -> Response:
    """Change priority, labels or time to live."""
    job = found(service, caller, job_id)
    matched = check_match(request, etag_of(job))
    try:
        job = service.store.update_job(
            job_id, time.time(), version=job.version if matched else None, changes=changes_of(patch, service.limits)
        )
    except Conflict:
        raise Problem("precondition-failed", "It has changed since it was read.") from None
    service.dispatcher.wake()
    return job_answer(job)


@router.post("/{job_id}/cancel", status_code=202)
def cancel(job_id: str, caller: Submitter, service: Serving) -> Response:
    """End a job; the picture made so far is kept."""
    found(service, caller, job_id)
    try:
        job = service.store.request_cancel(job_id, time.time())
    except Conflict:
        raise Problem("conflict", "The job has ended already.") from None
    service.dispatcher.wake()
    return job_answer(job, 202)


@router.post("/{job_id}/continue", status_code=202)
def go_on(
    job_id: str,
    caller: Submitter,
    service: Serving,
    asked: Annotated[ContinueRequest, Depends(json_body(ContinueRequest))],
) -> Response:
    """Go on from where the job ended, to a lower error, more samples or more time."""
    job = found(service, caller, job_id)
    if job.state not in TERMINAL:
        raise Problem("conflict", f"The job is {job.state.value}; only one that has ended can go on.", state=job.state.value)
    stop = continued(job, asked.stop, service.limits)
    try:
        job = service.store.continue_job(job_id, stop, time.time(), caller.quotas(service.quotas))
    except Conflict:
        raise Problem("conflict", "The job is going on already.") from None
    service.dispatcher.wake()
    return job_answer(job, 202, {"location": f"/v1/jobs/{job.id}"})


@router.delete("/{job_id}", status_code=204)
async def delete(job_id: str, caller: Submitter, service: Serving) -> Response:
    """Cancel a job if it has not ended, and remove it with all its outputs."""
    await run_in_threadpool(found, service, caller, job_id)
    until = time.monotonic() + 10.0
    while not await run_in_threadpool(remove, service, job_id):
        if time.monotonic() > until:
            raise Problem("unavailable", "The job is being canceled; try again.", headers={"retry-after": "1"})
        await asyncio.sleep(0.05)
    return Response(status_code=204)


def remove(service: Service, job_id: str) -> bool:
    """False while a frame of it runs, which is being stopped."""
    job = service.store.job(job_id)
    if job is not None and job.state not in TERMINAL:
        service.store.request_cancel(job_id, time.time())
        service.dispatcher.wake()
    try:
        service.store.delete_job(job_id)
    except Conflict:
        return False
    shutil.rmtree(service.data.job(job_id), ignore_errors=True)
    return True
