"""Conversion between rows and the service's types."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
from typing import Any

from sqlalchemy import Row, Table

from ...jobs import Event, Frame, FrameState, Job, JobState, Json, Output, Part, PartState, Scene, SceneState
from ...limits import Quotas
from ..base import ApiKey, WebhookDelivery
from . import schema

_JOB = [schema.jobs.c[field.name] for field in dataclasses.fields(Job)]
_FRAME = [schema.frames.c[field.name] for field in dataclasses.fields(Frame)]
JOB_COLUMNS = tuple(_JOB)
FRAME_COLUMNS = tuple(_FRAME)


def _of(row: Row[Any], table: Table, made: Any) -> dict[str, Any]:
    return {field.name: row._mapping[table.c[field.name]] for field in dataclasses.fields(made)}


def job_of(row: Row[Any]) -> Job:
    values = _of(row, schema.jobs, Job)
    return Job(**{**values, "state": JobState(values["state"])})


def values_of_job(job: Job) -> Json:
    return {**_plain(job), "state": job.state.value, "labels": dict(job.labels)}


def frame_of(row: Row[Any]) -> Frame:
    values = _of(row, schema.frames, Frame)
    return Frame(**{**values, "state": FrameState(values["state"])})


def part_of(row: Row[Any]) -> Part:
    values = _of(row, schema.parts, Part)
    return Part(**{**values, "state": PartState(values["state"])})


def event_of(row: Row[Any]) -> Event:
    return Event(**_of(row, schema.events, Event))


def output_of(row: Row[Any]) -> Output:
    return Output(**_of(row, schema.outputs, Output))


def scene_of(row: Row[Any]) -> Scene:
    values = _of(row, schema.scenes, Scene)
    return Scene(**{**values, "state": SceneState(values["state"])})


def values_of_scene(scene: Scene) -> Json:
    return {**_plain(scene), "state": scene.state.value}


def delivery_of(row: Row[Any]) -> WebhookDelivery:
    return WebhookDelivery(**_of(row, schema.webhooks, WebhookDelivery))


def key_of(row: Row[Any]) -> ApiKey:
    values = _of(row, schema.api_keys, ApiKey)
    known = {field.name for field in dataclasses.fields(Quotas)}
    quotas = Quotas(**{name: value for name, value in values["quotas"].items() if name in known})
    return ApiKey(**{**values, "scopes": frozenset(values["scopes"]), "quotas": quotas})


def values_of_key(key: ApiKey) -> Json:
    return {**_plain(key), "scopes": sorted(key.scopes), "quotas": _plain(key.quotas)}


def _plain(made: Any) -> Json:
    return {field.name: getattr(made, field.name) for field in dataclasses.fields(made)}


def write_cursor(at: float, row_id: str, order: str) -> str:
    """Return a cursor; `order` names the listing, so that a cursor is not used in another."""
    return base64.urlsafe_b64encode(json.dumps([at, row_id, order]).encode()).decode().rstrip("=")


def read_cursor(cursor: str, order: str) -> tuple[float, str]:
    """Return time and id; ValueError for a cursor of another listing."""
    try:
        at, row_id, of = json.loads(base64.b64decode(cursor + "=" * (-len(cursor) % 4), altchars=b"-_", validate=True))
        is_one = (
            of == order
            and type(at) in (int, float)
            and math.isfinite(at)
            and isinstance(row_id, str)
            and row_id.isascii()
            and row_id.isprintable()
        )
    except (ValueError, TypeError, RecursionError):
        is_one = False
    if not is_one:
        raise ValueError("The cursor is not from this listing.")
    return float(at), row_id
