"""Jobs: list, show, change, cancel, continue, delete, pause, resume, and render one frame again; submissions.py creates
them."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable
from typing import Annotated, Literal
from urllib.parse import urlencode

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ...admission import changes_of, continued
from ...api import views
from ...api.models import ContinueRequest, JobPatch
from ...auth import Caller
from ...changes import wait
from ...http.answers import ETAG, json_answer, json_bytes, none_match, not_modified
from ...http.bodies import json_body
from ...http.callers import Reader, Serving, Submitter
from ...http.described import answer
from ...http.routing import Router
from ...jobs import TERMINAL, Frame, Job, JobState, Json, etag, version_in
from ...limits import Limits, Quotas
from ...problems import Problem
from ...service import Service
from ...store.base import Conflict, JobFilter

router = Router("/v1/jobs", resource="jobs", tag="jobs")

RETRY_AFTER_S = 2  # for clients that poll
CANCEL_S = 10.0  # time for a deleted job's workers to end
JOB_ID = re.compile(r"job_[0-9A-HJKMNP-TV-Z]{26}")
_PREFER_WAIT = re.compile(r"(?:^|[,;\s])wait=(\d{1,6})(?:$|[,;\s])", re.IGNORECASE)

# Any text is looked up and may not be found: the pattern only documents ids.
JobId = Annotated[str, Field(description="Id from POST /v1/jobs.", json_schema_extra={"pattern": f"^{JOB_ID.pattern}$"})]
FrameNumber = Annotated[int, Field(ge=0, lt=2**31, description="Index among the job's frames, from 0.")]


def found(service: Service, caller: Caller, job_id: str) -> Job:
    """Return the tenant's job; another tenant's job is reported as not found."""
    job = service.store.job(job_id, caller.tenant) if JOB_ID.fullmatch(job_id) else None
    if job is None:
        raise no_job()
    return job


def check_version(request: Request, job: Job) -> bool:
    """Return whether If-Match was sent; raises Problem if none of its tags allows a change of this version.

    Progress does not count as a change: see jobs.Job.
    """
    header = request.headers.get("if-match")
    if header is None:
        return False
    if header.strip() != "*" and job.version not in [version_in(tag) for weak, tag in ETAG.findall(header) if not weak]:
        raise Problem("precondition-failed", f"It is at {etag(job)} now.", headers={"etag": etag(job)})
    return True


def no_job() -> Problem:
    return Problem("not-found", "There is no such job.")


async def found_shared(service: Service, caller: Caller, job_id: str) -> Job:
    return (await _shared(service, caller, job_id))[0]


async def _shared(service: Service, caller: Caller, job_id: str) -> tuple[Job, bytes]:
    """Return the job and its JSON, shared by all who ask at the same time."""

    def load() -> tuple[Job, bytes] | None:
        job = service.store.job(job_id)
        return None if job is None else (job, body_of(service, job))

    seen = await service.reads.read(job_id, "job", load) if JOB_ID.fullmatch(job_id) else None
    if seen is None or seen[0].tenant != caller.tenant:
        raise no_job()
    return seen


def prefer_wait(request: Request, limits: Limits) -> float | None:
    """Return the seconds that the client would wait for a change (RFC 7240, Prefer: wait), limited by the server."""
    match = _PREFER_WAIT.search(",".join(request.headers.getlist("prefer")))
    return None if match is None else min(float(match[1]), limits.wait_s)


def job_answer(job: Job, body: bytes, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    more = {"cache-control": "private, no-cache", "etag": etag(job), **(headers or {})}
    if job.state not in TERMINAL:
        more["retry-after"] = str(RETRY_AFTER_S)
    return Response(body, status, more, media_type="application/json")


def body_of(service: Service, job: Job) -> bytes:
    """Return the job's JSON; blocks on the database for the position of a queued job."""
    return json_bytes(service.job_json(job))


