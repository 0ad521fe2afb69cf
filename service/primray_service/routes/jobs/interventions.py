"""Interventions in jobs: pause, resume, and render one frame again."""

from __future__ import annotations

import time

from starlette.requests import Request
from starlette.responses import Response

from ...api import views
from ...http.callers import Serving, Submitter
from ...http.described import answer
from ...http.routing import Router
from ...jobs import Frame, Job
from ...limits import Quotas
from ...problems import Problem
from ...service import Service
from .frames import FrameNumber
from .jobs import JobId, acted, body_of, check_version, found, job_answer

router = Router("/v1/jobs", resource="interventions", tag="jobs")

CHANGED = ("not-found", "conflict", "precondition-failed")


@router.post(
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


@router.post(
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


@router.post(
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
