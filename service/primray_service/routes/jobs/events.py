"""A job's events: as a stream (server-sent events) or as pages of JSON, by content negotiation.

Ids are the rows' numbers, so a client that reconnects with Last-Event-ID (or ?after=) misses nothing. The stream ends after the
job's end; a further request gets 204, which stops a browser's EventSource.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Sequence
from typing import Annotated

from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from ...api import views
from ...api.job_json import event_data, event_json
from ...auth import Caller
from ...changes import wait
from ...http.answers import accepted, json_answer, json_bytes
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.routing import Router
from ...jobs import TERMINAL, Event, Job, JobState, Json
from ...problems import Problem
from ...service import Service
from .jobs import JobId, found_shared

router = Router("/v1/jobs", resource="events", tag="jobs")

HEARTBEAT_S = 10.0
RETRY_MS = 2000  # delay before a browser reconnects
PAGE = 500
PLACE_S = 1.0
SHARED_S = 0.5  # streams of one job share a read for this long
STREAM, PAGES = "text/event-stream", "application/json"


@router.get(
    "/{job_id}/events",
    answer(views.EventPage, content={STREAM: {"type": "string"}}),
    answer(None, 204, "A stream was requested, the job has ended, and there are no events after the given one."),
    problems=("not-found", "not-acceptable", "invalid-request"),
    headers=("Last-Event-ID",),
)
async def events(
    job_id: JobId,
    request: Request,
    caller: Reader,
    service: Serving,
    after: Annotated[int | None, Field(ge=0, lt=2**63, description="Only events with higher ids.")] = None,
    limit: Annotated[int, Field(ge=1, le=PAGE, description="Most events of a JSON page.")] = PAGE,
) -> Response:
    """Return past and coming events of a job.

    `Accept: text/event-stream` (as EventSource sends it) gives a stream until the job ends; otherwise the answer is a page of
    the events so far. A comment is sent every 10 seconds, so that a dead connection is noticed. While the job is queued, the
    stream has events `queue` without an id: the job's member of that name, whenever it changes.
    """
    kind = accepted(request, PAGES, STREAM)
    seen = last_seen(request)
    first = seen if after is None else after
    job = await found_shared(service, caller, job_id)
    rows = await read(service, job_id, first, limit if kind == PAGES else PAGE)
    if kind == PAGES:
        items = [event_json(row) for row in rows]
        ended = job.state in TERMINAL and len(rows) < limit
        page = {"items": items, "next_after": rows[-1].id if rows else first, "ended": ended}
        return json_answer(page, headers={"vary": "Accept"})
    if job.state in TERMINAL and not rows:
        return Response(status_code=204)
    headers = {"cache-control": "no-store", "x-accel-buffering": "no", "vary": "Accept"}
    if request.method == "HEAD":
        return Response(headers=headers, media_type=STREAM)
    return StreamingResponse(stream(service, caller, job_id, first), headers=headers, media_type=STREAM)


def last_seen(request: Request) -> int:
    text = request.headers.get("last-event-id", "0")
    if re.fullmatch(r"[0-9]{1,18}", text) is None:
        raise Problem("invalid-request", "Last-Event-ID: this is not the id of an event.", member="Last-Event-ID")
    return int(text)


async def read(service: Service, job_id: str, after: int, limit: int) -> Sequence[Event]:
    return await service.reads.read(
        job_id, ("events", after, limit), lambda: service.store.events(job_id, after, limit), age_s=SHARED_S
    )


async def stream(service: Service, caller: Caller, job_id: str, after: int) -> AsyncIterator[bytes]:
    """Yield the stream until the job has ended and all events are sent, the job is deleted, or the server stops."""
    yield f"retry: {RETRY_MS}\n\n".encode()
    loop = asyncio.get_running_loop()
    spoke = loop.time()
    sent: Json | None = None  # position in the queue that was sent last
    with service.changes.watching(job_id) as changed:
        while not service.changes.closing:
            rows = await read(service, job_id, after, PAGE)
            for row in rows:
                after = row.id
            if rows:
                spoke = loop.time()
                yield b"".join(sse(row) for row in rows)
                continue
            if await is_over(service, caller, job_id, after):
                return
            place = await place_of(service, caller, job_id)
            if place is not None and place != sent:
                sent, spoke = place, loop.time()
                yield b"event: queue\ndata: %s\n\n" % json_bytes(place)
            if loop.time() - spoke >= HEARTBEAT_S:
                spoke = loop.time()
                yield b": alive\n\n"
            await wait(changed, HEARTBEAT_S)


async def place_of(service: Service, caller: Caller, job_id: str) -> Json | None:
    """Return the job's position in the queue while it waits: an event without an id, since only the newest counts."""
    job: Job = await found_shared(service, caller, job_id)
    if job.state is not JobState.QUEUED:
        return None
    found = await service.reads.read(job_id, "place", lambda: service.positions.of(job), age_s=PLACE_S)
    return None if found is None or found["place"] is None else found


async def is_over(service: Service, caller: Caller, job_id: str, after: int) -> bool:
    """Return whether the job is deleted, or has ended and the stream has sent all of its events."""
    try:
        job: Job = await found_shared(service, caller, job_id)
    except Problem:
        return True
    if job.state not in TERMINAL:
        return False
    # The end may have come between the last read of the events and that of the job.
    return not await asyncio.to_thread(service.store.events, job_id, after, 1)


def sse(event: Event) -> bytes:
    """Return a server-sent event; the JSON has no line breaks, so one data line suffices."""
    return b"id: %d\nevent: %s\ndata: %s\n\n" % (event.id, event.type.encode(), json_bytes(event_data(event)))
