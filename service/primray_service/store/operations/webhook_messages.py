"""Messages of a job's webhooks, after the Standard Webhooks specification
(https://github.com/standard-webhooks/standard-webhooks/blob/main/spec/standard-webhooks.md)."""

from __future__ import annotations

import os
from datetime import UTC, datetime

from ...ids import ulid
from ...jobs import Job, Json


def time_text(at: float) -> str:
    """Return the time as RFC 3339 text, UTC, milliseconds."""
    return datetime.fromtimestamp(at, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def job_message(job: Job, event: str, now: float, order: int, frame: Json | None = None) -> Json | None:
    """Return a row of the webhooks table that is due now, before those of the same time whose `order` is larger; None if the
    job asks for no such message."""
    webhook = job.webhook
    if webhook is None or event not in webhook.get("events", ()):
        return None
    data = {
        "id": job.id,
        "object": "job",
        "state": job.state.value,
        "attempt": job.attempt,
        "scene": {"id": job.scene_id, "entry": job.entry},
        "labels": dict(job.labels),
        "created_at": time_text(job.created_at),
        "started_at": None if job.started_at is None else time_text(job.started_at),
        "finished_at": None if job.finished_at is None else time_text(job.finished_at),
        "result": job.result,
        "error": job.error,
        "usage": job.usage,
    }
    if frame is not None:
        data["frame"] = frame
    return {
        "id": f"msg_{ulid(now, order.to_bytes(4) + os.urandom(6))}",
        "job_id": job.id,
        "url": str(webhook.get("url", "")),
        "secret": str(webhook.get("secret") or ""),
        "event": event,
        "payload": {"type": f"job.{event}", "timestamp": time_text(now), "data": data},
        "tries": 0,
        "next_at": now,
        "state": "due",
        "last_error": "",
    }
