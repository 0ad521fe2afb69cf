"""POST /v1/jobs: creates a job of a scene that was uploaded before, or of a file in the same request."""

from __future__ import annotations

import re
import time
from dataclasses import replace

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ... import monitoring
from ...admission import fingerprint, new_job
from ...api import views
from ...api.models import FormJob, JobRequest
from ...auth import Caller
from ...http.answers import json_bytes
from ...http.bodies import parsed, read_json
from ...http.callers import Serving, Submitter
from ...http.described import answer, json_request, leading_to, schema_of
from ...http.guard import request_id_of
from ...http.routing import Router
from ...http.uploads import receive_scene, refused
from ...jobs import TERMINAL, Job, Scene, SceneState
from ...problems import Problem
from ...scenes.recognize import MEDIA_TYPES, choose, job_name
from ...service import Service
from ...store.base import Conflict, KeyReused
from ...webhooks import accepted_webhook
from .jobs import changed, has_ended, job_answer, prefer_wait

router = Router("/v1/jobs", resource="submissions", tag="jobs")

_IDEMPOTENCY_KEY = re.compile(r"[!-~]{1,255}")
_TRACEPARENT = re.compile(r"[0-9a-f]{2}-[0-9a-f]{32}-[0-9a-f]{16}-[0-9a-f]{2}")
EXAMPLE = {
    "scene": {"id": f"sha256:{'0' * 64}"},
    "settings": {"camera": "/cam", "resolution": [960, 540], "stop": {"target_error": 0.01, "max_seconds": 60}},
    "labels": {"shot": "010"},
}
BODY = json_request(JobRequest, EXAMPLE)
BODY["requestBody"]["content"]["multipart/form-data"] = {
    "schema": {
        "type": "object",
        "required": ["file"],
        "properties": {"file": {"type": "string", "format": "binary"}, "job": schema_of(FormJob)},
        "additionalProperties": False,
    },
    "encoding": {"job": {"contentType": "application/json"}, "file": {"contentType": ", ".join(MEDIA_TYPES.values())}},
}

LINKS = leading_to(
    "job_id",
    "jobs_show",
    "jobs_change",
    "jobs_cancel",
    "interventions_pause",
    "interventions_resume",
    "jobs_go_on",
    "events_events",
    "frames_frames",
    "frames_frame",
    "convergence_convergence",
    "previews_preview",
    "outputs_list_outputs",
    "logs_log",
    "jobs_delete",
)


@router.post(
    "",
    answer(
        views.Job,
        202,
        "The job is queued.",
        headers=("Location", "ETag", "Retry-After", "Preference-Applied", "Idempotency-Replayed"),
        links=LINKS,
    ),
    answer(
        views.Job,
        200,
        "The job has ended within the time that Prefer requested.",
        headers=("Location", "ETag", "Preference-Applied", "Idempotency-Replayed"),
        links=LINKS,
    ),
    problems=(
        "invalid-json",
        "not-found",
        "request-too-large",
        "upload-too-large",
        "unsupported-media-type",
        "not-usd",
        "package-unsafe",
        "package-too-large",
        "invalid-request",
        "limit-exceeded",
        "parallel-adaptive",
        "parallel-denoise",
        "idempotency-key-reused",
        "webhook-address",
        "ambiguous-entry",
        "entry-missing",
        "quota-exceeded",
    ),
    request=BODY,
    headers=("Idempotency-Key", "Prefer"),
)
async def submit(request: Request, caller: Submitter, service: Serving) -> Response:
    """Queue a job of a scene that was uploaded before (JSON), or of a file in the same request (a form)."""
    try:
        asked = await (read_form(request, service, caller) if is_form(request) else read_json(request, JobRequest))
    except Problem as problem:
        return refused(request, problem)
    job, is_new = await run_in_threadpool(create, service, caller, asked, request)
    headers = {"location": f"/v1/jobs/{job.id}"}
    if not is_new:
        headers["idempotency-replayed"] = "true"
    seconds = prefer_wait(request, service.limits)
    if seconds is not None:
        headers["preference-applied"] = f"wait={seconds:g}"
        job = await changed(service, caller, job, seconds, has_ended)
    status = 200 if seconds is not None and job.state in TERMINAL else 202
    return job_answer(job, await run_in_threadpool(with_secret, service, job), status, headers)


