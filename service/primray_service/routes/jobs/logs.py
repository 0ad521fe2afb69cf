"""Output of a job's workers as plain text, frame by frame: for people who look for a cause."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ...files import DataDirectory
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.file_answer import file_answer
from ...http.routing import Router
from ...problems import Problem
from .jobs import JobId, found

router = Router("/v1/jobs", tag="jobs")

FILE = "log.txt"


@router.get(
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
    path = service.data.frame(job_id, frame) / FILE
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
