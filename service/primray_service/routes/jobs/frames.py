"""The frames of a job: the state of each, the convergence of their error, and the output of their workers.

Convergence is the rows of the frames' curves, as JSON or CSV. Output is plain text, frame by frame, for people who look for a
cause.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ...api import views
from ...api.job_json import frame_json
from ...files import DataDirectory
from ...http.answers import accepted, json_answer
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.file_answer import file_answer
from ...http.routing import Router
from ...jobs import Frame, Json
from ...problems import Problem
from ...service import Service
from .jobs import FrameNumber, JobId, found

router = Router("/v1/jobs", resource="frames", tag="jobs")


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


convergence_router = Router("/v1/jobs", resource="convergence", tag="jobs")

COLUMNS = ("frame", "t_s", "samples", "relmse", "ci95_low", "ci95_high", "rmse")
FORMATS = {"json": "application/json", "csv": "text/csv"}
FRAMES_AT_A_TIME = 200


@convergence_router.get(
    "/{job_id}/convergence",
    answer(views.ConvergenceRow, many=True, content={"text/csv": {"type": "string"}}),
    problems=("not-found", "not-acceptable", "invalid-request"),
)
def convergence(
    job_id: JobId,
    request: Request,
    caller: Reader,
    service: Serving,
    frame: Annotated[int | None, Field(ge=0, lt=2**31, description="Only rows of this frame.")] = None,
    format: Annotated[Literal["json", "csv"] | None, Field(description="Format, overriding Accept; for links.")] = None,
) -> Response:
    """Return estimates of the error by samples and seconds, frame after frame.

    `Accept: text/csv`, or ?format=csv, gives a table with a header line.
    """
    kind = FORMATS[format] if format else accepted(request, *FORMATS.values())
    found(service, caller, job_id)
    rows = [{"frame": each.number, **row} for each in frames_of(service, job_id, frame) for row in each.convergence]
    headers = {"vary": "Accept", "cache-control": "private, no-cache"}
    if kind == FORMATS["json"]:
        return json_answer(rows, headers=headers)
    return Response(csv_of(rows), media_type=kind, headers=headers)


def frames_of(service: Service, job_id: str, number: int | None) -> Iterable[Frame]:
    if number is not None:
        row = service.store.frame(job_id, number)
        if row is None:
            raise Problem("not-found", "The job has no such frame.", member="frame")
        yield row
        return
    after = -1
    while rows := service.store.frames(job_id, FRAMES_AT_A_TIME, after):
        yield from rows
        after = rows[-1].number


def csv_of(rows: Sequence[Json]) -> bytes:
    """Return CSV (RFC 4180), with the interval in two columns."""
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(COLUMNS)
    for row in rows:
        low, high = row.get("ci95") or (None, None)
        cells: Json = {**row, "ci95_low": low, "ci95_high": high}
        table.writerow([_cell(cells.get(column)) for column in COLUMNS])
    return text.getvalue().encode()


def _cell(value: Any) -> Any:
    return "" if value is None else value


log_router = Router("/v1/jobs", resource="logs", tag="jobs")

LOG_FILE = "log.txt"


@log_router.get(
    "/{job_id}/log",
    answer(content={"text/plain": {"type": "string"}}, headers=("ETag", "Accept-Ranges")),
    answer(
        status=206,
        description="The requested range.",
        content={"text/plain": {"type": "string"}},
        headers=("Content-Range",),
    ),
    answer(status=304, description="Unchanged since the version in If-None-Match.", headers=("ETag",)),
    problems=("not-found", "precondition-failed", "range-not-satisfiable", "invalid-request"),
    headers=("Range", "If-Range", "If-None-Match"),
)
async def log(
    job_id: JobId,
    request: Request,
    caller: Reader,
    service: Serving,
    frame: Annotated[int, Field(ge=0, lt=2**31, description="The frame's number, from 0.")] = 0,
) -> Response:
    """Return the log of one frame; it grows while the frame runs, so continue with Range: bytes=<what you have>-."""
    await run_in_threadpool(found, service, caller, job_id)
    if await run_in_threadpool(service.store.frame, job_id, frame) is None:
        raise Problem("not-found", f"The job has no frame {frame}.")
    path = service.data.frame(job_id, frame) / LOG_FILE
    size, etag = await run_in_threadpool(_state, service.data, path)
    headers = {
        "cache-control": "private, no-cache",
        "content-security-policy": "default-src 'none'; sandbox",
        "x-content-type-options": "nosniff",
    }
    if size == 0 and not path.exists():
        return Response("", 200, {**headers, "etag": etag}, media_type="text/plain; charset=utf-8")
    return await file_answer(request, path, "text/plain; charset=utf-8", etag, headers, most_bytes=size)


def _state(data: DataDirectory, path: Path) -> tuple[int, str]:
    """Return the log's size, and an ETag for its content up to there: it only grows, or is replaced."""
    data.bring_newest(path)
    try:
        found = os.lstat(path)
    except FileNotFoundError:
        return 0, '"none"'
    return found.st_size, f'"{found.st_ino:x}-{found.st_size:x}-{found.st_mtime_ns:x}"'
