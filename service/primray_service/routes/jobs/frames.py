"""The frames of a job, each with its own state."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from starlette.responses import Response

from ...api import views
from ...api.job_json import frame_json
from ...http.answers import json_answer
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.routing import Router
from ...problems import Problem
from .jobs import JobId, found

router = Router("/v1/jobs", tag="jobs")

FrameNumber = Annotated[int, Field(ge=0, lt=2**31, description="Index among the job's frames, from 0.")]


@router.get("/{job_id}/frames", answer(views.FramePage, headers=("Link",)), problems=("not-found", "invalid-request"))
def frames(
    job_id: JobId,
    caller: Reader,
    service: Serving,
    limit: Annotated[int, Field(ge=1, le=1000)] = 200,
    after: Annotated[int | None, Field(ge=-1, lt=2**31, description="Only frames with higher numbers.")] = None,
    cursor: Annotated[str | None, Field(pattern="^[0-9]{1,9}$", description="Cursor from the previous page.")] = None,
) -> Response:
    """List a job's frames, in order, a page at a time."""
    found(service, caller, job_id)
    first = int(cursor) if cursor is not None else -1 if after is None else after
    rows = service.store.frames(job_id, limit + 1, first)
    more = len(rows) > limit
    next_cursor = str(rows[limit - 1].number) if more else None
    headers = {"link": f'</v1/jobs/{job_id}/frames?limit={limit}&cursor={next_cursor}>; rel="next"'} if more else {}
    return json_answer({"items": [frame_json(row) for row in rows[:limit]], "next_cursor": next_cursor}, headers=headers)


@router.get("/{job_id}/frames/{number}", answer(views.Frame), problems=("not-found", "invalid-request"))
def frame(job_id: JobId, number: FrameNumber, caller: Reader, service: Serving) -> Response:
    """Return one frame."""
    found(service, caller, job_id)
    row = service.store.frame(job_id, number)
    if row is None:
        raise Problem("not-found", "The job has no such frame.")
    return json_answer(frame_json(row))
