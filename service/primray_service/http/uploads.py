"""Reception of scenes, for POST /v1/scenes and for POST /v1/jobs with a form: streamed, and refused early.

A server that refuses a body while it is being sent has to read on for a moment: a connection that is closed with bytes unread
is reset, and the client would see that instead of the answer.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Collection, Mapping
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from ..auth import Caller
from ..jobs import Scene as SceneRow
from ..limits import MiB, Quotas
from ..problems import Problem
from ..quotas import exceeded
from ..scenes.contents import keep_content
from ..scenes.keep import keep
from ..scenes.receive import UploadHead, receive
from ..scenes.staging import staging, to_the_end
from ..service import Service
from ..store.base import QuotaExceeded
from .answers import problem_answer
from .guard import request_id_of

LINGER_S = 1.0
LINGER_BYTES = 64 * MiB


async def receive_scene(
    request: Request, service: Service, caller: Caller, fields: Collection[str] = ()
) -> tuple[SceneRow | None, bool, dict[str, bytes]]:
    """Return the scene in a request's body, whether it is new, and a form's other parts by name. A form may lack a file
    (None)."""
    head = UploadHead(request.headers, request.query_params.get("name", ""))
    quotas = await asyncio.to_thread(service.quotas_of, caller)
    await refuse_over_quota(service, caller, quotas, head.length or 0)
    async with staging(service.data) as staged:
        received, found = await receive(_body(request), head, staged, service.data, service.limits, fields)
        if received is None:
            return None, False, found
        upload = received
        try:
            scene, is_new = await to_the_end(
                lambda: keep(upload, caller.tenant, service.store, service.data, service.limits, quotas, time.time())
            )
        except QuotaExceeded as error:
            usage = await asyncio.to_thread(service.store.usage, caller.tenant, time.time())
            raise exceeded(str(error.args[0]), quotas, usage) from None
    if is_new:
        service.dispatcher.wake()
    return scene, is_new, found


async def receive_content(request: Request, service: Service, caller: Caller, sha256: str) -> bool:
    """Store the file in a request's body, which must have this digest; return whether it is new."""
    head = UploadHead({name: value for name, value in request.headers.items() if name != "content-type"})
    quotas = await asyncio.to_thread(service.quotas_of, caller)
    await refuse_over_quota(service, caller, quotas, head.length or 0)
    async with staging(service.data) as staged:
        received, _ = await receive(_body(request), head, staged, service.data, service.limits)
        assert received is not None
        if received.sha256 != sha256:
            raise Problem("digest-mismatch", f"The body has the digest {received.sha256}, not {sha256}. Send it again.")
        file = received
        try:
            return await to_the_end(lambda: keep_content(file, caller.tenant, service.store, service.data, quotas, time.time()))
        except QuotaExceeded as error:
            usage = await asyncio.to_thread(service.store.usage, caller.tenant, time.time())
            raise exceeded(str(error.args[0]), quotas, usage) from None


async def refuse_over_quota(service: Service, caller: Caller, quotas: Quotas, coming: int) -> None:
    """Raise Problem before the body is read if the announced size exceeds the quota; the store makes the final decision."""
    if quotas.stored_bytes is None:
        return
    usage = await asyncio.to_thread(service.store.usage, caller.tenant, time.time())
    if usage.stored_bytes + coming > quotas.stored_bytes:
        raise exceeded("stored_bytes", quotas, usage, coming=coming)


async def _body(request: Request) -> AsyncIterator[bytes]:
    try:
        async for data in request.stream():
            yield data
        request.state.body_was_read = True
    except ClientDisconnect:
        raise Problem("upload-incomplete", "The connection ended before the body did.") from None


def refused(request: Request, problem: Problem) -> Response:
    """Return the answer to an upload that is refused while it may still be in progress."""
    answer = problem_answer(problem, request_id_of(request))
    if getattr(request.state, "body_was_read", False):
        return answer
    return Lingering(answer.body, answer.status_code, {**dict(answer.headers), "connection": "close"})


class Lingering(Response):
    """Response that reads on for a moment after it was sent, while the client is still sending."""

    def __init__(self, content: bytes | memoryview, status: int, headers: Mapping[str, str]) -> None:
        super().__init__(content, status, headers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        start: dict[str, Any] = {"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers}
        await send(start)
        await send({"type": "http.response.body", "body": self.body, "more_body": True})
        read = 0
        try:
            async with asyncio.timeout(LINGER_S):
                while read < LINGER_BYTES:
                    message = await receive()
                    read += len(message.get("body", b""))
                    if message["type"] != "http.request" or not message.get("more_body"):
                        break
        except TimeoutError:
            pass
        await send({"type": "http.response.body", "body": b"", "more_body": False})