def is_form(request: Request) -> bool:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower() == "multipart/form-data"


async def read_form(request: Request, service: Service, caller: Caller) -> JobRequest:
    """Return the request from the part `job` (JSON; optional) and the part `file`, in any order."""
    scene, _, parts = await receive_scene(request, service, caller, ("job",))
    if scene is None:
        raise Problem("invalid-request", "file: the form has no such part.", member="file")
    job = parsed(FormJob, parts.get("job") or b"{}", "job")
    return job.with_scene(scene.id)


def create(service: Service, caller: Caller, asked: JobRequest, request: Request) -> tuple[Job, bool]:
    """Return the new job, or the earlier one with the same idempotency key (False)."""
    # This request's own span if requests are traced; else the client's.
    traceparent = monitoring.traceparent() or request.headers.get("traceparent", "")
    scene_id = asked.scene.id
    if (scene_id is None) == (asked.scene.shared is None):
        raise Problem("invalid-request", "scene: name the scene's id, or a stage as shared.", member="scene")
    if scene_id is None:
        scene_id = shared_scene(service, caller, asked).id
    job, times = new_job(
        asked,
        scene_id,
        caller.tenant,
        service.limits,
        time.time(),
        request_id=request_id_of(request),
        traceparent=traceparent if _TRACEPARENT.fullmatch(traceparent) else "",
    )
    key = idempotency_key(request)
    scene = service.store.scene(caller.tenant, scene_id)
    if scene is None:
        raise no_scene()
    if job.name is None:
        made = job_name(scene.name, job.entry, asked.settings.camera, asked.settings.frames)
        job = replace(job, name=job.labels.get("name") or made)  # a label `name` was the name before jobs had one
    if asked.webhook is not None:
        job = replace(job, webhook=accepted_webhook(asked.webhook, service.config))
    if scene.state is SceneState.READY:  # otherwise the job reports it when the check is done
        choose(asked.scene.entry, scene.facts.get("entries", ()), scene.facts.get("layers"))
    try:
        job, is_new = service.store.create_job(
            job, times, service.quotas_of(caller), None if key is None else (key, fingerprint(asked))
        )
    except KeyReused:
        raise Problem("idempotency-key-reused", "An earlier request with this key was different.") from None
    except Conflict:
        raise no_scene() from None
    service.dispatcher.wake()
    return job, is_new


def shared_scene(service: Service, caller: Caller, asked: JobRequest) -> Scene:
    """Return the tenant's scene for the current root layer of a stage on shared storage; created at first use."""
    if asked.scene.entry is not None:
        raise Problem("invalid-request", "scene.entry: a stage on shared storage is one file.", member="scene.entry")
    now = time.time()
    try:
        file = service.data.shared_roots.file(asked.scene.shared or "", caller.tenant)
        scene_id, size = file.scene_id, file.path.stat().st_size
    except OSError:
        raise Problem("unavailable", "scene.shared: the shared storage does not answer.", member="scene.shared") from None
    state = SceneState.CHECKING
    facts = {"shared": file.name}
    row = Scene(
        id=scene_id,
        tenant=caller.tenant,
        state=state,
        kind="shared",
        name=file.name,
        bytes=size,
        stored_bytes=0,
        created_at=now,
        used_at=now,
        facts=facts,
    )
    return service.store.put_scene(row, service.quotas_of(caller))[0]


def with_secret(service: Service, job: Job) -> bytes:
    """Return the job's JSON with the webhook's secret, which only the answer to its creation contains."""
    shown = service.job_json(job)
    if job.webhook is not None:
        shown["webhook"] = job.webhook
    return json_bytes(shown)


def no_scene() -> Problem:
    return Problem("not-found", "scene.id: there is no such scene; upload it first (POST /v1/scenes).", member="scene.id")


def idempotency_key(request: Request) -> str | None:
    key = request.headers.get("idempotency-key")
    if key is not None and not _IDEMPOTENCY_KEY.fullmatch(key):
        raise Problem("invalid-request", "Idempotency-Key: 1 to 255 characters of ASCII, no spaces.", member="Idempotency-Key")
    return key
