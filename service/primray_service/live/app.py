"""The HTTP application of `primray view`; all paths are below a secret one, for browsers on this machine only."""

from __future__ import annotations

import asyncio
import hmac
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from primray.errors import PrimrayError
from primray.live.viewer import Viewer

from ..routes import page as service_page
from .copied_command import copied_command

FOLDER = Path(__file__).resolve().parent / "page"
MOST_COMMAND_BYTES = 1 << 14
ALIVE_EVERY_S = 15.0
HOSTS = ("127.0.0.1", "localhost")
SAVED = {"png": "image/png", "exr": "image/x-exr"}
Answer = Callable[[Request], Awaitable[Response]]


class News:
    """Notifies the page's event streams; `changed` is thread-safe."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: set[asyncio.Event] = set()
        self.closing = False

    def changed(self) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for event in self._waiting:
            event.set()

    def close(self) -> None:
        self.closing = True
        self._wake()

    async def states(self, viewer: Viewer) -> AsyncIterator[bytes]:
        """Yield server-sent events: the state now, and after each change; a comment as a heartbeat in between."""
        event, last = asyncio.Event(), b""
        self._waiting.add(event)
        try:
            while not self.closing:
                text = json.dumps(viewer.state()).encode()
                yield b": still there\n\n" if text == last else b"data: " + text + b"\n\n"
                last = text
                try:
                    await asyncio.wait_for(event.wait(), ALIVE_EVERY_S)
                except TimeoutError:
                    continue
                event.clear()
        finally:
            self._waiting.discard(event)


def create_app(viewer: Viewer, news: News, token: str, name: str) -> Starlette:
    """Return the application for one viewer; `name` is the stage's display name."""

    async def index(request: Request) -> Response:
        return _file(FOLDER / "view.html")

    async def own_file(request: Request) -> Response:
        known = {path.name: path for path in FOLDER.iterdir()}
        path = known.get(request.path_params["name"])
        return _file(path) if path is not None else _refused(404, "not-found", "The page has no such file.")

    async def shared_file(request: Request) -> Response:
        found = service_page.files().get(request.path_params["path"])
        if found is None:
            return _refused(404, "not-found", "The page has no such file.")
        return Response(found.content, headers=service_page.HEADERS, media_type=found.media_type)

    async def events(request: Request) -> Response:
        headers = {**service_page.HEADERS, "cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(news.states(viewer), headers=headers, media_type="text/event-stream")

    async def stage(request: Request) -> Response:
        return _json(200, {"name": name})

    async def picture(request: Request) -> Response:
        return _picture(viewer)

    async def command(request: Request) -> Response:
        return await _command(request, viewer)

    async def saved(request: Request) -> Response:
        return await _saved(request.path_params["kind"], viewer, name)

    async def camera(request: Request) -> Response:
        return await _text(viewer.camera_text)

    async def shell(request: Request) -> Response:
        return await _text(lambda: copied_command(viewer.path, viewer.settings, viewer.looks, viewer.camera_text()))

    routes: list[tuple[str, Answer, str]] = [
        ("/", index, "GET"),
        ("/view/{name}", own_file, "GET"),
        ("/page/{path:path}", shared_file, "GET"),
        ("/stage", stage, "GET"),
        ("/events", events, "GET"),
        ("/picture", picture, "GET"),
        ("/commands", command, "POST"),
        ("/saved/{kind}", saved, "GET"),
        ("/camera", camera, "GET"),
        ("/shell", shell, "GET"),
    ]
    app = Starlette(routes=[Route("/{token}" + path, _guarded(answer, token), methods=[m]) for path, answer, m in routes])
    app.router.redirect_slashes = False
    return app


def _guarded(answer: Answer, token: str) -> Answer:
    """Return the handler restricted to requests with the token that address this machine: other host names come from DNS
    rebinding."""

    async def guarded(request: Request) -> Response:
        host = request.headers.get("host", "").partition(":")[0]
        known = hmac.compare_digest(request.path_params["token"].encode(), token.encode())
        if not known or host not in HOSTS:
            return _refused(
                404, "not-found", "Nothing is here. Use the complete address that `primray view` printed; it contains a secret."
            )
        return await answer(request)

    return guarded


def _picture(viewer: Viewer) -> Response:
    """Return the newest picture: rows from the top of R, G, B and A as bytes, with straight alpha. Its number and size are
    headers, and the token of the command that it is the first to show, if it is."""
    shown = viewer.shown
    if shown is None:
        return _refused(404, "no-picture", "No picture has been rendered yet.")
    height, width = shown.rgba.shape[:2]
    headers = {**service_page.HEADERS, "cache-control": "no-store"}
    headers |= {"x-picture": str(shown.number), "x-width": str(width), "x-height": str(height)}
    if shown.token is not None and shown.token.isascii() and shown.token.isprintable():
        headers["x-token"] = shown.token
    return Response(shown.rgba.tobytes(), headers=headers, media_type="application/octet-stream")


async def _saved(kind: str, viewer: Viewer, name: str) -> Response:
    """Return the picture that is shown as a file to save, named after the stage."""
    if kind not in SAVED:
        return _refused(404, "not-found", f"Pictures are saved as {' or '.join(SAVED)}.")
    try:
        content = await asyncio.to_thread(viewer.saved, f".{kind}")
    except PrimrayError as error:
        return _refused(409, error.code, error.message)
    file = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in Path(name).stem)
    headers = {**service_page.HEADERS, "cache-control": "no-store"}
    headers["content-disposition"] = f'attachment; filename="{file}.{kind}"'
    return Response(content, headers=headers, media_type=SAVED[kind])


async def _text(make: Callable[[], str]) -> Response:
    try:
        text = await asyncio.to_thread(make)
    except PrimrayError as error:
        return _refused(409, error.code, error.message)
    return Response(text, headers={**service_page.HEADERS, "cache-control": "no-store"}, media_type="text/plain; charset=utf-8")


async def _command(request: Request, viewer: Viewer) -> Response:
    """Run a command of `Viewer.tell`, as JSON. The media type makes browsers ask before another site's page may send it; we do
    not allow that."""
    if request.headers.get("content-type") != "application/json":
        return _refused(415, "unsupported-media-type", "Commands must be application/json.")
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > MOST_COMMAND_BYTES:
            return _refused(413, "request-too-large", f"A command may have at most {MOST_COMMAND_BYTES} bytes.")
    try:
        said: Any = json.loads(body)
        if not isinstance(said, dict):
            return _refused(400, "view-command", "A command must be a JSON object.")
        viewer.tell(said)
    except ValueError:
        return _refused(400, "invalid-json", "The command is not JSON.")
    except PrimrayError as error:
        return _refused(400, error.code, error.message)
    return Response(status_code=204, headers=service_page.HEADERS)


def _file(path: Path) -> Response:
    return Response(path.read_bytes(), headers=service_page.HEADERS, media_type=service_page.MEDIA_TYPES[path.suffix])


def _json(status: int, value: Any, media_type: str = "application/json") -> Response:
    return Response(json.dumps(value), status, headers=service_page.HEADERS, media_type=media_type)


def _refused(status: int, code: str, detail: str) -> Response:
    problem = {"type": f"/problems/{code}", "title": "It was refused", "status": status, "detail": detail}
    return _json(status, problem, "application/problem+json")