async def changed(service: Service, caller: Caller, job: Job, seconds: float, is_enough: Callable[[Job], bool]) -> Job:
    """Return the job when `is_enough` accepts it, or as it is after `seconds`, or when the server stops."""
    until = time.monotonic() + seconds
    job_id = job.id

    def row() -> Job | None:
        """Return the job without its JSON: that of a queued job has its position, which costs several times as much."""
        return service.store.job(job_id)

    with service.changes.watching(job_id) as event:
        while not is_enough(job) and not service.changes.closing and (left := until - time.monotonic()) > 0:
            found = await service.reads.read(job_id, "row", row)
            if found is None or found.tenant != caller.tenant:
                raise no_job()
            job = found
            if not is_enough(job):
                await wait(event, left, service.changes.look_every_s)
    return job


def acted(service: Service, act: Callable[[], Job], conflict: Problem) -> Job:
    """Change the job in the store by `act`, notify the dispatcher, and return the job.

    Raises `conflict` if the store refuses the change, and "not-found" if the job no longer exists.
    """
    try:
        job = act()
    except Conflict:
        raise conflict from None
    except KeyError:
        raise no_job() from None
    service.dispatcher.wake()
    return job


def updated(service: Service, request: Request, job: Job, patch: JobPatch) -> tuple[Job, Json]:
    """Return the job after a PATCH, and the changes; raises Problem if it is not at the version that If-Match names."""
    version = job.version if check_version(request, job) else None
    changes = changes_of(patch, service.limits)
    conflict = Problem("precondition-failed", "It has changed since it was read.")
    act = lambda: service.store.update_job(job.id, time.time(), version=version, changes=changes)  # noqa: E731
    return acted(service, act, conflict), changes


def canceled(service: Service, job_id: str) -> Job:
    conflict = Problem("conflict", "The job has ended already, in another way.")
    return acted(service, lambda: service.store.request_cancel(job_id, time.time()), conflict)


def has_ended(job: Job) -> bool:
    return job.state in TERMINAL


@router.get("", answer(views.JobPage, headers=("Link",)), problems=("invalid-request",))
def list_jobs(
    caller: Reader,
    service: Serving,
    state: Annotated[list[JobState] | None, Field(description="Jobs in any of these states.")] = None,
    label: Annotated[
        list[Annotated[str, Field(pattern=r"^[^:=\x00]+[:=][^\x00]*$", max_length=600)]] | None,
        Field(max_length=32, description="name:value (or name=value); jobs with all of these labels."),
    ] = None,
    scene: Annotated[str | None, Field(pattern="^sha256:[0-9a-f]{64}$")] = None,
    limit: Annotated[int, Field(ge=1, le=200)] = 50,
    cursor: Annotated[str | None, Field(max_length=512, description="Cursor from the previous page.")] = None,
    order: Annotated[Literal["desc", "asc"], Field(description="Order by creation; desc: newest first.")] = "desc",
) -> Response:
    """List the tenant's jobs, a page at a time."""
    labels = dict(split_label(text) for text in label or [])
    where = JobFilter(frozenset(state or ()), labels, scene)
    try:
        page = service.store.jobs(caller.tenant, where, limit, cursor, order == "desc")
    except ValueError:
        raise Problem("invalid-request", "cursor: this cursor is not from this server's answers.", member="cursor") from None
    headers = {}
    if page.next_cursor is not None:
        query: list[tuple[str, str]] = [("state", each.value) for each in state or ()]
        query += [("label", text) for text in label or ()] + ([] if scene is None else [("scene", scene)])
        query += [("limit", str(limit)), ("order", order), ("cursor", page.next_cursor)]
        headers["link"] = f'</v1/jobs?{urlencode(query)}>; rel="next"'
    return json_answer(
        {"items": [service.job_json(job) for job in page.items], "next_cursor": page.next_cursor}, headers=headers
    )


def split_label(text: str) -> tuple[str, str]:
    match = re.fullmatch(r"([^:=\0]+)[:=]([^\0]*)", text, re.DOTALL)
    if match is None:
        raise Problem("invalid-request", "label: write it name:value.", member="label")
    return match[1], match[2]


