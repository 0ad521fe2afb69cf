"""Convergence of a job's error: rows of its frames' curves, as JSON or CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response

from ...api import views
from ...http.answers import accepted, json_answer
from ...http.callers import Reader, Serving
from ...http.described import answer
from ...http.routing import Router
from ...jobs import Frame, Json
from ...problems import Problem
from ...service import Service
from .jobs import JobId, found

router = Router("/v1/jobs", tag="jobs")

COLUMNS = ("frame", "t_s", "samples", "relmse", "ci95_low", "ci95_high", "rmse")
FORMATS = {"json": "application/json", "csv": "text/csv"}
FRAMES_AT_A_TIME = 200


@router.get(
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
