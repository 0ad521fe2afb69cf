"""Outputs of a job: the list, and the files themselves. A file's digest is its ETag."""

from __future__ import annotations

import re
from urllib.parse import quote

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ...api import views
from ...api.job_json import time_text
from ...http.answers import json_answer
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.file_answer import Stored, file_answer
from ...http.routing import Router
from ...jobs import Json, Output
from ...problems import Problem
from ...scenes.receive import sha256_header
from .jobs import JobId, found

router = Router("/v1/jobs", resource="outputs", tag="outputs")

# A name means the same bytes for ever: outputs of a continued job have other names (dispatcher/chunks/commands.py,
# output_names).
IMMUTABLE = "private, max-age=31536000, immutable"
REVALIDATED = "private, no-cache"  # a retried frame makes a file of the same name


@router.get("/{job_id}/outputs", answer(views.OutputList), problems=("not-found",))
def list_outputs(job_id: JobId, caller: Reader, service: Serving) -> Response:
    """List the files that the job has made so far, frame by frame."""
    found(service, caller, job_id)
    outputs = service.store.outputs(job_id)
    return json_answer({"items": [output_json(output) for output in outputs]})


@router.get(
    "/{job_id}/outputs/{name}",
    answer(
        description="The file, whatever its media type.",
        content={"*/*": {}},
        headers=("ETag", "Accept-Ranges", "Content-Disposition", "Repr-Digest"),
    ),
    answer(status=206, description="The requested ranges.", content={"*/*": {}}, headers=("ETag",)),
    answer(status=304, description="Unchanged since the version in If-None-Match.", headers=("ETag",)),
    problems=("not-found", "precondition-failed", "range-not-satisfiable", "invalid-request"),
    headers=("Range", "If-Range", "If-None-Match"),
)
async def output(
    job_id: JobId, name: str, request: Request, caller: Reader, service: Serving, sha256: str | None = None
) -> Response:
    """Return one file. With ?sha256= (as in the list's URLs) it is the file with that digest, which can be cached for ever, or
    none."""
    row = await run_in_threadpool(_row, service, caller, job_id, name)
    if sha256 is not None and sha256 != row.sha256:
        raise Problem("not-found", "The job has made another version of this file; list its outputs again.", sha256=row.sha256)
    headers = {
        "cache-control": REVALIDATED if sha256 is None else IMMUTABLE,
        "content-disposition": attachment(row.name),
        "x-content-type-options": "nosniff",
        "content-security-policy": "default-src 'none'; sandbox",
        "repr-digest": sha256_header(row.sha256),
    }
    path = service.data.output(job_id, row.name, row.sha256)
    objects = service.data.objects
    file = path if objects is None else Stored(objects, service.data.name_of(path))
    return await file_answer(request, file, row.media_type, f'"{row.sha256}"', headers, exactly=row.bytes)


def _row(service: Serving, caller: Reader, job_id: str, name: str) -> Output:
    """Return the output's row: names without a row are never looked up on disk."""
    found(service, caller, job_id)
    rows = service.store.outputs(job_id)
    row = next((each for each in rows if each.name == name), None)
    if row is None:
        raise Problem(
            "not-found", "The job has no file of this name; see the list of its outputs.", outputs=[r.name for r in rows[:20]]
        )
    return row


def attachment(name: str) -> str:
    """Return Content-Disposition (RFC 6266): curl -J and older clients read only the plain form."""
    if re.fullmatch(r"[\w.-]+", name, re.ASCII):
        return f'attachment; filename="{name}"'
    return f"attachment; filename*=UTF-8''{quote(name, safe='')}"


def output_json(output: Output) -> Json:
    here = f"/v1/jobs/{output.job_id}/outputs/{quote(output.name, safe='')}"
    return {
        "name": output.name,
        "frame": output.frame,
        "bytes": output.bytes,
        "sha256": output.sha256,
        "media_type": output.media_type,
        "created_at": time_text(output.created_at),
        "urls": {"self": here, "immutable": f"{here}?sha256={output.sha256}"},
    }
