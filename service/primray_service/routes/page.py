"""The web page: the files of page/, those that it shares with views of stages (primray/live/page, below live/), and the only
headers that let a browser run scripts."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response

from primray import live

from ..http.callers import Serving
from ..http.routing import Router
from ..pictures.request import Space
from ..problems import Problem

FOLDER = Path(__file__).resolve().parents[1] / "page"
FOLDERS = {"": FOLDER, "live/": Path(live.__file__).resolve().parent / "page"}
MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".jpg": "image/jpeg",
    ".usda": "model/vnd.usda",  # examples
    ".txt": "text/plain; charset=utf-8",
    "": "text/plain; charset=utf-8",  # licences
}
# Everything comes from this server, nothing is inline. blob: is for pictures that the page fetches itself, to notice failures.
POLICY = (
    "default-src 'self'; img-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# A browser validates its copy each time: after an upgrade, old modules must not mix with new ones.
HEADERS = {
    "cache-control": "no-cache",
    "content-security-policy": POLICY,
    "cross-origin-opener-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "vary": "accept-encoding",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}

router = Router(resource="page")


@dataclass(frozen=True)
class Static:
    content: bytes
    packed: bytes
    media_type: str
    etag: str


@lru_cache(maxsize=1)
def files() -> dict[str, Static]:
    """Return the files by path below /page/. All are read once: only these can be requested."""
    return {
        below + path.relative_to(folder).as_posix(): _static(path.read_bytes(), MEDIA_TYPES[path.suffix])
        for below, folder in FOLDERS.items()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in MEDIA_TYPES
    }


def _static(content: bytes, media_type: str) -> Static:
    etag = hashlib.sha256(content).hexdigest()[:32]
    return Static(content, gzip.compress(content, 9, mtime=0), media_type, etag)


@router.get("/")
async def index(request: Request) -> Response:
    return _answer(request, "index.html")


def login_page(problem: Problem) -> Response:
    """Return the page that a person sees for the problem "unauthenticated": an explanation, and a field for the key."""
    headers = {**HEADERS, **problem.headers, "cache-control": "no-store"}
    return Response(files()["login.html"].content, problem.status, headers, media_type=MEDIA_TYPES[".html"])


OcioName = Annotated[str | None, Field(max_length=256)]


@router.get("/page/view-table")
async def view_table(
    request: Request,
    service: Serving,
    space: Space,
    view: OcioName = None,
    display: OcioName = None,
    look: OcioName = None,
) -> Response:
    """Return the display transform of the server's pictures as a table (pictures/process.py)."""
    return _answer_with(request, _table(await service.pictures.view_table(space, view, display, look)))


@lru_cache(maxsize=8)
def _table(content: bytes) -> Static:
    return _static(content, "application/octet-stream")


@router.get("/page/{path:path}")
async def file(request: Request, path: str) -> Response:
    return _answer(request, path)


def _answer(request: Request, path: str) -> Response:
    found = files().get(path)
    if found is None:
        raise Problem("not-found", "The page has no such file.")
    return _answer_with(request, found)


def _answer_with(request: Request, found: Static) -> Response:
    packed = _takes_gzip(request.headers.get("accept-encoding", "")) and len(found.packed) < len(found.content)
    # The compressed bytes are another representation, so they have an entity tag of their own (RFC 9110, section 8.8.3).
    etag = f'"{found.etag}-gz"' if packed else f'"{found.etag}"'
    headers = {**HEADERS, "etag": etag}
    known = {tag.strip().removeprefix("W/") for tag in request.headers.get("if-none-match", "").split(",")}
    if etag in known or "*" in known:
        return Response(status_code=304, headers=headers)
    if packed:
        headers["content-encoding"] = "gzip"
    return Response(found.packed if packed else found.content, headers=headers, media_type=found.media_type)


def _takes_gzip(accept: str) -> bool:
    for item in accept.split(","):
        name, _, weight = item.replace(" ", "").partition(";")
        if name.lower() == "gzip":
            return weight not in ("q=0", "q=0.0", "q=0.00", "q=0.000")
    return False
