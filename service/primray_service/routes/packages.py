"""Uploads by content: a package as a list of its files, and the files that the tenant has not sent before."""

from __future__ import annotations

import asyncio
import time
from typing import Annotated

from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response

from ..api import views
from ..api.models import Sent
from ..auth import Caller
from ..http.answers import json_answer
from ..http.bodies import json_body
from ..http.callers import Serving, Submitter
from ..http.described import answer
from ..http.routing import Router
from ..http.uploads import receive_content, refuse_over_quota, refused
from ..jobs import Scene
from ..limits import Quotas
from ..problems import Problem
from ..scenes.contents import FileOfPackage, Manifest, Part, keep_package, manifest_of, missing_of
from ..scenes.recognize import display_name
from ..scenes.staging import to_the_end
from ..service import Service
from .scenes import BINARY, LINKS, scene_answer

router = Router("/v1", resource="packages", tag="scenes")

DIGEST = "^[0-9a-f]{64}$"
Digest = Annotated[str, Field(pattern=DIGEST, description="SHA-256 of the file, in hexadecimal digits.")]


class PackagePart(Sent):
    sha256: str = Field(pattern=DIGEST)
    bytes: int = Field(ge=1, le=2**50)


class PackageFile(Sent):
    path: str = Field(min_length=1, max_length=4096, description="Path in the package, with / between folders.")
    sha256: str = Field(pattern=DIGEST)
    bytes: int = Field(ge=0, le=2**50)
    parts: list[PackagePart] | None = Field(
        None, min_length=1, description="Byte ranges of the file that are sent separately, in order, such as a usdz's members."
    )


class PackageRequest(Sent):
    files: list[PackageFile] = Field(min_length=1, max_length=1_000_000)
    name: str = Field("", max_length=1024, description="Display name of the scene, usually the file's.")


EXAMPLE = {"name": "shot.zip", "files": [{"path": "shot.usda", "sha256": "0" * 64, "bytes": 1234}]}


@router.post(
    "/packages",
    answer(views.Package, 200, "Files to send before the request is repeated.", headers=()),
    answer(
        views.Scene,
        201,
        "All files are there: the scene is stored, and its check begins.",
        headers=("Location", "ETag"),
        links=LINKS,
    ),
    problems=(
        "upload-too-large",
        "digest-mismatch",
        "not-usd",
        "package-unsafe",
        "package-too-large",
        "quota-exceeded",
        "storage-full",
        "unavailable",
    ),
)
async def package(
    request: Request,
    caller: Submitter,
    service: Serving,
    asked: Annotated[PackageRequest, json_body(PackageRequest, EXAMPLE, limit="manifest_bytes")],
) -> Response:
    """Create a scene of files that the server has, or learn which ones to send.

    `missing` lists the digests that this tenant has not sent: PUT each to /v1/contents/{sha256}, then repeat the request. An
    interrupted upload is resumed in the same way. Files of other tenants make no difference.
    """
    files = [
        FileOfPackage(file.path, file.sha256, file.bytes, [Part(part.sha256, part.bytes) for part in file.parts or ()])
        for file in asked.files
    ]
    manifest = manifest_of(files, display_name(asked.name), service.limits)
    missing = await asyncio.to_thread(missing_of, manifest, caller.tenant, service.store, time.time())
    kept = None if missing else await _kept(service, caller, manifest)
    if kept is None:
        missing = missing or await asyncio.to_thread(missing_of, manifest, caller.tenant, service.store, time.time())
        if not missing:
            raise Problem(
                "unavailable",
                "The package's files are being changed by another request; repeat this one.",
                headers={"retry-after": "1"},
            )
        coming = sum(manifest.sizes[sha256] for sha256 in missing)
        await refuse_over_quota(service, caller, await _quotas(service, caller), coming)
        return json_answer({"id": manifest.scene_id, "missing": missing, "missing_bytes": coming})
    scene, is_new = kept
    if is_new:
        service.dispatcher.wake()
    return scene_answer(scene, 201, {"location": f"/v1/scenes/{scene.id}"})


async def _quotas(service: Service, caller: Caller) -> Quotas:
    return await asyncio.to_thread(service.quotas_of, caller)


async def _kept(service: Service, caller: Caller, manifest: Manifest) -> tuple[Scene, bool] | None:
    quotas = await _quotas(service, caller)
    if await asyncio.to_thread(service.store.scene, caller.tenant, manifest.scene_id) is None:
        await refuse_over_quota(service, caller, quotas, manifest.joined_bytes)  # before it is assembled
    return await to_the_end(
        lambda: keep_package(manifest, caller.tenant, service.store, service.data, service.limits, quotas, time.time())
    )


@router.put(
    "/contents/{sha256}",
    answer(None, 201, "The file is stored for packages that contain it."),
    answer(None, 200, "The file was sent before."),
    problems=(
        "upload-incomplete",
        "upload-too-large",
        "unsupported-media-type",
        "invalid-request",
        "digest-mismatch",
        "quota-exceeded",
        "storage-full",
    ),
    request={"requestBody": {"required": True, "description": "The file.", "content": {"application/octet-stream": BINARY}}},
    headers=("Repr-Digest",),
)
async def content(sha256: Digest, request: Request, caller: Submitter, service: Serving) -> Response:
    """Upload a file of a package. Its bytes must have the digest in the address; a file that belongs to no scene is removed
    after a day."""
    try:
        is_new = await receive_content(request, service, caller, sha256)
    except Problem as problem:
        return refused(request, problem)
    return Response(status_code=201 if is_new else 200)
