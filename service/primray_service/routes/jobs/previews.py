"""The current picture of a job. A request for it makes the worker write previews."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ...auth import Caller
from ...http.answers import none_match
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.file_answer import file_answer
from ...http.routing import Router
from ...jobs import FRAME_TERMINAL, Frame, FrameState, Json
from ...pictures.encoder import revision
from ...pictures.request import MOST_STOPS, MOST_WIDTH, VIEWS, Channel, Format, PictureRequest
from ...problems import Problem
from ...service import Service
from .jobs import JobId, found

router = Router("/v1/jobs", resource="previews", tag="previews")

FILE = "preview.raw"
RETRY_AFTER_S = 1


_BINARY = {"type": "string", "format": "binary"}


@router.get(
    "/{job_id}/preview",
    answer(content=dict.fromkeys(("image/png", "image/jpeg", "application/octet-stream"), _BINARY), headers=("ETag",)),
    answer(status=206, description="A range of the raw half floats.", content={"application/octet-stream": _BINARY}),
    answer(status=304, description="Unchanged since the version in If-None-Match.", headers=("ETag",)),
    problems=("not-found", "range-not-satisfiable", "invalid-request", "view-unavailable"),
    headers=("If-None-Match",),
)
async def preview(
    job_id: JobId,
    request: Request,
    caller: Reader,
    service: Serving,
    frame: Annotated[
        int | None, Field(ge=0, lt=2**31, description="The frame's number, from 0; default: the running frame.")
    ] = None,
    view: Annotated[
        str, Field(max_length=64, description="The picture, or a map of its error.", json_schema_extra={"enum": list(VIEWS)})
    ] = "beauty",
    channel: Annotated[Channel, Field(description="A single channel, shown in grey.")] = "rgb",
    exposure: Annotated[
        float, Field(ge=-MOST_STOPS, le=MOST_STOPS, allow_inf_nan=False, description="Exposure in stops.")
    ] = 0.0,
    format: Annotated[Format, Field(description="Image format; raw: half floats, in the layout of worker/preview.py.")] = "png",
    width: Annotated[int | None, Field(ge=1, le=MOST_WIDTH, description="Most pixels in width.")] = None,
) -> Response:
    """Return the frame's current picture as PNG, JPEG or half floats, or a map of its error; the ETag identifies its pass."""
    if view not in VIEWS:
        raise Problem("view-unavailable", f"There is no view {view!r}; views are {', '.join(VIEWS)}.", views=list(VIEWS))
    if view != "beauty" and channel == "a":
        raise Problem("view-unavailable", "Coverage (alpha) has no error estimate.", views=list(VIEWS))
    row, files = await run_in_threadpool(_frame, service, caller, job_id, frame)
    if row.state is FrameState.RUNNING:
        service.dispatcher.ask_preview(job_id, row.number)
    path = service.data.frame(job_id, row.number) / FILE
    found_revision = await run_in_threadpool(_newest, service, path)
    if found_revision is None:
        raise _none_yet(row)
    asked = PictureRequest(view, channel, exposure, format, width, **files)
    headers = {"cache-control": "private, no-cache", "preview-frame": str(row.number)}
    if format == "raw":
        return await file_answer(request, path, "application/octet-stream", f'"{found_revision}-raw"', headers)
    etag = f'"{found_revision}-{asked.tag}"'
    if not none_match(request, etag):
        return Response(status_code=304, headers={"etag": etag, **headers})
    made = await service.pictures.picture(path, found_revision, asked)
    return Response(made.data, 200, {"etag": etag, **headers, **made.headers}, media_type=made.media_type)


def _newest(service: Service, path: Path) -> str | None:
    service.data.bring_newest(path)
    return revision(path)


def _frame(service: Service, caller: Caller, job_id: str, number: int | None) -> tuple[Frame, Json]:
    """Return the requested frame; by default the first running one, else the last that has started, else the first. Also
    returns the display transform of the job's files."""
    settings = found(service, caller, job_id).settings
    files = {"through": settings.get("view"), "stops": settings.get("exposure")}
    files |= {name: settings.get(name) for name in ("display", "look")}
    return _frame_of(service, job_id, number), files


def _frame_of(service: Service, job_id: str, number: int | None) -> Frame:
    if number is not None:
        row = service.store.frame(job_id, number)
        if row is None:
            raise Problem("not-found", f"The job has no frame {number}.")
        return row
    frames = service.store.frames(job_id)
    running = [each for each in frames if each.state is FrameState.RUNNING]
    begun = [each for each in frames if each.started_at is not None]
    return running[0] if running else begun[-1] if begun else frames[0]


def _none_yet(row: Frame) -> Problem:
    if row.state in FRAME_TERMINAL:
        return Problem("not-found", f"Frame {row.number} ended without a picture.", frame=row.number, state=row.state.value)
    return Problem(
        "not-found",
        f"There is no picture of frame {row.number} yet: it is {row.state.value}{f' ({row.phase})' if row.phase else ''}.",
        headers={"retry-after": str(RETRY_AFTER_S)},
        frame=row.number,
        state=row.state.value,
    )