@router.get(
    "/{job_id}",
    answer(views.Job, headers=("ETag", "Retry-After", "Preference-Applied")),
    answer(None, 304, "Unchanged since the version in If-None-Match.", headers=("ETag",)),
    problems=("not-found",),
    headers=("If-None-Match", "Prefer"),
)
async def show(job_id: JobId, request: Request, caller: Reader, service: Serving) -> Response:
    """Return a job's current state.

    With `Prefer: wait=N` the answer comes when the job has ended; with If-None-Match as well, when the job no longer has that
    version or has ended; after N seconds at the latest.
    """
    job, body = await _shared(service, caller, job_id)
    headers: dict[str, str] = {}
    seconds = prefer_wait(request, service.limits)
    if seconds is not None:
        headers["preference-applied"] = f"wait={seconds:g}"
        news = "if-none-match" in request.headers
        is_enough = (lambda now: has_ended(now) or none_match(request, etag(now))) if news else has_ended
        before = job
        job = await changed(service, caller, job, seconds, is_enough)
        body = body if job is before else await run_in_threadpool(body_of, service, job)
    if not none_match(request, etag(job)):
        return not_modified(etag(job), headers)
    return job_answer(job, body, headers=headers)


@router.patch(
    "/{job_id}",
    answer(views.Job, headers=("ETag", "Retry-After")),
    problems=("not-found", "precondition-failed", "limit-exceeded"),
    headers=("If-Match",),
)
def change(
    job_id: JobId,
    request: Request,
    caller: Submitter,
    service: Serving,
    patch: Annotated[JobPatch, json_body(JobPatch, {"priority": 80})],
) -> Response:
    """Change a job's priority, labels or time to live."""
    job, _ = updated(service, request, found(service, caller, job_id), patch)
    return job_answer(job, body_of(service, job))


@router.post(
    "/{job_id}/cancel",
    answer(views.Job, 202, "The job has ended, or ends soon.", headers=("ETag", "Retry-After")),
    problems=("not-found", "conflict", "precondition-failed"),
    headers=("If-Match",),
)
def cancel(job_id: JobId, request: Request, caller: Submitter, service: Serving) -> Response:
    """Cancel a job; the picture rendered so far is kept. Repeating the request is harmless."""
    check_version(request, found(service, caller, job_id))
    job = canceled(service, job_id)
    return job_answer(job, body_of(service, job), 202)


@router.post(
    "/{job_id}/continue",
    answer(views.Job, 202, "The job is queued again.", headers=("ETag", "Location", "Retry-After")),
    problems=("not-found", "conflict", "limit-exceeded", "precondition-failed", "quota-exceeded"),
    headers=("If-Match",),
)
def go_on(
    job_id: JobId,
    request: Request,
    caller: Submitter,
    service: Serving,
    asked: Annotated[ContinueRequest, json_body(ContinueRequest, {"stop": {"target_error": 0.005}}, may_lack=True)],
) -> Response:
    """Continue a job from where it ended, to a lower error, more samples or more time.

    A job that did not succeed (canceled, failed, expired) needs no body: it continues with its own rules.
    """
    job = found(service, caller, job_id)
    check_version(request, job)
    if job.state not in TERMINAL:
        raise Problem("conflict", f"The job is {job.state.value}; only one that has ended can continue.", state=job.state.value)
    stop = continued(job, asked.stop, service.limits)
    quotas = service.quotas_of(caller)
    conflict = Problem("conflict", "The job cannot continue: it is not at its end any more, or its scene was deleted.")
    job = acted(service, lambda: service.store.continue_job(job_id, stop, time.time(), quotas), conflict)
    return job_answer(job, body_of(service, job), 202, {"location": f"/v1/jobs/{job.id}"})


