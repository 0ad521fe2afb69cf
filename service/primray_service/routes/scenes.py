"""Scenes: upload, list, show, delete. Their bytes are only stored here; a worker's check reads what is in them."""

from __future__ import annotations

from typing import Annotated, Any
from urllib.parse import urlencode

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from ..api import views
from ..api.job_json import time_text
from ..http.answers import json_answer, none_match, not_modified
from ..http.callers import Reader, Serving, Submitter
from ..http.described import answer, leading_to
from ..http.routing import Router
from ..http.uploads import receive_scene, refused
from ..jobs import Json, Scene, SceneState
from ..problems import Problem
from ..scenes.keep import remove
from ..scenes.recognize import MEDIA_TYPES
from ..store.base import Conflict

router = Router("/v1/scenes", resource="scenes", tag="scenes")

RETRY_AFTER_S = 1  # while a scene is checked
# Any text is looked up and may not be found: the pattern only documents ids.
SceneId = Annotated[str, Field(json_schema_extra={"pattern": "^sha256:[0-9a-f]{64}$"})]

BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
UPLOAD_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The file itself (its kind is recognised by its first bytes), or a form with a part `file`.",
        "content": {
            **dict.fromkeys(MEDIA_TYPES.values(), BINARY),
            "application/octet-stream": BINARY,
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {"file": {"type": "string", "format": "binary"}},
                    "additionalProperties": False,
                }
            },
        },
    }
}

LINKS: dict[str, Any] = {
    **leading_to("scene_id", "scenes_show", "scenes_show_head", "scenes_delete"),
    "submissions_submit": {"operationId": "submissions_submit", "requestBody": {"scene": {"id": "$response.body#/id"}}},
}


@router.post(
    "",
    answer(
        views.Scene,
        201,
        "The scene is stored, and its check begins.",
        headers=("Location", "ETag", "Retry-After"),
        links=LINKS,
    ),
    answer(
        views.Scene,
        200,
        "The same bytes were uploaded before.",
        headers=("Location", "ETag", "Retry-After"),
        links=LINKS,
    ),
    problems=(
        "upload-incomplete",
        "upload-too-large",
        "unsupported-media-type",
        "invalid-request",
        "not-usd",
        "package-unsafe",
        "package-too-large",
        "digest-mismatch",
        "quota-exceeded",
        "storage-full",
    ),
    request=UPLOAD_BODY,
    headers=("Repr-Digest",),
)
async def upload(
    request: Request,
    caller: Submitter,
    service: Serving,
    name: Annotated[str | None, Field(max_length=1024, description="Display name, usually the file's.")] = None,
) -> Response:
    """Upload a scene. Equal bytes are stored once; sending them again is answered with 200."""
    try:
        scene, is_new, _ = await receive_scene(request, service, caller)
        if scene is None:
            raise Problem("invalid-request", "The form has no part `file`.", member="file")
    except Problem as problem:
        return refused(request, problem)
    return scene_answer(scene, 201 if is_new else 200, {"location": f"/v1/scenes/{scene.id}"})


@router.get("", answer(views.ScenePage, headers=("Link",)), problems=("invalid-request",))
def list_scenes(
    caller: Reader,
    service: Serving,
    limit: Annotated[int, Field(ge=1, le=200)] = 50,
    cursor: Annotated[str | None, Field(max_length=512)] = None,
) -> Response:
    """List the tenant's scenes, newest first, a page at a time."""
    try:
        scenes, next_cursor = service.store.scenes(caller.tenant, limit, cursor)
    except ValueError:
        raise Problem("invalid-request", "cursor: this cursor is not from this server's answers.", member="cursor") from None
    headers = {}
    if next_cursor is not None:
        headers["link"] = f'</v1/scenes?{urlencode({"limit": limit, "cursor": next_cursor})}>; rel="next"'
    return json_answer({"items": [scene_json(scene) for scene in scenes], "next_cursor": next_cursor}, headers=headers)


@router.get(
    "/{scene_id}",
    answer(views.Scene, headers=("ETag", "Retry-After")),
    answer(status=304, description="Unchanged since the version in If-None-Match.", headers=("ETag",)),
    problems=("not-found",),
    headers=("If-None-Match",),
)
async def show(scene_id: SceneId, request: Request, caller: Reader, service: Serving) -> Response:
    """Return a scene: whether it is checked, and what is in it. HEAD tells whether it has to be uploaded at all."""
    scene = await run_in_threadpool(service.store.scene, caller.tenant, scene_id)
    if scene is None:
        raise no_scene()
    if not none_match(request, etag_of(scene)):
        return not_modified(etag_of(scene))
    return scene_answer(scene)


@router.delete("/{scene_id}", answer(None, 204, "The scene is deleted."), problems=("not-found", "scene-in-use"))
def delete(scene_id: SceneId, caller: Submitter, service: Serving) -> Response:
    """Delete a scene that no queued or running job uses."""
    try:
        remove(scene_id, caller.tenant, service.store, service.data)
    except KeyError:
        raise no_scene() from None
    except Conflict:
        raise Problem("scene-in-use", "Jobs that have not ended use this scene; cancel them first.") from None
    return Response(status_code=204)


def no_scene() -> Problem:
    return Problem("not-found", "There is no such scene.")


def etag_of(scene: Scene) -> str:
    """Return an entity tag: a scene's bytes never change, its state does once."""
    return f'"{scene.state.value}-{scene.id[7:23]}"'


def scene_answer(scene: Scene, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    more = {"etag": etag_of(scene), **(headers or {})}
    if scene.state is SceneState.CHECKING:
        more["retry-after"] = str(RETRY_AFTER_S)
    return json_answer(scene_json(scene), status, more)


def scene_json(scene: Scene) -> Json:
    """Return a scene's JSON: the results of the check beside the members of every scene."""
    return {
        **scene.facts,
        "id": scene.id,
        "object": "scene",
        "state": scene.state.value,
        "kind": scene.kind,
        "name": scene.name,
        "bytes": scene.bytes,
        "stored_bytes": scene.stored_bytes,
        "created_at": time_text(scene.created_at),
        "warnings": scene.warnings,
        "problem": scene.problem,
        "urls": {"self": f"/v1/scenes/{scene.id}"},
    }
