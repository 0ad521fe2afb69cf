"""JSON of jobs, frames and events as plain dictionaries, for the routes, event streams and webhooks."""

from __future__ import annotations

from datetime import UTC, datetime

from ..jobs import Event, Frame, Job, Json


def time_text(seconds: float | None) -> str | None:
    """Return the time as RFC 3339 text in UTC, to the millisecond."""
    if seconds is None:
        return None
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


# Progress before an attempt's first report, so that clients find every member in any state.
NOTHING_YET: Json = {
    "fraction": 0.0,
    "phase": "",
    "samples_done": 0,
    "samples_min": 0,
    "samples_max": 0,
    "rays": 0,
    "rays_per_s": 0,
    "error": None,
    "elapsed_s": 0.0,
    "eta_s": None,
    "eta_ci95": None,
    "pass": 0,
}


def job_json(job: Job, queue: Json | None = None) -> Json:
    """Return a job's JSON; `queue` is the job's position as queue/estimates.py computes it."""
    here = f"/v1/jobs/{job.id}"
    return {
        "id": job.id,
        "object": "job",
        "name": job.name,
        "state": job.state.value,
        "attempt": job.attempt,
        "parallel": job.parallel,
        "priority": job.priority,
        "created_at": time_text(job.created_at),
        "queued_at": time_text(job.queued_at),
        "started_at": time_text(job.started_at),
        "finished_at": time_text(job.finished_at),
        "expires_at": time_text(job.expires_at),
        "ttl_s": job.ttl_s,
        "scene": {"id": job.scene_id, "entry": job.entry},
        "labels": dict(job.labels),
        "settings": job.settings,
        "effective_settings": job.effective_settings,
        "queue": queue,
        "progress": {**NOTHING_YET, "updated_at": time_text(job.queued_at), **job.progress},
        "result": job.result,
        "warnings": job.warnings,
        "error": job.error,
        "usage": job.usage,
        "urls": {
            "self": here,
            "cancel": f"{here}/cancel",
            "pause": f"{here}/pause",
            "resume": f"{here}/resume",
            "continue": f"{here}/continue",
            "events": f"{here}/events",
            "frames": f"{here}/frames",
            "convergence": f"{here}/convergence",
            "preview": f"{here}/preview",
            "outputs": f"{here}/outputs",
            "log": f"{here}/log",
            "scene": f"/v1/scenes/{job.scene_id}",
        },
        "webhook": None if job.webhook is None else {"url": job.webhook["url"], "events": job.webhook["events"]},
    }


def frame_json(frame: Frame) -> Json:
    return {
        "number": frame.number,
        "time_code": frame.time_code,
        "state": frame.state.value,
        "attempt": frame.attempt,
        "phase": frame.phase,
        "checkpoint": frame.checkpoint,
        "progress": frame.progress,
        "effective_settings": frame.effective_settings,
        "result": frame.result,
        "error": frame.error,
        "usage": {"cpu_s": frame.cpu_s, "peak_rss_bytes": frame.peak_rss_bytes},
        "started_at": time_text(frame.started_at),
        "finished_at": time_text(frame.finished_at),
    }


def event_json(event: Event) -> Json:
    return {"id": event.id, "type": event.type, "created_at": time_text(event.created_at), "data": event_data(event)}


def event_data(event: Event) -> Json:
    """Return an event's data. For an end it identifies which end it was: a job whose frame is retried ends again in the same
    attempt."""
    return event.data | {"finished_at": time_text(event.created_at)} if event.type == "end" else event.data