@router.delete(
    "/{job_id}",
    answer(None, 204, "The job and its files are deleted."),
    problems=("not-found", "precondition-failed", "unavailable"),
    headers=("If-Match",),
)
async def delete(job_id: JobId, request: Request, caller: Submitter, service: Serving) -> Response:
    """Cancel a job if it has not ended, and delete it with all its outputs."""
    check_version(request, await run_in_threadpool(found, service, caller, job_id))
    until = time.monotonic() + CANCEL_S
    while not await run_in_threadpool(removed, service, job_id):
        if time.monotonic() > until or service.changes.closing:
            raise Problem(
                "unavailable", "The job is being canceled; repeat the request in a moment.", headers={"retry-after": "1"}
            )
        await asyncio.sleep(0.05)
    return Response(status_code=204)


def removed(service: Service, job_id: str) -> bool:
    """Delete the job; False while one of its frames runs, which is being stopped."""
    job = service.store.job(job_id)
    try:
        if job is not None and job.state not in TERMINAL:
            job = service.store.request_cancel(job_id, time.time())
            service.dispatcher.wake()
        if job is not None:
            service.store.delete_job(job_id)
    except Conflict:
        return False
    except KeyError:
        pass  # another request deleted it meanwhile
    service.data.remove_job(job_id)
    return True


interventions_router = Router("/v1/jobs", resource="interventions", tag="jobs")

CHANGED = ("not-found", "conflict", "precondition-failed")


@interventions_router.post(
    "/{job_id}/pause",
    answer(views.Job, 202, "The job is paused, or soon will be.", headers=("ETag", "Retry-After")),
    problems=CHANGED,
    headers=("If-Match",),
)
def pause(job_id: JobId, request: Request, caller: Submitter, service: Serving) -> Response:
    """Pause a job: running frames write a checkpoint and free their workers, and no frame starts until it is resumed."""
    check_version(request, found(service, caller, job_id))
    job = paused(service, job_id)
    return job_answer(job, body_of(service, job), 202)


@interventions_router.post(
    "/{job_id}/resume",
    answer(views.Job, 202, "Its frames are queued again.", headers=("ETag", "Retry-After")),
    problems=CHANGED,
    headers=("If-Match",),
)
def resume(job_id: JobId, request: Request, caller: Submitter, service: Serving) -> Response:
    """Resume a paused job: its frames continue from their checkpoints. A job that is not paused does not change."""
    check_version(request, found(service, caller, job_id))
    job = resumed(service, job_id)
    return job_answer(job, body_of(service, job), 202)


@interventions_router.post(
    "/{job_id}/frames/{number}/retry",
    answer(views.Job, 202, "The frame is queued again.", headers=("ETag", "Retry-After")),
    problems=("not-found", "conflict", "invalid-request", "precondition-failed", "quota-exceeded"),
    headers=("If-Match",),
)
def retry(job_id: JobId, number: FrameNumber, request: Request, caller: Submitter, service: Serving) -> Response:
    """Render one finished frame again, from its first sample; the job's other frames stay as they are.

    Its files stay until new ones of the same names replace them. A job that had ended is queued again.
    """
    check_version(request, found(service, caller, job_id))
    job = retried(service, job_id, number, service.quotas_of(caller))
    return job_answer(job, body_of(service, job), 202)


def paused(service: Service, job_id: str) -> Job:
    conflict = Problem("conflict", "Only a job that has not ended, and is not being canceled, can be paused.")
    return acted(service, lambda: service.store.request_pause(job_id, time.time()), conflict)


def resumed(service: Service, job_id: str) -> Job:
    conflict = Problem("conflict", "Only a job that has not ended, and is not being canceled, can be resumed.")
    return acted(service, lambda: service.store.request_resume(job_id, time.time()), conflict)


def retried(service: Service, job_id: str, number: int, quotas: Quotas) -> Job:
    frame = _frame(service, job_id, number)
    said = f"Frame {number} is {frame.state.value}: only a frame that has ended can be retried, while its scene exists."
    conflict = Problem("conflict", said, state=frame.state.value)
    return acted(service, lambda: service.store.retry_frame(job_id, number, frame.attempt, time.time(), quotas), conflict)


def _frame(service: Service, job_id: str, number: int) -> Frame:
    frame = service.store.frame(job_id, number)
    if frame is None:
        raise Problem("not-found", "The job has no such frame.")
    return frame
